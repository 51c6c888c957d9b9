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
