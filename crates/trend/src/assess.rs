//! Assessment of one unit at a date.

use crate::data::series::Series;
use crate::error::Error;
use crate::incremental::snapshot::UnitSnapshot;
use crate::prior::fleet_prior::FleetPrior;
use crate::settings::Settings;
use crate::statement::assessment::Assessment;
use crate::statement::state::State;

/// Assesses a unit at a date from its flights until then: posterior of a bank of wear laws by Bayesian model averaging
/// (Hoeting et al. 1999, <https://doi.org/10.1214/ss/1009212519>), the level as a random walk behind a Kalman filter.
///
/// Dates are microseconds since 1970 UTC, gaps metres, usage flight hours; `docs/prognostics.md` describes the method.
/// The crate page has an example.
///
/// `prior` is the prior of the part number's fleet, learned from nothing later than the same date; without one the
/// unit is assessed by its own data alone. `previous` is the unit's previous state, which it leaves only when it is
/// clearly past the limit that caused it.
///
/// # Errors
/// [`Error::Setting`] or [`Error::LimitOrder`] for unusable settings.
pub fn assess(
    series: &Series,
    as_of_us: i64,
    settings: &Settings,
    prior: Option<&FleetPrior>,
    previous: Option<State>,
) -> Result<Assessment, Error> {
    settings.check()?;
    let uninformative = FleetPrior::uninformative(settings.limit_m);
    let prior = prior.unwrap_or(&uninformative);
    let (snapshot, current) = UnitSnapshot::current(series, as_of_us, prior);
    Ok(snapshot.statement(current, as_of_us, series.maintenance_until(as_of_us), settings, prior, previous))
}
