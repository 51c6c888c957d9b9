//! Gap statistic of the published method, and the load band.

#[cfg(feature = "std")]
pub(crate) mod load_band;
#[cfg(feature = "std")]
pub mod midrange;
pub(crate) mod statistic;

#[cfg(feature = "std")]
pub use load_band::{LoadBand, load_band};
pub use statistic::{GapStatistic, mid_range};
