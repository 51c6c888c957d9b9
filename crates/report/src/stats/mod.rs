//! Statistics shown in the report, computed from the units' assessments.

pub(crate) mod agreement;
pub(crate) mod crossing_probability;
pub(crate) mod rate_spread;
pub(crate) mod removal_forecast;
