//! What the vectorized loops share.
//!
//! `multiversion` compiles such a loop for each kind of vectors and chooses one when the program runs. Vectors change
//! no result: each lane runs the same operations in the same order as scalar code, and no product is fused with a sum.
//! So results are bitwise identical on every machine, and records do not hold the instruction set.

/// Up to `N` numbers, filled up with NaN, which no sum, count or extreme takes in.
#[inline(always)]
#[allow(clippy::inline_always, reason = "compiled within each version of its caller")]
pub(crate) fn pad_with_nan<const N: usize>(values: &[f64]) -> [f64; N] {
    let mut all = [f64::NAN; N];
    all[..values.len()].copy_from_slice(values);
    all
}

/// Eight numbers that are computed side by side.
#[cfg(feature = "std")]
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(crate) struct Lanes(pub(crate) [f64; Lanes::COUNT]);

#[cfg(feature = "std")]
#[allow(clippy::inline_always, reason = "compiled within each version of its caller")]
impl Lanes {
    pub(crate) const COUNT: usize = 8;
    pub(crate) const ZERO: Self = Self([0.0; Self::COUNT]);

    #[inline(always)]
    pub(crate) fn all(value: f64) -> Self {
        Self([value; Self::COUNT])
    }

    #[inline(always)]
    pub(crate) fn plus(mut self, other: Self) -> Self {
        for lane in 0..Self::COUNT {
            self.0[lane] += other.0[lane];
        }
        self
    }

    #[inline(always)]
    pub(crate) fn times(mut self, other: Self) -> Self {
        for lane in 0..Self::COUNT {
            self.0[lane] *= other.0[lane];
        }
        self
    }
}
