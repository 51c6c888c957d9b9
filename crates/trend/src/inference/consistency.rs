//! Consistency check: a posterior must agree with the unit's last records, in level and in rate.
//!
//! A confident prior can outweigh the data of a unit: a fleet without wear, with equal new gaps, leaves no candidate
//! for a unit near its limit. Such a posterior gives no forecast; the measured state stays.

use crate::inference::posterior::Posterior;
use crate::measured::Measured;
use crate::measured::level::measured_level;
use crate::measured::record::Record;
use crate::prior::FleetPrior;
use crate::statement::history::History;
use crate::wear::Component;

/// Standard errors beyond which the level is not that of the records.
const REACH: f64 = 5.0;

/// Records from which their scatter is a measure.
const SCATTER_RECORDS: usize = 8;

/// The posterior's rate over that of a significant line.
const RATE_RATIO: std::ops::RangeInclusive<f64> = 0.7..=1.8;

/// Standard errors of the line's slope that are allowed in addition.
const RATE_REACH: f64 = 2.0;

/// Whether a posterior has the level of the last records at their mean usage, and the rate of a significant line now;
/// also false where a figure is not a number.
///
/// The undone offset and the season are taken off the records first.
pub(crate) fn agrees(
    posterior: &Posterior,
    measured: &Measured,
    history: &History<'_>,
    prior: &FleetPrior,
) -> bool {
    let Some(records) = last_records(measured, prior.limit_m()) else { return false };
    let season = |us: i64| prior.season.mean_m * prior.season.wave(us as f64);
    let adjusted_m = |r: &Record| r.gap_m - history.undone_m - season(r.departure_us);
    let weight: f64 = records.iter().map(|r| r.error_m.powi(-2)).sum();
    let mean = |of: &dyn Fn(&Record) -> f64| {
        records.iter().map(|r| r.error_m.powi(-2) * of(r)).sum::<f64>() / weight
    };
    let gap_m = mean(&adjusted_m);
    // Stated errors that are too large would accept any level: the scatter is a second criterion.
    let scatter_m2 = mean(&|r| (adjusted_m(r) - gap_m).powi(2));
    let error_m2 =
        if records.len() >= SCATTER_RECORDS { weight.recip().min(scatter_m2) } else { weight.recip() };
    let since = history.now - mean(&|r| prior.usage(&history.data.flights[r.flight]));
    let then = |component: &Component| {
        let value = |age: f64| component.law.value(age);
        let grown = value(component.age_now) - value(component.age_now - since);
        component.weight * (component.level_m - component.amplitude_m * grown)
    };
    let level_m: f64 = posterior.components.iter().map(then).sum();
    let systematic_m2 = prior.bias_sd_m.powi(2) + prior.season.sd_m.powi(2) + history.offset_m2;
    let has_level = (level_m - gap_m).abs() <= REACH * (error_m2 + systematic_m2).sqrt();
    let has_rate = measured.rise.is_none_or(|rise| {
        let rate = |n: &Component| n.weight * n.amplitude_m * n.law.derivative(n.age_now);
        let m_per_hour =
            posterior.components.iter().map(rate).sum::<f64>() / prior.hours_per_usage(history.data.flights);
        let within = RATE_REACH * rise.m_per_hour_se;
        m_per_hour >= RATE_RATIO.start() * rise.m_per_hour - within
            && m_per_hour <= RATE_RATIO.end() * rise.m_per_hour + within
    });
    has_level && has_rate
}

/// The records of the measured level; without a lone last record, which the next one confirms or refutes, unless it is the
/// first after a renewal.
fn last_records(measured: &Measured, limit_m: f64) -> Option<&[Record]> {
    let (level, sound) = (measured.level?, &measured.sound[..]);
    let (last, before) = sound.split_last()?;
    let is_lone = level.records == 1 && before.last().is_some_and(|record| record.renewals == last.renewals);
    let rest = measured_level(before, limit_m).filter(|rest| is_lone && rest.records > 1);
    if let Some(rest) = rest {
        return Some(&before[before.len().saturating_sub(rest.window)..]);
    }
    Some(&sound[sound.len().saturating_sub(level.window)..])
}
