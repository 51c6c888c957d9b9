//! Limits and horizons of an assessment.

use crate::error::Error;

/// Sizes that a limit [m], a horizon [h] or a number of days can have.
const PLAUSIBLE: std::ops::RangeInclusive<f64> = 1e-9..=1e9;

/// An unrecorded change is reported for this many days.
pub(crate) const CHANGE_WATCH_DAYS: f64 = 30.0;

/// Limits and horizons of one part number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Removal limit, m: state `act` at or above; a crossing is a crossing of this limit.
    pub limit_m: f64,
    /// Watch limit, m: state `watch` at or above.
    pub watch_m: f64,
    /// State `plan` when the 5 % crossing lies within this many flight hours.
    pub planning_horizon_hours: f64,
    /// A crossing later than this many flight hours is *beyond the horizon*.
    pub horizon_hours: f64,
    /// Flight hours until the next check, for the probability of passing the limit before it.
    pub check_interval_hours: f64,
    /// Without a sound record for this many days the state is `unassessed`.
    pub stale_after_days: f64,
}

impl Settings {
    /// Settings for an act limit: watch at 80 % of it, planning 500 h, horizon 20,000 h, checks
    /// every 300 h, stale after 30 days.
    pub fn for_limit(limit_m: f64) -> Self {
        Self {
            limit_m,
            watch_m: 0.8 * limit_m,
            planning_horizon_hours: 500.0,
            horizon_hours: 20_000.0,
            check_interval_hours: 300.0,
            stale_after_days: 30.0,
        }
    }

    /// Checks that all settings are positive and ordered.
    ///
    /// # Errors
    /// [`Error::Setting`] for a value that is not positive or not plausible, [`Error::LimitOrder`].
    pub(crate) fn check(&self) -> Result<(), Error> {
        let values = [
            ("limit_m", self.limit_m),
            ("watch_m", self.watch_m),
            ("planning_horizon_hours", self.planning_horizon_hours),
            ("horizon_hours", self.horizon_hours),
            ("check_interval_hours", self.check_interval_hours),
            ("stale_after_days", self.stale_after_days),
        ];
        if let Some(&(name, value)) = values.iter().find(|(_, v)| !PLAUSIBLE.contains(v)) {
            return Err(Error::Setting { name, value });
        }
        if self.watch_m > self.limit_m {
            return Err(Error::LimitOrder { watch_m: self.watch_m, limit_m: self.limit_m });
        }
        Ok(())
    }
}
