//! Samples: one actuator's channels in one flight, in SI units.

use core::ops::Range;

use crate::error::Error;
use crate::model::positive;

/// One actuator's channels in one flight: the complete input of an estimate.
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
    /// Contiguous blocks of samples; the filter restarts at each.
    pub segments: &'a [Range<usize>],
}

impl Samples<'_> {
    /// Checks that the channels have equal lengths.
    ///
    /// # Errors
    /// [`Error::Lengths`] for channels of different length or a segment outside them.
    pub fn check(&self) -> Result<(), Error> {
        let (dx, load) = (self.dx_m.len(), self.load_n.len());
        let end = self.segments.iter().map(|s| s.end).max().unwrap_or(0);
        if dx != load || self.motor_m.len() != dx || end > dx {
            return Err(Error::Lengths { dx, load, end });
        }
        positive("step_s", self.step_s)
    }
}
