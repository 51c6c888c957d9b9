//! Wear laws, the bank of candidate curves made of them, and the components that fits leave.

pub(crate) mod bank;

use crate::wear::bank::WearLaw;

/// What had to be guessed of a unit's age at first sight, where the law makes a difference.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum AgeAssumption {
    NotNeeded,
    Fresh,
    Worn,
}

/// One wear law with one amplitude, and its weight.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Component {
    pub(crate) law: WearLaw,
    /// Usage at the segment's begin on the law's own clock, and at its end.
    pub(crate) age_begin: f64,
    pub(crate) age_now: f64,
    /// Metres per unit of height.
    pub(crate) amplitude_m: f64,
    pub(crate) ln_life: f64,
    pub(crate) level_m: f64,
    pub(crate) new_m: f64,
    pub(crate) age_assumption: AgeAssumption,
    /// Onset not seen yet: it comes after an exponential wait.
    pub(crate) onset_pending: bool,
    /// Log weight, then (normalised) weight.
    pub(crate) weight: f64,
}

impl Component {
    /// The family whose share it counts for: a component that waits will have an onset.
    pub(crate) fn family(&self) -> usize {
        if self.onset_pending { WearLaw::Onset { start: 0.0 }.family() } else { self.law.family() }
    }
}
