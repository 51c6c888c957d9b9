//! Diagnostics in addition to the gap: filter innovations and recorder changes.

pub mod innovations;
pub mod mapping_faults;
pub mod recent;
pub mod recorder_change;

/// Number of days for which a finding is reported.
const REPORTED_DAYS: f64 = 30.0;
