//! The published estimate in one call: filter, statistic, and what they stand on.

use crate::Samples;
use crate::error::Error;
use crate::filter::Filter;
use crate::gap::{self, Gap};
use crate::load::{self, LoadBand};
use crate::schedule::Schedule;
use crate::track::Room;

/// The paper's number with everything a record says about it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MidRange {
    /// ΔS and its two sets.
    pub gap: Gap,
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
pub fn estimate(samples: &Samples<'_>, filter: &Filter) -> Result<MidRange, Error> {
    estimate_in(samples, &Schedule::new(filter), &mut Room::default())
}

/// As [`estimate`], for one series of many: by a schedule that they share, in a room that they use in turn.
///
/// # Errors
/// As [`estimate`].
pub fn estimate_in(samples: &Samples<'_>, schedule: &Schedule, room: &mut Room) -> Result<MidRange, Error> {
    let load = load::band(samples.load_n, samples.segments);
    let (nis, _) = schedule.track_in(samples, None, room)?;
    let gap = gap::mid_range(room.s_m())?;
    let load = load.ok_or(Error::NothingMeasured)?;
    Ok(MidRange { gap, load, nis, samples: gap.upper + gap.lower })
}
