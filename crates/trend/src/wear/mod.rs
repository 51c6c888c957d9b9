//! Wear laws, the bank of candidate curves made of them, and the components of a posterior.

pub(crate) mod bank;

use crate::wear::bank::WearLaw;

/// Assumed age of a unit at its first flight in the data, where the age is unknown and the wear law depends on it.
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
    /// Age of the law at the begin of the segment, and at its end.
    pub(crate) age_begin: f64,
    pub(crate) age_now: f64,
    /// Metres per unit of the law's value.
    pub(crate) amplitude_m: f64,
    pub(crate) ln_life: f64,
    pub(crate) level_m: f64,
    pub(crate) new_m: f64,
    pub(crate) age_assumption: AgeAssumption,
    /// The onset is still to come, after an exponentially distributed time.
    pub(crate) onset_pending: bool,
    /// Log weight, then (normalised) weight.
    pub(crate) weight: f64,
}

impl Component {
    /// The family to whose share the component counts: *onset* if the onset is still to come.
    pub(crate) fn family(&self) -> usize {
        if self.onset_pending { WearLaw::Onset { start: 0.0 }.family() } else { self.law.family() }
    }
}
