//! The fleet as it is stored, with the bookkeeping joined: flights of each unit by departure, also from external tables.

pub mod bookkeeping;
pub mod builder;
pub mod external_estimates;
pub(crate) mod extras;
pub mod flight_row;
pub mod histories;
pub(crate) mod merge;
pub(crate) mod parallel_scan;
pub mod row_keys;
mod settings_counts;
