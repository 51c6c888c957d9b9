//! Kalman filter: sample by sample, streaming, and over whole flights.

#[cfg(feature = "std")]
pub(crate) mod batch;
pub(crate) mod filter;
#[cfg(feature = "std")]
pub(crate) mod gain_schedule;
#[cfg(feature = "std")]
pub(crate) mod nis;
#[cfg(feature = "std")]
mod parallel;
pub(crate) mod steady_state;
pub(crate) mod stream;

#[cfg(feature = "std")]
pub use batch::{FilterOutput, FilterWorkspace, InnovationBuffers};
pub use filter::{Filter, FilterStep, InitialVariances, KalmanState};
#[cfg(feature = "std")]
pub use gain_schedule::GainSchedule;
#[cfg(feature = "std")]
pub use nis::Nis;
pub use stream::Stream;
