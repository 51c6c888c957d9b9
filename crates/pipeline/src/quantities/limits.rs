//! What each quantity is measured by: its scale, the change that matters, the scatter to assume, and its states.

use job::config::QuantityLimits;
use records::Quantity;

/// How a quantity is followed.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Treatment {
    /// What its limit is a share of.
    pub(crate) scale: Scale,
    /// Change from which there is a state, over the scale; none for a quantity that has no state.
    pub(crate) limit: Option<f64>,
    /// Smallest scatter between flights to assume, over the scale.
    pub(crate) least_scatter: f64,
    /// State of a rise and of a fall.
    pub(crate) states: (Option<&'static str>, Option<&'static str>),
    /// Whether it belongs to the channels of a position, whichever unit is installed there.
    pub(crate) is_of_channel: bool,
    /// Whether it belongs to a unit at its position, so that a unit that moves begins a new series.
    pub(crate) is_of_position: bool,
}

/// What a quantity's limit is a share of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Scale {
    /// The unit's own median.
    Median,
    /// The unit's usual 95 % load.
    UsualLoad,
    /// Nothing: the limit has the quantity's unit.
    One,
}

impl Treatment {
    /// Treatment of a quantity under configured limits.
    pub(crate) fn of(quantity: Quantity, limits: &QuantityLimits) -> Self {
        let own = Self {
            scale: Scale::Median,
            limit: None,
            least_scatter: 0.02,
            states: (None, None),
            is_of_channel: false,
            is_of_position: false,
        };
        let position = Self { is_of_position: true, ..own };
        let channel = Self { is_of_channel: true, ..own };
        match quantity {
            Quantity::LostMotionM => Self {
                limit: Some(limits.lost_motion_share),
                least_scatter: 0.002,
                states: (Some("lost_motion_rising"), None),
                ..own
            },
            Quantity::StiffnessNPerM => Self {
                limit: Some(limits.stiffness_share),
                least_scatter: 0.001,
                states: (Some("stiffening"), Some("softening")),
                ..own
            },
            Quantity::FrictionN => Self {
                limit: Some(limits.friction_share),
                states: (Some("friction_rising"), Some("friction_falling")),
                ..own
            },
            Quantity::GapM | Quantity::FrictionDryN | Quantity::FrictionLoadShare => own,
            Quantity::SkewS => Self {
                scale: Scale::One,
                limit: Some(limits.delay_s),
                least_scatter: 2e-5,
                states: (Some("delay_moved"), Some("delay_moved")),
                ..channel
            },
            Quantity::LoadZeroN => Self {
                scale: Scale::UsualLoad,
                limit: Some(limits.load_zero_share),
                least_scatter: 0.002,
                states: (Some("load_zero_moved"), Some("load_zero_moved")),
                ..position
            },
            Quantity::LoadDelayS => Self {
                scale: Scale::One,
                limit: Some(limits.load_delay_s),
                least_scatter: 1e-4,
                states: (Some("load_delay_moved"), Some("load_delay_moved")),
                ..channel
            },
            Quantity::Nis => Self {
                limit: Some(limits.nis_share),
                least_scatter: 0.05,
                states: (Some("innovations_moved"), Some("innovations_moved")),
                ..position
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    /// The configuration of alerts refuses words that no quantity has.
    #[test]
    fn alerts_know_every_state_of_a_quantity() {
        let states = Quantity::ALL.map(|quantity| Treatment::of(quantity, &QuantityLimits::default()).states);
        let states: BTreeSet<&str> =
            states.into_iter().flat_map(|(rise, fall)| rise.into_iter().chain(fall)).collect();
        assert_eq!(states, BTreeSet::from(job::config::alerts::QUANTITY_STATES));
    }
}
