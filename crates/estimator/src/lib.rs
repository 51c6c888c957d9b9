//! The published method, whole: model, discretisation, filter and gap statistic; and beside it the gap we
//! stand behind, by contact regression.
//!
//! The crate sees an actuator and slices of `f64`. No paths, no clock, no threads; the same input
//! gives the same bits. Equation numbers are those of *The Backlash Gap size Estimation for
//! Electromechanical Actuator in an Operational Behavior*; where print and meaning differ the item says so.
//!
//! Without the feature `std`, and with `libm`, what remains needs neither a standard library nor an
//! allocator: model, discretisation, noise, filter, [`Stream`] and [`RunningGap`], for a controller on
//! board.

#![cfg_attr(not(feature = "std"), no_std)]

#[cfg(not(any(feature = "std", feature = "libm")))]
compile_error!("without `std` the estimator needs the feature `libm` for its square roots and exponentials");

#[cfg(feature = "std")]
pub mod contact;
pub mod discretise;
#[cfg(feature = "std")]
mod eight;
mod error;
mod exponential;
pub mod filter;
mod folded;
pub mod gap;
#[cfg(feature = "std")]
mod lanes;
#[cfg(feature = "std")]
pub mod load;
#[cfg(feature = "std")]
pub mod midrange;
pub mod model;
pub mod noise;
pub mod running;
#[cfg(feature = "std")]
mod schedule;
mod series;
pub mod stream;
#[cfg(feature = "std")]
mod track;
mod wide;

#[cfg(feature = "std")]
pub use contact::ContactEstimate;
pub use discretise::Discrete;
pub use error::Error;
pub use filter::{Estimate, Filter, Step};
pub use gap::Gap;
#[cfg(feature = "std")]
pub use midrange::MidRange;
pub use model::Actuator;
pub use noise::Noise;
pub use running::{Reading, RunningGap};
#[cfg(feature = "std")]
pub use schedule::Schedule;
pub use stream::Stream;
#[cfg(feature = "std")]
pub use track::{Innovations, Room, Track};

use core::ops::Range;

/// One actuator's channels in one flight: all that an estimate may know.
#[derive(Debug, Clone, Copy)]
pub struct Samples<'a> {
    /// Step between samples, s.
    pub step_s: f64,
    /// Motor position X₁ at the screw axis, m; NaN where missing.
    pub motor_m: &'a [f64],
    /// Relative position δX = X₂ − X₁, m; NaN where missing.
    pub dx_m: &'a [f64],
    /// Load, N.
    pub load_n: &'a [f64],
    /// Unbroken stretches; the filter starts again at each.
    pub segments: &'a [Range<usize>],
}

impl Samples<'_> {
    /// Refuses channels that do not fit each other.
    ///
    /// # Errors
    /// [`Error::Lengths`] for channels of different length or a segment outside them.
    pub fn check(&self) -> Result<(), Error> {
        let (dx, load) = (self.dx_m.len(), self.load_n.len());
        let end = self.segments.iter().map(|s| s.end).max().unwrap_or(0);
        if dx != load || self.motor_m.len() != dx || end > dx {
            return Err(Error::Lengths { dx, load, end });
        }
        model::positive("step_s", self.step_s)
    }
}
