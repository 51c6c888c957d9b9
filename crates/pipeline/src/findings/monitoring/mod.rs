//! Diagnostics in addition to the gap: coverage, mapping faults, repeated samples and recorder changes.

pub mod coverage;
pub mod mapping_faults;
pub(crate) mod recent;
pub mod recorder_change;
pub mod repeated_samples;

/// Number of days for which a finding is reported.
pub(crate) const REPORTED_DAYS: f64 = 30.0;

/// The median, of an even number the mean of the middle two; NaN of nothing.
pub(crate) fn median(values: Vec<f64>) -> f64 {
    trend::quantity::median(values).unwrap_or(f64::NAN)
}
