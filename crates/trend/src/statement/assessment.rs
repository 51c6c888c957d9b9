//! The assessment of one unit at a date.

use crate::measured::level::Level;
use crate::measured::record::Record;
use crate::prior::UsageAxis;
use crate::statement::state::{Reason, State};
use crate::statement::types::{ChangePoint, Crossing, ForecastMethod, Rate, Utilization, WearStatus};
use crate::wear::bank::WearClass;

/// What is known of one unit on one day.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Assessment {
    /// Date of the assessment, microseconds since 1970 UTC; later data are ignored.
    pub as_of_us: i64,
    /// Flights with a row, refused ones included.
    pub flights: usize,
    /// Flights with a gap.
    pub estimates: usize,
    /// The unit's own hours, where its hours at the start are known.
    pub unit_hours: Option<f64>,
    /// The measured level at the last record.
    pub level: Option<Level>,
    /// The latest record.
    pub latest: Option<Record>,
    /// Spread of what an installation adds to every gap measured in it, metres: not a part of the level's error.
    pub installation_sd_m: f64,
    /// Growth of the level now.
    pub rate: Option<Rate>,
    /// Whether the unit wears.
    pub wear: WearStatus,
    /// Probability that the gap has grown by 2 % of the limit or more since it was new here, or reset.
    pub growth_probability: Option<f64>,
    /// Most probable class of wear laws, and its probability.
    pub law: Option<(WearClass, f64)>,
    /// Steps, resets and onsets, by departure.
    pub changes: Vec<ChangePoint>,
    /// When the act limit is met.
    pub crossing: Option<Crossing>,
    /// What the crossing was computed by.
    pub method: Option<ForecastMethod>,
    /// The usage that the forecast counts wear in.
    pub axis: Option<UsageAxis>,
    /// Flight hours since the last flight, at the unit's own rate.
    pub elapsed_hours: f64,
    /// Probability that the act limit is met before the next check ([`crate::Settings::check_interval_hours`]).
    pub check_probability: Option<f64>,
    /// Probability that the gap is at or above the limit on the date of the assessment: by the measured level with what
    /// its installation adds, or by the forecast with the usage since, whichever is more.
    pub over_limit_probability: Option<f64>,
    /// How the unit is used now, to turn hours into flights and days.
    pub utilization: Option<Utilization>,
    /// Flights whose gap was left out as an outlier, by departure.
    pub outliers_us: Vec<i64>,
    /// Variance found between flights over the variance stated.
    pub noise_factor: f64,
    /// Days since the last sound record where they are more than [`crate::Settings::stale_after_days`]. Silence clears no
    /// alarm.
    pub stale_days: Option<f64>,
    /// What to do.
    pub state: State,
    /// Why this state.
    pub reason: Reason,
}
