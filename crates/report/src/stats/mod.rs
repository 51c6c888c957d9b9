//! Statistics shown in the report, computed from the units' assessments.

pub(crate) mod peers;
pub(crate) mod removal_forecast;
