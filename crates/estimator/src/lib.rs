//! Backlash gap estimation: the published method (model, discretisation, Kalman filter, gap statistic) and the
//! contact regression that gives the reported gap.
//!
//! The input is an actuator model and slices of `f64`: no paths, no clock, no threads. The same input gives bitwise
//! identical results. Equation numbers are those of *The Backlash Gap size Estimation for Electromechanical Actuator
//! in an Operational Behavior*; items note where the printed equation differs from its meaning.
//!
//! Without the feature `std` and with `libm`, the crate needs neither a standard library nor an allocator. It then
//! contains model, discretisation, noise, filter, [`Stream`] and [`gap::mid_range`], for an on-board controller.

#![cfg_attr(not(feature = "std"), no_std)]

#[cfg(not(any(feature = "std", feature = "libm")))]
compile_error!("without `std` the estimator needs the feature `libm` for its square roots and exponentials");

#[cfg(feature = "std")]
pub mod contact;
mod error;
pub mod gap;
mod kalman;
pub mod model;
mod samples;

#[cfg(feature = "std")]
pub use contact::ContactEstimate;
pub use error::Error;
pub use gap::GapStatistic;
#[cfg(feature = "std")]
pub use gap::midrange::{self, MidRangeEstimate};
pub use kalman::{Filter, FilterStep, InitialVariances, KalmanState, Stream, StreamStep};
#[cfg(feature = "std")]
pub use kalman::{GainSchedule, Nis};
pub use model::{ActuatorModel, DiscreteModel, NoiseCovariances, NoiseModel, SensorNoise};
pub use samples::Samples;
