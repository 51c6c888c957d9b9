//! Flights in which the filter was surprised unlike in this unit's others.
//!
//! The tuning asks for a bandwidth, not for white innovations, so their normalised square (NIS) is not 1 even
//! when all is well, and χ² bounds mean nothing. What a unit's own flights show is its bound.

use crate::monitoring::REPORTED_DAYS;
use jiff::Timestamp;
use records::time::days_between;
use records::uncertainty::SD_OVER_MAD;
use serde::Serialize;

use crate::monitoring::median;
use crate::monitoring::recent::{FlightDiagnostics, PositionKey, RecentDiagnostics, newest_utc};

/// A flight whose innovations are unlike those of the unit's other flights.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct InnovationOutlier {
    /// The aircraft.
    pub tail_number: String,
    /// The position.
    pub position: String,
    /// The flight.
    pub flight_id: String,
    /// Its departure.
    pub departure_utc: Timestamp,
    /// Its NIS.
    pub nis: f64,
    /// The median NIS of the flights before it.
    pub usual: f64,
}

/// Minimum and maximum number of earlier flights that a flight is compared with.
const BEFORE: (usize, usize) = (10, 50);
/// Distance from the median of ln NIS, in standard deviations, from which a flight is an outlier,
const SPREADS: f64 = 6.0;
/// and beyond this factor: a spread seen in few flights may be small by chance.
const FACTOR: f64 = 2.0;

/// Outliers among the flights of the last month.
pub fn find_outliers(recent_diagnostics: &RecentDiagnostics) -> Vec<InnovationOutlier> {
    let newest = newest_utc(recent_diagnostics);
    let recent = |at: Timestamp| newest.is_some_and(|newest| days_between(at, newest) <= REPORTED_DAYS);
    let mut found = Vec::new();
    for (position, diagnostics) in recent_diagnostics {
        let surprised = diagnostics
            .iter()
            .filter_map(|diagnostics| Some((diagnostics, diagnostics.nis.filter(|nis| *nis > 0.0)?)));
        let (diagnostics, logs): (Vec<&FlightDiagnostics>, Vec<f64>) =
            surprised.map(|(diagnostics, nis)| (diagnostics, nis.ln())).unzip();
        for (k, diagnostics) in
            diagnostics.iter().enumerate().filter(|(_, diagnostics)| recent(diagnostics.departure_utc))
        {
            let before = &logs[k.saturating_sub(BEFORE.1)..k];
            found.extend(
                median_ln_nis(before, logs[k]).map(|usual| outlier(position, diagnostics, logs[k], usual)),
            );
        }
    }
    found.sort_by(|a, b| {
        (a.departure_utc, &a.tail_number, &a.position).cmp(&(b.departure_utc, &b.tail_number, &b.position))
    });
    found
}

/// Median ln NIS of the earlier flights, if this one is an outlier.
fn median_ln_nis(before: &[f64], this: f64) -> Option<f64> {
    if before.len() < BEFORE.0 {
        return None;
    }
    let usual = median(before.to_vec());
    let spread = SD_OVER_MAD * median(before.iter().map(|v| (v - usual).abs()).collect());
    ((this - usual).abs() > (SPREADS * spread).max(FACTOR.ln())).then_some(usual)
}

fn outlier(
    position: &PositionKey,
    diagnostics: &FlightDiagnostics,
    this: f64,
    usual: f64,
) -> InnovationOutlier {
    InnovationOutlier {
        tail_number: position.tail_number.clone(),
        position: position.position.clone(),
        flight_id: diagnostics.flight_id.to_string(),
        departure_utc: diagnostics.departure_utc,
        nis: this.exp(),
        usual: usual.exp(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ln NIS about a level with a spread of 0.2, the same in every run.
    fn series(count: usize, seed: u64, level: f64) -> Vec<f64> {
        let mut state = seed;
        let mut even = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..count).map(|_| level + 0.2 * ((0..12).map(|_| even()).sum::<f64>() - 6.0)).collect()
    }

    #[test]
    fn a_unit_may_have_any_level_of_its_own() {
        for level in [-1.0, 0.0, 2.0] {
            assert_eq!(median_ln_nis(&series(30, 5, level), level), None);
        }
    }

    #[test]
    fn a_flight_ten_times_as_surprising_is_unlike_the_others() {
        let before = series(30, 5, 0.4);
        let usual = median_ln_nis(&before, 0.4 + 10.0_f64.ln()).unwrap();
        assert!((usual - 0.4).abs() < 0.15, "{usual}");
    }

    /// Twenty thousand flights that are like the others: at most one in two hundred is called unlike.
    #[test]
    fn flights_alike_are_left_alone() {
        let alarms: usize = (0..1000)
            .map(|seed| {
                let logs = series(40, seed * 7919 + 1, 0.3);
                (20..40).filter(|&k| median_ln_nis(&logs[..k], logs[k]).is_some()).count()
            })
            .sum();
        assert!(alarms <= 100, "{alarms} of 20,000");
    }

    #[test]
    fn too_few_flights_are_no_bound() {
        assert_eq!(median_ln_nis(&[0.0; 9], 5.0), None);
    }
}
