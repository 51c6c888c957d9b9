//! Error statistics of many flights, with the number of flights behind each.

use std::collections::BTreeMap;

use records::uncertainty::NORMAL_95;

use crate::methods::{METHODS, MethodResults};
use crate::scenarios::{Class, Kind};

/// Flags that no flight of a sound class should raise. `below_detection` counts on gaps of 10 µm and more,
/// `soft_contact` on hard flanks.
pub(crate) const FALSE_ALARMS: [&str; 7] = [
    "motor_spikes",
    "screw_spikes",
    "load_spikes",
    "estimators_disagree",
    "below_detection",
    "soft_contact",
    "load_jumps",
];
const VISIBLE_GAP_M: f64 = 10e-6;

/// The errors of every method over the flights of one class.
#[derive(Debug, Clone)]
pub(crate) struct ErrorStats {
    pub(crate) name: &'static str,
    pub(crate) kind: Kind,
    pub(crate) flights: usize,
    /// Errors of each method, in the unit of the class.
    pub(crate) errors: [Errors; METHODS.len()],
    /// Flights with an estimate of contact regression.
    pub(crate) estimated: usize,
    /// Flights whose 90 % interval holds the truth.
    pub(crate) held: usize,
    /// How often each code was given, as refusal or flag.
    pub(crate) codes: BTreeMap<String, usize>,
    /// How often each of [`FALSE_ALARMS`] was raised without cause; none where the class has a cause.
    pub(crate) false_alarms: Option<[usize; FALSE_ALARMS.len()]>,
    /// Every flight: true gap and contact regression's error, µm.
    pub(crate) scatter_um: Vec<(f64, f64)>,
    /// Error over standard error of every flight.
    pub(crate) deviations: Vec<f64>,
}

/// Absolute errors: median, 95 % quantile, worst, and how many there are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Errors {
    pub(crate) median: f64,
    pub(crate) p95: f64,
    pub(crate) worst: f64,
    pub(crate) count: usize,
}

impl Errors {
    fn of(mut sizes: Vec<f64>) -> Self {
        sizes.retain(|e| e.is_finite());
        sizes.sort_unstable_by(f64::total_cmp);
        let count = sizes.len();
        let at = |share: f64| {
            sizes.get(((count.max(1) - 1) as f64 * share).round() as usize).copied().unwrap_or(f64::NAN)
        };
        Self { median: at(0.5), p95: at(0.95), worst: at(1.0), count }
    }
}

impl ErrorStats {
    pub(crate) fn new(class: &Class, results: &[MethodResults]) -> Self {
        let case = class.case(0);
        let size = |a: &MethodResults, estimate_m: f64| {
            let unit_m = if class.kind == Kind::Single { 0.01 * a.truth_m } else { 1e-6 };
            (estimate_m - a.truth_m).abs() / unit_m
        };
        let errors = std::array::from_fn(|method| {
            Errors::of(results.iter().map(|a| size(a, a.by_method_m[method])).collect())
        });
        let estimates = || results.iter().filter_map(|a| a.contact.map(|c| (a.truth_m, c)));
        let mut codes = BTreeMap::new();
        for code in results.iter().flat_map(|a| &a.codes) {
            *codes.entry(code.clone()).or_insert(0) += 1;
        }
        Self {
            name: class.name,
            kind: class.kind,
            flights: results.len(),
            errors,
            estimated: estimates().count(),
            held: estimates()
                .filter(|(truth_m, (_, low_m, high_m))| (low_m..=high_m).contains(&truth_m))
                .count(),
            codes,
            false_alarms: (!case.has_spikes()).then(|| false_alarms(case.has_soft_flanks(), results)),
            scatter_um: estimates()
                .map(|(truth_m, (gap_m, ..))| (truth_m * 1e6, (gap_m - truth_m) * 1e6))
                .collect(),
            deviations: estimates()
                .map(|(truth_m, (gap_m, low_m, high_m))| {
                    (gap_m - truth_m) * 2.0 * NORMAL_95 / (high_m - low_m)
                })
                .collect(),
        }
    }

    pub(crate) fn unit(&self) -> &'static str {
        if self.kind == Kind::Single { "%" } else { "µm" }
    }

    /// Flights without an estimate of contact regression.
    pub(crate) fn refused(&self) -> usize {
        self.flights - self.estimated
    }

    /// The refusal code that flights of the class must get, because they cannot show a gap.
    pub(crate) fn must_refuse(&self) -> Option<&'static str> {
        match self.kind {
            Kind::Blind(code) => Some(code),
            _ => None,
        }
    }

    /// Share of intervals that hold, and the 90 % bounds of that share (Wilson).
    pub(crate) fn coverage(&self) -> (f64, f64, f64) {
        wilson(self.held, self.estimated)
    }
}

fn false_alarms(has_soft_flanks: bool, results: &[MethodResults]) -> [usize; FALSE_ALARMS.len()] {
    FALSE_ALARMS.map(|flag| {
        let is_false = |a: &&MethodResults| match flag {
            "below_detection" => a.truth_m >= VISIBLE_GAP_M,
            "soft_contact" => !has_soft_flanks,
            _ => true,
        };
        let raised = |a: &&MethodResults| a.contact.is_some() && a.codes.iter().any(|code| code == flag);
        results.iter().filter(raised).filter(is_false).count()
    })
}

/// A share and its 90 % bounds: Wilson's, which keep within 0 and 1.
fn wilson(hits: usize, of: usize) -> (f64, f64, f64) {
    let n = of.max(1) as f64;
    let (share, z2) = (hits as f64 / n, NORMAL_95 * NORMAL_95);
    let middle = (share + z2 / (2.0 * n)) / (1.0 + z2 / n);
    let half = NORMAL_95 / (1.0 + z2 / n) * (share * (1.0 - share) / n + z2 / (4.0 * n * n)).sqrt();
    (share, (middle - half).max(0.0), (middle + half).min(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 90 of 100: Wilson's 90 % interval by R's `binom::binom.confint(90, 100, 0.9, "wilson")`.
    #[test]
    fn a_share_has_its_wilson_bounds() {
        let (share, low, high) = wilson(90, 100);
        assert!((share - 0.9).abs() < 1e-12);
        assert!((low - 0.8395).abs() < 1e-3 && (high - 0.9394).abs() < 1e-3, "{low} {high}");
    }

    #[test]
    fn quantiles_ignore_missing_estimates() {
        let errors = Errors::of((0..=100).map(f64::from).chain([f64::NAN]).collect());
        assert_eq!((errors.median, errors.p95, errors.worst, errors.count), (50.0, 95.0, 100.0, 101));
        assert!(Errors::of(Vec::new()).median.is_nan());
    }
}
