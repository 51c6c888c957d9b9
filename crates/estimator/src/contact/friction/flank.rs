//! The two flanks of the gap.

/// Forces over the 95 % load below which flanks may be soft.
pub(crate) const FIRM_SHARE: f64 = 0.12;

/// One of the two sides of the gap.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Flank {
    /// Pressed by a positive force.
    Upper = 1,
    /// Pressed by a negative one.
    Lower = -1,
}

impl Flank {
    /// s, +1 for the upper and −1 for the lower.
    pub fn sign(self) -> f64 {
        f64::from(self as i8)
    }
}
