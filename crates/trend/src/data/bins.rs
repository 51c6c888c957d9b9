//! A segment of a unit's history, and its estimates in a few bins of equal count: the data of the candidate bank.

use crate::data::outliers::WeightedGap;

/// Segment of a unit's history between resets.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Segment<'a> {
    pub(crate) estimates: &'a [WeightedGap],
    /// Usage at its beginning and at the date of the assessment.
    pub(crate) begin: f64,
    pub(crate) now: f64,
    /// Age when it began, where that is known: zero of a unit that was just reset.
    pub(crate) known_age: Option<f64>,
}

pub(crate) const BINS: usize = 48;

/// The weighted mean of neighbouring estimates.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bin {
    pub(crate) usage: f64,
    /// Mean departure, microseconds since 1970 UTC.
    pub(crate) departure_us: f64,
    /// The installation of its last estimate.
    pub(crate) installation: u32,
    pub(crate) gap_m: f64,
    pub(crate) variance_m2: f64,
}

/// At most `count` bins of as equal a count as can be.
pub(crate) fn bin(estimates: &[WeightedGap], count: usize) -> Vec<Bin> {
    let count = count.min(estimates.len());
    (0..count)
        .map(|b| mean(&estimates[b * estimates.len() / count..(b + 1) * estimates.len() / count]))
        .collect()
}

fn mean(estimates: &[WeightedGap]) -> Bin {
    let weight: f64 = estimates.iter().map(|e| e.weight).sum();
    let sum = |f: fn(&WeightedGap) -> f64| estimates.iter().map(|e| e.weight * f(e)).sum::<f64>() / weight;
    let departures_us = estimates.iter().map(|e| e.departure_us as f64);
    Bin {
        usage: sum(|e| e.usage),
        departure_us: departures_us.sum::<f64>() / estimates.len() as f64,
        installation: estimates[estimates.len() - 1].installation,
        gap_m: sum(|e| e.gap_m),
        variance_m2: weight.recip(),
    }
}
