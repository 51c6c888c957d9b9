//! A unit's flights as data: usage, outliers, steps, segments and bins.

pub(crate) mod bins;
pub(crate) mod noise;
pub(crate) mod outliers;
pub(crate) mod series;
pub(crate) mod steps;
