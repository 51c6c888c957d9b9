//! Distribution of wear rates by part number, and its outliers.

use std::collections::BTreeMap;

use crate::model::{Report, UnitView};

/// Wear rates of one part number's units, m/h.
#[derive(Debug)]
pub(crate) struct RateSpread<'a> {
    pub part: &'a str,
    pub units: usize,
    pub low: f64,
    pub median: f64,
    pub high: f64,
    /// Units above the upper quartile by more than 1.5 interquartile ranges (Tukey's fence), fastest first.
    pub outliers: Vec<&'a UnitView>,
}

/// Wear-rate distributions of all part numbers, computed once for all pages.
#[derive(Debug)]
pub struct RateSpreads<'a>(Vec<RateSpread<'a>>);

impl<'a> RateSpreads<'a> {
    /// Computes the distributions of all units of a report.
    pub fn of(report: &'a Report) -> Self {
        Self(spreads(report))
    }

    /// Distribution of one part number, if any of its units has a rate.
    pub(crate) fn part(&self, number: &str) -> Option<&RateSpread<'a>> {
        self.0.iter().find(|spread| spread.part == number)
    }
}

/// Distributions by part number.
pub(crate) fn spreads(report: &Report) -> Vec<RateSpread<'_>> {
    let mut parts: BTreeMap<&str, Vec<(f64, &UnitView)>> = BTreeMap::new();
    for unit in &report.units {
        if let Some(rate) = unit.assessment.rate_m_per_hour {
            parts.entry(unit.part_number.as_deref().unwrap_or("–")).or_default().push((rate, unit));
        }
    }
    parts.into_iter().map(|(part, units)| spread(part, units)).collect()
}

fn spread<'a>(part: &'a str, mut units: Vec<(f64, &'a UnitView)>) -> RateSpread<'a> {
    units.sort_by(|a, b| a.0.total_cmp(&b.0));
    let rates: Vec<f64> = units.iter().map(|(rate, _)| *rate).collect();
    let (lower, upper) = (quantile(&rates, 0.25), quantile(&rates, 0.75));
    let fence = upper + 1.5 * (upper - lower);
    RateSpread {
        part,
        units: rates.len(),
        low: quantile(&rates, 0.05),
        median: quantile(&rates, 0.5),
        high: quantile(&rates, 0.95),
        outliers: units.iter().rev().take_while(|(rate, _)| *rate > fence).map(|(_, u)| *u).collect(),
    }
}

/// Quantile of ascending values with linear interpolation (Hyndman and Fan 1996, type 7).
pub(crate) fn quantile(sorted: &[f64], share: f64) -> f64 {
    let place = share * (sorted.len().max(1) - 1) as f64;
    let below = place.floor() as usize;
    let above = (below + 1).min(sorted.len().saturating_sub(1));
    sorted.get(below).zip(sorted.get(above)).map_or(f64::NAN, |(a, b)| a + (place - below as f64) * (b - a))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_by_hand() {
        assert!((quantile(&[1.0, 2.0, 3.0, 4.0], 0.5) - 2.5).abs() < 1e-12);
        assert!((quantile(&[1.0, 2.0, 3.0, 4.0], 1.0) - 4.0).abs() < 1e-12);
        assert!(quantile(&[], 0.5).is_nan());
    }
}
