//! What the load did: its band, and how often it changed sides.

use std::ops::Range;

/// A load counts as being on a side beyond this share of its greater quantile, so noise about zero is no reversal.
const SIDE_SHARE: f64 = 0.12;

/// The load of a flight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LoadBand {
    /// 5 % quantile, N.
    pub p05_n: f64,
    /// 95 % quantile, N.
    pub p95_n: f64,
    /// Changes from one side to the other.
    pub reversals: usize,
}

/// Describes the load over the segments; nothing when they are empty.
///
/// A reversal is a change from beyond +12 % of the greater of the two quantiles to beyond −12 %, or back.
pub fn band(load_n: &[f64], segments: &[Range<usize>]) -> Option<LoadBand> {
    let mut present: Vec<f64> =
        segments.iter().flat_map(|s| &load_n[s.clone()]).copied().filter(|f| !f.is_nan()).collect();
    if present.is_empty() {
        return None;
    }
    let (p05_n, p95_n) = (quantile(&mut present, 0.05), quantile(&mut present, 0.95));
    let threshold = SIDE_SHARE * p05_n.abs().max(p95_n.abs());
    let mut reversals = 0;
    for segment in segments {
        let mut side = 0.0;
        for &f in load_n[segment.clone()].iter().filter(|f| f.abs() > threshold) {
            reversals += usize::from(side * f < 0.0);
            side = f.signum();
        }
    }
    Some(LoadBand { p05_n, p95_n, reversals })
}

/// The element at a share of the order, no interpolation.
fn quantile(values: &mut [f64], share: f64) -> f64 {
    let at = ((values.len() - 1) as f64 * share).round() as usize;
    *values.select_nth_unstable_by(at, f64::total_cmp).1
}
