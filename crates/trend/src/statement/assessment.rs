//! The assessment of one unit at a date.

use crate::statement::state::{Reason, State};
use crate::statement::types::{ChangePoint, Crossing, Level, Rate, Utilization, WearStatus};
use crate::wear::bank::WearClass;

/// Inspection intervals for which the chance of meeting the limit is stated, flight hours.
pub const INTERVAL_HOURS: [f64; 14] =
    [25.0, 50.0, 75.0, 100.0, 150.0, 200.0, 300.0, 400.0, 500.0, 750.0, 1000.0, 1500.0, 2000.0, 3000.0];

/// What is known of one unit on one day.
#[derive(Debug, Clone, PartialEq)]
pub struct Assessment {
    /// Date of the assessment, microseconds since 1970 UTC; later data are ignored.
    pub as_of_us: i64,
    /// Flights with a row, refused ones included.
    pub flights: usize,
    /// Flights with a gap.
    pub estimates: usize,
    /// The unit's own hours, where its hours at the start are known.
    pub unit_hours: Option<f64>,
    /// The gap now.
    pub level: Option<Level>,
    /// Its growth now.
    pub rate: Option<Rate>,
    /// Does it wear?
    pub wear: WearStatus,
    /// Probability that the gap has grown by 2 % of the limit or more since it was new here, or reset.
    pub growth_probability: Option<f64>,
    /// Most probable class of wear laws, and its probability.
    pub law: Option<(WearClass, f64)>,
    /// Steps, resets and onsets, by departure.
    pub changes: Vec<ChangePoint>,
    /// When the act limit is met.
    pub crossing: Option<Crossing>,
    /// Probability that it is met before the next check ([`crate::Settings::check_interval_hours`]).
    pub check_probability: Option<f64>,
    /// Probabilities that it is met within each of [`INTERVAL_HOURS`], in the widths that the fleet's past forecasts
    /// were found to need.
    pub interval_chances: Option<[f64; INTERVAL_HOURS.len()]>,
    /// How the unit is used now, to turn hours into flights and days.
    pub utilization: Option<Utilization>,
    /// Flights whose gap was left out as an outlier, by departure.
    pub outliers_us: Vec<i64>,
    /// Variance found between flights over the variance stated.
    pub noise_factor: f64,
    /// Days since the last estimate where they are more than [`crate::Settings::stale_after_days`]: the state is then that of
    /// the last estimate. Silence clears no alarm.
    pub stale_days: Option<f64>,
    /// What to do; nothing when no estimate supports a state.
    pub state: Option<State>,
    /// Why this state, or why none.
    pub reason: Reason,
}
