//! The published estimate in one call: filter, statistic, and their inputs.

use crate::error::Error;
use crate::gap::load_band::{self, LoadBand};
use crate::gap::statistic::{self, GapStatistic};
use crate::kalman::batch::FilterWorkspace;
use crate::kalman::filter::Filter;
use crate::kalman::gain_schedule::GainSchedule;
use crate::samples::Samples;

/// The paper's estimate (equations 29–31) with the quantities of its record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MidRangeEstimate {
    /// ΔS and its two sets.
    pub gap: GapStatistic,
    /// What the load did.
    pub load: LoadBand,
    /// Mean normalised innovation squared.
    pub nis: f64,
    /// Samples S was estimated at.
    pub samples: usize,
}

/// Runs the filter over the samples and takes the statistic over all segments together.
///
/// # Errors
/// When the channels do not fit, nothing was measured, or S does not move.
pub fn estimate(samples: &Samples<'_>, filter: &Filter) -> Result<MidRangeEstimate, Error> {
    estimate_with(samples, &GainSchedule::new(filter), &mut FilterWorkspace::default())
}

/// As [`estimate`], for one series of many: by a schedule that they share, in a room that they use in turn.
///
/// # Errors
/// As [`estimate`].
pub fn estimate_with(
    samples: &Samples<'_>,
    schedule: &GainSchedule,
    room: &mut FilterWorkspace,
) -> Result<MidRangeEstimate, Error> {
    let load = load_band::load_band(samples.load_n, samples.segments);
    let (nis, _) = schedule.filter_with(samples, None, room)?;
    let gap = statistic::mid_range(room.s_m())?;
    let load = load.ok_or(Error::NothingMeasured)?;
    Ok(MidRangeEstimate { gap, load, nis, samples: gap.upper + gap.lower })
}
