//! Eight series side by side, as the vectors of each kind of machine.

use crate::simd::fma::FmaScalar;

/// Eight numbers.
pub(crate) trait F64x8: FmaScalar {
    /// From an array.
    fn load(values: &[f64; 8]) -> Self;
    /// Back to an array.
    fn store(self, values: &mut [f64; 8]);
    /// Lines to columns.
    fn transpose(lines: [Self; 8]) -> [Self; 8];
    /// Lines in memory to columns.
    #[inline(always)]
    #[allow(clippy::inline_always, reason = "all must be compiled within one function")]
    fn gather_transpose(lines: [&[f64; 8]; 8]) -> [Self; 8] {
        Self::transpose(lines.map(Self::load))
    }
}

/// Eight rows of a column, from `first` on with distance `apart`: one bounds check for all.
#[inline(always)]
#[allow(clippy::inline_always, reason = "all must be compiled within one function")]
#[allow(unsafe_code, reason = "eight looks for each line take as long as the lines")]
pub(crate) fn load_rows(column: &[f64], first: usize, apart: usize) -> [&[f64; 8]; 8] {
    assert!(first + 7 * apart + 8 <= column.len(), "lines lie within their column");
    // SAFETY: the last of them does, and so do those before it.
    std::array::from_fn(|i| unsafe { &*column.as_ptr().add(first + i * apart).cast() })
}

/// As [`lines`], to be written by `put`, one after the other.
#[inline(always)]
#[allow(clippy::inline_always, reason = "all must be compiled within one function")]
#[allow(unsafe_code, reason = "see `lines`")]
pub(crate) fn store_rows<E: F64x8>(lines: [E; 8], column: &mut [f64], first: usize, apart: usize) {
    assert!(first + 7 * apart + 8 <= column.len(), "lines lie within their column");
    for (i, line) in lines.into_iter().enumerate() {
        // SAFETY: as above; each is given back before the next is taken.
        line.store(unsafe { &mut *column.as_mut_ptr().add(first + i * apart).cast() });
    }
}

/// For any machine.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PortableF64x8([f64; 8]);

#[allow(clippy::inline_always, reason = "all must be compiled within one function")]
impl FmaScalar for PortableF64x8 {
    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self([value; 8])
    }

    #[inline(always)]
    fn sub(mut self, other: Self) -> Self {
        for (a, b) in self.0.iter_mut().zip(other.0) {
            *a -= b;
        }
        self
    }

    #[inline(always)]
    fn mul(mut self, other: Self) -> Self {
        for (a, b) in self.0.iter_mut().zip(other.0) {
            *a *= b;
        }
        self
    }

    #[inline(always)]
    fn mul_add(mut self, factor: Self, summand: Self) -> Self {
        for ((a, b), c) in self.0.iter_mut().zip(factor.0).zip(summand.0) {
            *a = a.mul_add(b, c);
        }
        self
    }
}

#[allow(clippy::inline_always, reason = "all must be compiled within one function")]
impl F64x8 for PortableF64x8 {
    #[inline(always)]
    fn load(values: &[f64; 8]) -> Self {
        Self(*values)
    }

    #[inline(always)]
    fn store(self, values: &mut [f64; 8]) {
        *values = self.0;
    }

    #[inline(always)]
    fn transpose(lines: [Self; 8]) -> [Self; 8] {
        let mut columns = lines;
        for (i, line) in lines.iter().enumerate() {
            for (column, value) in columns.iter_mut().zip(line.0) {
                column.0[i] = value;
            }
        }
        columns
    }
}

/// Vectors that only some processors have.
#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code, reason = "what a processor may lack is unsafe to call")]
#[allow(clippy::inline_always, reason = "all must be compiled within one function, for its vectors")]
pub(crate) mod x86 {
    use core::arch::x86_64::{
        __m256d, __m512d, _mm256_fmadd_pd, _mm256_loadu_pd, _mm256_mul_pd, _mm256_permute2f128_pd,
        _mm256_set1_pd, _mm256_storeu_pd, _mm256_sub_pd, _mm256_unpackhi_pd, _mm256_unpacklo_pd,
        _mm512_castpd256_pd512, _mm512_fmadd_pd, _mm512_insertf64x4, _mm512_loadu_pd, _mm512_mul_pd,
        _mm512_set1_pd, _mm512_shuffle_f64x2, _mm512_storeu_pd, _mm512_sub_pd, _mm512_unpackhi_pd,
        _mm512_unpacklo_pd,
    };

    use super::{F64x8, FmaScalar};

    /// Two vectors of AVX; made only where the processor has AVX2 and FMA.
    #[derive(Debug, Clone, Copy)]
    pub(crate) struct Avx2F64x8(__m256d, __m256d);

    /// One vector of AVX-512F; made only where the processor has it.
    #[derive(Debug, Clone, Copy)]
    pub(crate) struct Avx512F64x8(__m512d);

    // SAFETY, for all that follows: such a vector exists only where the processor has its kind, and arrays are as
    // long as what is loaded from them or stored to them.
    impl FmaScalar for Avx2F64x8 {
        #[inline(always)]
        fn splat(value: f64) -> Self {
            unsafe { Self(_mm256_set1_pd(value), _mm256_set1_pd(value)) }
        }

        #[inline(always)]
        fn sub(self, other: Self) -> Self {
            unsafe { Self(_mm256_sub_pd(self.0, other.0), _mm256_sub_pd(self.1, other.1)) }
        }

        #[inline(always)]
        fn mul(self, other: Self) -> Self {
            unsafe { Self(_mm256_mul_pd(self.0, other.0), _mm256_mul_pd(self.1, other.1)) }
        }

        #[inline(always)]
        fn mul_add(self, factor: Self, summand: Self) -> Self {
            unsafe {
                Self(
                    _mm256_fmadd_pd(self.0, factor.0, summand.0),
                    _mm256_fmadd_pd(self.1, factor.1, summand.1),
                )
            }
        }
    }

    impl F64x8 for Avx2F64x8 {
        #[inline(always)]
        fn load(values: &[f64; 8]) -> Self {
            unsafe { Self(_mm256_loadu_pd(values.as_ptr()), _mm256_loadu_pd(values.as_ptr().add(4))) }
        }

        #[inline(always)]
        fn store(self, values: &mut [f64; 8]) {
            unsafe {
                _mm256_storeu_pd(values.as_mut_ptr(), self.0);
                _mm256_storeu_pd(values.as_mut_ptr().add(4), self.1);
            }
        }

        /// Four squares of four by four, each to its mirrored place.
        #[inline(always)]
        fn transpose([a, b, c, d, e, f, g, h]: [Self; 8]) -> [Self; 8] {
            let [p, q, r, s] = square(a.0, b.0, c.0, d.0);
            let [t, u, v, w] = square(a.1, b.1, c.1, d.1);
            let [i, j, k, l] = square(e.0, f.0, g.0, h.0);
            let [m, n, o, x] = square(e.1, f.1, g.1, h.1);
            [Self(p, i), Self(q, j), Self(r, k), Self(s, l), Self(t, m), Self(u, n), Self(v, o), Self(w, x)]
        }
    }

    #[inline(always)]
    fn square(a: __m256d, b: __m256d, c: __m256d, d: __m256d) -> [__m256d; 4] {
        // SAFETY: as above.
        unsafe {
            let (ab, ba) = (_mm256_unpacklo_pd(a, b), _mm256_unpackhi_pd(a, b));
            let (cd, dc) = (_mm256_unpacklo_pd(c, d), _mm256_unpackhi_pd(c, d));
            [
                _mm256_permute2f128_pd::<0x20>(ab, cd),
                _mm256_permute2f128_pd::<0x20>(ba, dc),
                _mm256_permute2f128_pd::<0x31>(ab, cd),
                _mm256_permute2f128_pd::<0x31>(ba, dc),
            ]
        }
    }

    impl FmaScalar for Avx512F64x8 {
        #[inline(always)]
        fn splat(value: f64) -> Self {
            unsafe { Self(_mm512_set1_pd(value)) }
        }

        #[inline(always)]
        fn sub(self, other: Self) -> Self {
            unsafe { Self(_mm512_sub_pd(self.0, other.0)) }
        }

        #[inline(always)]
        fn mul(self, other: Self) -> Self {
            unsafe { Self(_mm512_mul_pd(self.0, other.0)) }
        }

        #[inline(always)]
        fn mul_add(self, factor: Self, summand: Self) -> Self {
            unsafe { Self(_mm512_fmadd_pd(self.0, factor.0, summand.0)) }
        }
    }

    impl F64x8 for Avx512F64x8 {
        #[inline(always)]
        fn load(values: &[f64; 8]) -> Self {
            unsafe { Self(_mm512_loadu_pd(values.as_ptr())) }
        }

        #[inline(always)]
        fn store(self, values: &mut [f64; 8]) {
            unsafe { _mm512_storeu_pd(values.as_mut_ptr(), self.0) }
        }

        /// Halves as they are loaded, then pairs, then pairs of pairs: a third fewer turns than [`F64x8::transpose`].
        #[inline(always)]
        fn gather_transpose([a, b, c, d, e, f, g, h]: [&[f64; 8]; 8]) -> [Self; 8] {
            let [p, q, r, s] = half::<0>([a, b, c, d, e, f, g, h]);
            let [t, u, v, w] = half::<4>([a, b, c, d, e, f, g, h]);
            [p, q, r, s, t, u, v, w]
        }

        /// Pairs, then pairs of pairs, then halves.
        #[inline(always)]
        fn transpose([a, b, c, d, e, f, g, h]: [Self; 8]) -> [Self; 8] {
            let [p, r, t, v] = even([a, b, c, d, e, f, g, h]);
            let [q, s, u, w] = odd([a, b, c, d, e, f, g, h]);
            [p, q, r, s, t, u, v, w]
        }
    }

    /// Four columns from some number on.
    #[inline(always)]
    fn half<const FROM: usize>([a, b, c, d, e, f, g, h]: [&[f64; 8]; 8]) -> [Avx512F64x8; 4] {
        // SAFETY: as above.
        unsafe {
            let two = |near: &[f64; 8], far: &[f64; 8]| {
                let near = _mm512_castpd256_pd512(_mm256_loadu_pd(near.as_ptr().add(FROM)));
                _mm512_insertf64x4::<1>(near, _mm256_loadu_pd(far.as_ptr().add(FROM)))
            };
            let (ac, bd, eg, fh) = (two(a, c), two(b, d), two(e, g), two(f, h));
            let (even_near, odd_near) = (_mm512_unpacklo_pd(ac, bd), _mm512_unpackhi_pd(ac, bd));
            let (even_far, odd_far) = (_mm512_unpacklo_pd(eg, fh), _mm512_unpackhi_pd(eg, fh));
            [
                Avx512F64x8(_mm512_shuffle_f64x2::<0x88>(even_near, even_far)),
                Avx512F64x8(_mm512_shuffle_f64x2::<0x88>(odd_near, odd_far)),
                Avx512F64x8(_mm512_shuffle_f64x2::<0xdd>(even_near, even_far)),
                Avx512F64x8(_mm512_shuffle_f64x2::<0xdd>(odd_near, odd_far)),
            ]
        }
    }

    /// The columns of even number.
    #[inline(always)]
    fn even([a, b, c, d, e, f, g, h]: [Avx512F64x8; 8]) -> [Avx512F64x8; 4] {
        // SAFETY: as above.
        unsafe {
            quarters(
                _mm512_unpacklo_pd(a.0, b.0),
                _mm512_unpacklo_pd(c.0, d.0),
                _mm512_unpacklo_pd(e.0, f.0),
                _mm512_unpacklo_pd(g.0, h.0),
            )
        }
    }

    /// The columns of odd number.
    #[inline(always)]
    fn odd([a, b, c, d, e, f, g, h]: [Avx512F64x8; 8]) -> [Avx512F64x8; 4] {
        // SAFETY: as above.
        unsafe {
            quarters(
                _mm512_unpackhi_pd(a.0, b.0),
                _mm512_unpackhi_pd(c.0, d.0),
                _mm512_unpackhi_pd(e.0, f.0),
                _mm512_unpackhi_pd(g.0, h.0),
            )
        }
    }

    /// Of four vectors of four pairs: the first pairs of all, the second, the third, the fourth.
    #[inline(always)]
    fn quarters(ab: __m512d, cd: __m512d, ef: __m512d, gh: __m512d) -> [Avx512F64x8; 4] {
        // SAFETY: as above.
        unsafe {
            let (near_even, far_even) =
                (_mm512_shuffle_f64x2::<0x88>(ab, cd), _mm512_shuffle_f64x2::<0x88>(ef, gh));
            let (near_odd, far_odd) =
                (_mm512_shuffle_f64x2::<0xdd>(ab, cd), _mm512_shuffle_f64x2::<0xdd>(ef, gh));
            [
                Avx512F64x8(_mm512_shuffle_f64x2::<0x88>(near_even, far_even)),
                Avx512F64x8(_mm512_shuffle_f64x2::<0x88>(near_odd, far_odd)),
                Avx512F64x8(_mm512_shuffle_f64x2::<0xdd>(near_even, far_even)),
                Avx512F64x8(_mm512_shuffle_f64x2::<0xdd>(near_odd, far_odd)),
            ]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 0 to 63 in lines of eight: entry j of column i is 8 j + i.
    fn check<E: F64x8>() {
        let lines: [E; 8] =
            std::array::from_fn(|i| E::load(&std::array::from_fn(|j| f64::from(8 * i as u32 + j as u32))));
        for (i, column) in E::transpose(lines).into_iter().enumerate() {
            let mut found = [0.0; 8];
            column.store(&mut found);
            let wanted: Vec<usize> = (0..8).map(|j| 8 * j + i).collect();
            assert_eq!(found.map(|v| v as usize).to_vec(), wanted);
        }
    }

    #[test]
    fn lines_become_columns_with_every_kind_of_vector() {
        check::<PortableF64x8>();
        #[cfg(target_arch = "x86_64")]
        {
            if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
                check::<x86::Avx2F64x8>();
            }
            if is_x86_feature_detected!("avx512f") {
                check::<x86::Avx512F64x8>();
            }
        }
    }
}
