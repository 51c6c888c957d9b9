//! The spread of rates within each part number, and the units that stand out of it.

use std::collections::BTreeMap;

use crate::model::{Report, Unit};

/// The rates of one part number's units, m/h.
#[derive(Debug)]
pub(crate) struct Spread<'a> {
    pub part: &'a str,
    pub units: usize,
    pub low: f64,
    pub median: f64,
    pub high: f64,
    /// Above the upper quartile by more than one and a half of the quartiles' distance, fastest first.
    pub outlying: Vec<&'a Unit>,
}

/// The rates of every part number's units, compared once for all pages.
#[derive(Debug)]
pub struct Spreads<'a>(Vec<Spread<'a>>);

impl<'a> Spreads<'a> {
    /// Of all units of a report.
    pub fn of(report: &'a Report) -> Self {
        Self(spreads(report))
    }

    /// Of one part number, where any of its units has a rate.
    pub(crate) fn part(&self, number: &str) -> Option<&Spread<'a>> {
        self.0.iter().find(|spread| spread.part == number)
    }
}

/// By part number.
pub(crate) fn spreads(report: &Report) -> Vec<Spread<'_>> {
    let mut parts: BTreeMap<&str, Vec<(f64, &Unit)>> = BTreeMap::new();
    for unit in &report.units {
        if let Some(rate) = unit.statement.rate_m_per_hour {
            parts.entry(unit.part_number.as_deref().unwrap_or("–")).or_default().push((rate, unit));
        }
    }
    parts.into_iter().map(|(part, units)| spread(part, units)).collect()
}

fn spread<'a>(part: &'a str, mut units: Vec<(f64, &'a Unit)>) -> Spread<'a> {
    units.sort_by(|a, b| a.0.total_cmp(&b.0));
    let rates: Vec<f64> = units.iter().map(|(rate, _)| *rate).collect();
    let (lower, upper) = (quantile(&rates, 0.25), quantile(&rates, 0.75));
    let fence = upper + 1.5 * (upper - lower);
    Spread {
        part,
        units: rates.len(),
        low: quantile(&rates, 0.05),
        median: quantile(&rates, 0.5),
        high: quantile(&rates, 0.95),
        outlying: units.iter().rev().take_while(|(rate, _)| *rate > fence).map(|(_, u)| *u).collect(),
    }
}

/// Where the ascending values have that share below them, between neighbours in a straight line.
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
