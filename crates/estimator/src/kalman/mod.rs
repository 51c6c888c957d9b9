//! Kalman filter: one step, sample by sample, and over whole flights.

#[cfg(feature = "std")]
pub(crate) mod batch;
pub(crate) mod filter;
#[cfg(feature = "std")]
pub(crate) mod nis;
pub(crate) mod stream;

#[cfg(feature = "std")]
pub use batch::GainSchedule;
pub use filter::{Filter, FilterStep, InitialVariances, KalmanState};
#[cfg(feature = "std")]
pub use nis::Nis;
pub use stream::{Stream, StreamStep};
