//! Histories of units: store rows or external tables, grouped by unit and sorted by departure.

pub mod builder;
pub mod external_estimates;
pub(crate) mod extras;
pub mod flight_row;
pub mod histories;
pub(crate) mod merge;
pub(crate) mod parallel_scan;
pub mod row_keys;
mod settings_counts;
