//! Assessment of one unit at a date.

use crate::data::series::{DAY_US, Series};
use crate::error::Error;
use crate::math::{NORMAL_95, normal_cdf};
use crate::measured::exceedance::Exceedance;
use crate::measured::rise::Rise;
use crate::prior::{FleetPrior, UsageAxis};
use crate::settings::Settings;
use crate::statement::assessment::Assessment;
use crate::statement::crossing::{GapsAhead, RulDistribution};
use crate::statement::level;
use crate::statement::state::{EarliestCrossing, alert_state};
use crate::statement::types::{Crossing, ForecastMethod, Rate, WearStatus};
use crate::statement::utilization::utilization;
use crate::unit_fit::{Fit, UnitFit};

/// Assesses a unit at a date from its flights until then.
///
/// The state is the more urgent of two: that of the last records of the installation, and that of the forecast. The forecast
/// is by a bank of wear laws with Bayesian model averaging (Hoeting et al. 1999,
/// <https://doi.org/10.1214/ss/1009212519>) if it agrees with these records, else by the line through them.
///
/// Dates are microseconds since 1970 UTC, gaps metres, usage flight hours; `docs/prognostics.md` describes the method.
/// The crate page has an example.
///
/// `prior` is the prior of the part number's fleet, learned from nothing later than the same date; without one the
/// forecast uses the unit's own data alone.
///
/// # Errors
/// [`Error::Setting`] or [`Error::LimitOrder`] for unusable settings.
pub fn assess(
    series: &Series,
    as_of_us: i64,
    settings: &Settings,
    prior: Option<&FleetPrior>,
) -> Result<Assessment, Error> {
    let unit = UnitFit::new(series, as_of_us, settings, prior)?;
    let flights = unit.history.data.flights;
    let utilization = utilization(flights);
    let elapsed_hours = flights.last().zip(utilization).map_or(0.0, |(last, now)| {
        now.hours_per_day * as_of_us.saturating_sub(last.departure_us).max(0) as f64 / DAY_US as f64
    });
    // The wear laws of a unit that was renewed after its last record are those of its former life.
    let fit = unit.fit.as_ref().filter(|_| unit.measured.renewed_us.is_none());
    let mut found = with_forecast(&unit, fit, settings, elapsed_hours);
    let rises = unit.measured.rise.map(|_| 1.0);
    let growth_probability = rises.or(found.growth_probability).unwrap_or_default();
    let earliest = found.crossing.and_then(|crossing| crossing.p05_hours);
    let earliest =
        earliest.map(|p05_hours| EarliestCrossing { p05_hours, growth_probability, elapsed_hours });
    (found.state, found.reason) = alert_state(as_of_us, &unit.measured, earliest, &unit.changes, settings);
    let last_us = unit.measured.last_sound_us();
    let level = unit.measured.level.filter(|_| unit.measured.renewed_us.is_none());
    let over_limit_probability = level.map(|level| {
        // The level's standard error does not include the bias of the installation.
        let error_m = level.se_m.hypot(unit.prior.bias_sd_m).max(f64::MIN_POSITIVE);
        let by_forecast = found.over_limit_probability.unwrap_or_default();
        normal_cdf((level.gap_m - settings.limit_m) / error_m).max(by_forecast)
    });
    Ok(Assessment {
        as_of_us,
        flights: flights.len(),
        estimates: unit.history.estimates.len(),
        unit_hours: series.unit_hours_at_start.zip(flights.last()).map(|(start, last)| start + last.hours),
        level: unit.measured.level,
        latest: unit.measured.latest,
        installation_sd_m: unit.prior.bias_sd_m,
        law: fit.and_then(|fit| level::law(&fit.posterior, found.wear == WearStatus::Wearing)),
        elapsed_hours,
        over_limit_probability,
        // Wear does not shrink: a limit that is reached now is also reached by the next check.
        check_probability: found
            .check_probability
            .map(|share| share.max(over_limit_probability.unwrap_or(0.0))),
        utilization,
        outliers_us: unit.outliers_us(),
        noise_factor: unit.history.noise_factor,
        stale_days: last_us
            .map(|last_us| as_of_us.saturating_sub(last_us) as f64 / DAY_US as f64)
            .filter(|days| *days > settings.stale_after_days),
        changes: unit.changes,
        ..found
    })
}

/// The part of an assessment that a forecast gives: by wear laws, else by the line through the last records.
fn with_forecast(
    unit: &UnitFit<'_>,
    fit: Option<&Fit>,
    settings: &Settings,
    elapsed_hours: f64,
) -> Assessment {
    let mut found = match (fit, unit.rise_now()) {
        (Some(fit), rise) => {
            let mut found = by_laws(fit, unit, settings, elapsed_hours);
            if let (Some(crossing), Some(rise)) = (&mut found.crossing, rise) {
                // The earliest time must not be after that of the line through the last records.
                let by_line = rise.p05_hours;
                crossing.p05_hours = Some(crossing.p05_hours.map_or(by_line, |hours| hours.min(by_line)));
            }
            found
        }
        (None, Some(rise)) => by_line(&rise, settings, elapsed_hours),
        (None, None) => Assessment::default(),
    };
    match unit.measured.exceedance {
        Some(Exceedance::Confirmed { .. } | Exceedance::Held) => {
            let over = Some(0.0);
            found.crossing = Some(Crossing { p05_hours: over, p50_hours: over, p95_hours: over });
            found.method = Some(ForecastMethod::Measured);
            found.check_probability = Some(1.0);
        }
        // The limit may be reached already: later records confirm or clear it.
        Some(Exceedance::Unconfirmed { .. } | Exceedance::Repeated { .. }) => {
            found.crossing.iter_mut().for_each(|crossing| crossing.p05_hours = Some(0.0));
        }
        None => {}
    }
    found
}

/// The part of an assessment that the line through the last records gives.
fn by_line(rise: &Rise, settings: &Settings, elapsed_hours: f64) -> Assessment {
    let within = |hours: f64| Some(hours).filter(|hours| *hours <= settings.horizon_hours);
    let reach = NORMAL_95 * rise.m_per_hour_se;
    Assessment {
        crossing: Some(Crossing {
            p05_hours: within(rise.p05_hours),
            p50_hours: within(rise.p50_hours),
            p95_hours: within(rise.p95_hours),
        }),
        method: Some(ForecastMethod::Line),
        axis: Some(UsageAxis::Hours),
        rate: Some(Rate {
            p05_m_per_hour: rise.m_per_hour - reach,
            m_per_hour: rise.m_per_hour,
            p95_m_per_hour: rise.m_per_hour + reach,
        }),
        wear: WearStatus::Wearing,
        growth_probability: Some(1.0),
        check_probability: Some(chance_by(settings.check_interval_hours, rise)),
        over_limit_probability: Some(chance_by(elapsed_hours, rise)).filter(|_| elapsed_hours > 0.0),
        ..Assessment::default()
    }
}

/// The part of an assessment that the mixture of wear laws gives.
fn by_laws(fit: &Fit, unit: &UnitFit<'_>, settings: &Settings, elapsed_hours: f64) -> Assessment {
    let ratio = fit.prior.hours_per_usage(unit.history.data.flights);
    // The laws are fitted to the gaps minus the rise of steps; the unit still has that rise, so its limit is nearer.
    let limit_m = (settings.limit_m - unit.history.undone_m.max(0.0)).max(f64::MIN_POSITIVE);
    let settings = &Settings { limit_m, ..*settings };
    let remaining = RulDistribution::new(&fit.posterior, &fit.prior, settings, ratio, unit.history.offset_m2);
    let variance_m2 = unit.history.offset_m2 + fit.prior.bias_sd_m.powi(2);
    let share_over = |hours: f64| {
        GapsAhead::after(&fit.posterior, hours / ratio, variance_m2, &fit.prior).share_from(settings.limit_m)
    };
    let growth_probability = level::growth_probability(&fit.posterior, fit.prior.limit_m());
    Assessment {
        crossing: Some(remaining.crossing()),
        method: Some(fit.method),
        axis: Some(fit.prior.axis),
        rate: Some(level::rate(&fit.posterior, ratio, fit.prior.interval_width)),
        wear: match growth_probability {
            ..0.5 => WearStatus::Steady,
            probability if probability > 0.95 => WearStatus::Wearing,
            _ => WearStatus::Unknown,
        },
        growth_probability: Some(growth_probability),
        check_probability: Some(share_over(settings.check_interval_hours)),
        over_limit_probability: Some(share_over(elapsed_hours)),
        ..Assessment::default()
    }
}

/// Probability that the line reaches the limit within some hours: log-normal with the line's 5 % point and median.
fn chance_by(hours: f64, rise: &Rise) -> f64 {
    if rise.p50_hours <= hours {
        return 1.0 - 0.5 * rise.p50_hours / hours.max(f64::MIN_POSITIVE);
    }
    let spread = (rise.p50_hours / rise.p05_hours.max(f64::MIN_POSITIVE)).ln() / NORMAL_95;
    normal_cdf((hours / rise.p50_hours).ln() / spread.max(1e-3))
}
