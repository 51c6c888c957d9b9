//! Bookkeeping of the operator: which unit was where, how many hours it had, what was done to it. It is joined to records
//! when they are read.

pub mod dates_ahead;
mod hour_meter;
pub(crate) mod inspections;
pub mod join;
pub mod maintenance_log;
pub(crate) mod unlogged_flights;
pub(crate) mod usage;
