//! SIMD: runtime dispatch, vectors of eight `f64`, and fused multiply-add for scalars and vectors.

pub(crate) mod dispatch;
#[cfg(feature = "std")]
pub(crate) mod f64x8;
pub(crate) mod fma;
