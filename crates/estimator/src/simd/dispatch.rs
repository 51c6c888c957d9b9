//! Runtime SIMD dispatch: one body compiled several times, for the widest vectors of the machine.
//!
//! Vectors change no result: each lane runs the same operations in the same order as scalar code, and a product is
//! fused with a sum exactly where the body has `mul_add`, on every machine. So results are bitwise identical on every
//! machine, and records do not hold the instruction set. Machines without such extensions, and those whose
//! vectors need none (NEON), run the plain body.

/// Defines a function whose body runs with AVX-512 or AVX2, and fused products, where the processor has them.
///
/// A body must hold no closure: one would be compiled without the wider vectors.
macro_rules! simd_dispatch {
    ($(#[$note:meta])* $seen:vis fn $name:ident$(<const $n:ident: usize>)?($($arg:ident: $is:ty),* $(,)?)
        $(-> $out:ty)? $body:block) => {
        $(#[$note])*
        #[allow(clippy::inline_always, reason = "the body must be compiled within each of its shells")]
        $seen fn $name$(<const $n: usize>)?($($arg: $is),*) $(-> $out)? {
            #[inline(always)]
            fn plain$(<const $n: usize>)?($($arg: $is),*) $(-> $out)? $body
            #[cfg(all(feature = "std", target_arch = "x86_64"))]
            {
                #[target_feature(enable = "avx512f,avx512vl,avx512dq,fma")]
                fn with_avx512$(<const $n: usize>)?($($arg: $is),*) $(-> $out)? {
                    plain($($arg),*)
                }
                #[target_feature(enable = "avx2,fma")]
                fn with_avx2$(<const $n: usize>)?($($arg: $is),*) $(-> $out)? {
                    plain($($arg),*)
                }
                if is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512vl")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("fma")
                {
                    // SAFETY: the processor has what the function was compiled for.
                    #[allow(unsafe_code, reason = "the one door to wider vectors")]
                    return unsafe { with_avx512($($arg),*) };
                }
                if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
                    // SAFETY: as above.
                    #[allow(unsafe_code, reason = "the one door to wider vectors")]
                    return unsafe { with_avx2($($arg),*) };
                }
            }
            plain($($arg),*)
        }
    };
}

pub(crate) use simd_dispatch;

/// Up to `N` numbers, filled up with NaN, which no sum, count or extreme takes in.
#[inline(always)]
#[allow(clippy::inline_always, reason = "see `simd_dispatch`")]
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
#[allow(clippy::inline_always, reason = "see `simd_dispatch`")]
impl Lanes {
    pub(crate) const COUNT: usize = 8;
    pub(crate) const ZERO: Self = Self([0.0; Self::COUNT]);

    #[inline(always)]
    pub(crate) fn all(value: f64) -> Self {
        Self([value; Self::COUNT])
    }

    /// `COUNT` numbers from some place on, filled up with zeros behind the last. One by one: a copy of a part would be
    /// put into memory, and could not be taken from there as a whole before all of it had arrived.
    #[inline(always)]
    pub(crate) fn of<const N: usize>(values: &[f64; N], from: usize) -> Self {
        let mut lanes = Self::ZERO;
        for lane in 0..Self::COUNT {
            if from + lane < N {
                lanes.0[lane] = values[from + lane];
            }
        }
        lanes
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
