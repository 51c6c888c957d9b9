//! Arithmetic on one series, or on several in parallel: the same sums and fused products, element by element.
//!
//! A fused product and sum is rounded once on every processor: by one instruction, or in software where it has
//! none.

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
