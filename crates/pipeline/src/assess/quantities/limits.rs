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
    /// Whether it belongs to a sensor or to the recorder, not to the unit.
    pub(crate) fn is_of_sensor(&self) -> bool {
        self.is_of_channel || self.is_of_position
    }

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
                limit: limits.lost_motion_share.or(Some(0.25)),
                least_scatter: 0.002,
                states: (Some("lost_motion_rising"), None),
                ..own
            },
            Quantity::StiffnessNPerM => Self {
                limit: limits.stiffness_share.or(Some(0.05)),
                least_scatter: 0.001,
                states: (Some("stiffening"), Some("softening")),
                ..own
            },
            Quantity::FrictionN => Self {
                limit: limits.friction_share.or(Some(0.1)),
                states: (Some("friction_rising"), Some("friction_falling")),
                ..own
            },
            Quantity::GapM | Quantity::FrictionDryN | Quantity::FrictionLoadShare => own,
            Quantity::SkewS => Self {
                scale: Scale::One,
                limit: limits.delay_s.or(Some(0.5e-3)),
                least_scatter: 2e-5,
                states: (Some("delay_moved"), Some("delay_moved")),
                ..channel
            },
            Quantity::LoadZeroN => Self {
                scale: Scale::UsualLoad,
                limit: limits.load_zero_share.or(Some(0.02)),
                least_scatter: 0.002,
                states: (Some("load_zero_moved"), Some("load_zero_moved")),
                ..position
            },
            Quantity::LoadDelayS => Self {
                scale: Scale::One,
                limit: limits.load_delay_s.or(Some(1e-3)),
                least_scatter: 1e-4,
                states: (Some("load_delay_moved"), Some("load_delay_moved")),
                ..channel
            },
            Quantity::Nis => Self {
                limit: limits.nis_share.or(Some(1.0)),
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

    use records::ChangeScope;
    use strum::VariantArray;

    use super::*;

    /// The configuration of alerts refuses words that no quantity has.
    #[test]
    fn alerts_know_every_state_of_a_quantity() {
        let limits = QuantityLimits::default();
        let states = Quantity::VARIANTS.iter().map(|quantity| Treatment::of(*quantity, &limits).states);
        let common = [ChangeScope::Tail, ChangeScope::Part].into_iter().filter_map(ChangeScope::state);
        let states: BTreeSet<&str> =
            states.flat_map(|(rise, fall)| rise.into_iter().chain(fall)).chain(common).collect();
        assert_eq!(states, BTreeSet::from(job::config::alerts::QUANTITY_STATES));
    }
}
