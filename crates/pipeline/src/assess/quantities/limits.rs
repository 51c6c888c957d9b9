//! What each quantity is measured by: its scale, the change that matters, the scatter to assume, and its states.

use job::config::QuantityLimits;
use records::Quantity;

/// How a quantity is followed.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Treatment {
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
        let channel = Self { scale: Scale::One, is_of_channel: true, ..own };
        match quantity {
            Quantity::GapM | Quantity::FrictionDryN | Quantity::FrictionLoadShare => own,
            Quantity::LostMotionM => {
                let of = own.limited(limits.lost_motion_share, 0.25, 0.002, "lost_motion_rising");
                Self { states: (of.states.0, None), ..of }
            }
            Quantity::StiffnessNPerM => {
                let of = own.limited(limits.stiffness_share, 0.05, 0.001, "stiffening");
                Self { states: (of.states.0, Some("softening")), ..of }
            }
            Quantity::FrictionN => {
                let of = own.limited(limits.friction_share, 0.1, 0.02, "friction_rising");
                Self { states: (of.states.0, Some("friction_falling")), ..of }
            }
            Quantity::SkewS => channel.limited(limits.delay_s, 0.5e-3, 2e-5, "delay_moved"),
            Quantity::LoadZeroN => Self {
                scale: Scale::UsualLoad,
                ..position.limited(limits.load_zero_share, 0.02, 0.002, "load_zero_moved")
            },
            Quantity::LoadDelayS => channel.limited(limits.load_delay_s, 1e-3, 1e-4, "load_delay_moved"),
            Quantity::Nis => position.limited(limits.nis_share, 1.0, 0.05, "innovations_moved"),
        }
    }

    /// The same with a limit, configured or usual, a smallest scatter, and one state of a rise and of a fall.
    fn limited(self, configured: Option<f64>, usual: f64, least_scatter: f64, state: &'static str) -> Self {
        let limit = Some(configured.unwrap_or(usual));
        Self { limit, least_scatter, states: (Some(state), Some(state)), ..self }
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
