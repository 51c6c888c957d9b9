//! Numbers of one series, or of several side by side: the same sums and fused products, one by one.
//!
//! A product that is fused with a sum is rounded once, by every processor alike: by one instruction, or where it has
//! none, by many.

use nalgebra::ComplexField;

/// A number of each series.
pub(crate) trait FmaScalar: Copy {
    /// The same number for each.
    fn splat(value: f64) -> Self;
    fn sub(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    /// `self · factor + summand`, rounded once.
    fn mul_add(self, factor: Self, summand: Self) -> Self;
}

#[allow(clippy::inline_always, reason = "all must be compiled within one function")]
impl FmaScalar for f64 {
    #[inline(always)]
    fn splat(value: f64) -> Self {
        value
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self - other
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self * other
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, summand: Self) -> Self {
        // With the standard library and without.
        ComplexField::mul_add(self, factor, summand)
    }
}
