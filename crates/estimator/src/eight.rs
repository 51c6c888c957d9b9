//! Eight numbers side by side, as the vectors of each kind of machine: the same sums and products, one by one.
//!
//! Products are never fused with sums, so all kinds give the same bits.

/// Eight numbers.
pub(crate) trait Eight: Copy {
    /// The same number eight times.
    fn all(value: f64) -> Self;
    /// From an array.
    fn of(values: &[f64; 8]) -> Self;
    /// Back to an array.
    fn put(self, values: &mut [f64; 8]);
    fn plus(self, other: Self) -> Self;
    fn less(self, other: Self) -> Self;
    fn times(self, other: Self) -> Self;
    /// Lines to columns.
    fn turned(lines: [Self; 8]) -> [Self; 8];
}

/// For any machine.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Plain([f64; 8]);

#[allow(clippy::inline_always, reason = "all must be compiled within one function")]
impl Eight for Plain {
    #[inline(always)]
    fn all(value: f64) -> Self {
        Self([value; 8])
    }

    #[inline(always)]
    fn of(values: &[f64; 8]) -> Self {
        Self(*values)
    }

    #[inline(always)]
    fn put(self, values: &mut [f64; 8]) {
        *values = self.0;
    }

    #[inline(always)]
    fn plus(mut self, other: Self) -> Self {
        for (a, b) in self.0.iter_mut().zip(other.0) {
            *a += b;
        }
        self
    }

    #[inline(always)]
    fn less(mut self, other: Self) -> Self {
        for (a, b) in self.0.iter_mut().zip(other.0) {
            *a -= b;
        }
        self
    }

    #[inline(always)]
    fn times(mut self, other: Self) -> Self {
        for (a, b) in self.0.iter_mut().zip(other.0) {
            *a *= b;
        }
        self
    }

    #[inline(always)]
    fn turned(lines: [Self; 8]) -> [Self; 8] {
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
        __m256d, __m512d, _mm256_add_pd, _mm256_loadu_pd, _mm256_mul_pd, _mm256_permute2f128_pd,
        _mm256_set1_pd, _mm256_storeu_pd, _mm256_sub_pd, _mm256_unpackhi_pd, _mm256_unpacklo_pd,
        _mm512_add_pd, _mm512_loadu_pd, _mm512_mul_pd, _mm512_set1_pd, _mm512_shuffle_f64x2,
        _mm512_storeu_pd, _mm512_sub_pd, _mm512_unpackhi_pd, _mm512_unpacklo_pd,
    };

    use super::Eight;

    /// Two vectors of AVX; made only where the processor has it.
    #[derive(Debug, Clone, Copy)]
    pub(crate) struct Avx(__m256d, __m256d);

    /// One vector of AVX-512F; made only where the processor has it.
    #[derive(Debug, Clone, Copy)]
    pub(crate) struct Avx512(__m512d);

    // SAFETY, for all that follows: such a vector exists only where the processor has its kind, and arrays are as
    // long as what is loaded from them or stored to them.
    impl Eight for Avx {
        #[inline(always)]
        fn all(value: f64) -> Self {
            unsafe { Self(_mm256_set1_pd(value), _mm256_set1_pd(value)) }
        }

        #[inline(always)]
        fn of(values: &[f64; 8]) -> Self {
            unsafe { Self(_mm256_loadu_pd(values.as_ptr()), _mm256_loadu_pd(values.as_ptr().add(4))) }
        }

        #[inline(always)]
        fn put(self, values: &mut [f64; 8]) {
            unsafe {
                _mm256_storeu_pd(values.as_mut_ptr(), self.0);
                _mm256_storeu_pd(values.as_mut_ptr().add(4), self.1);
            }
        }

        #[inline(always)]
        fn plus(self, other: Self) -> Self {
            unsafe { Self(_mm256_add_pd(self.0, other.0), _mm256_add_pd(self.1, other.1)) }
        }

        #[inline(always)]
        fn less(self, other: Self) -> Self {
            unsafe { Self(_mm256_sub_pd(self.0, other.0), _mm256_sub_pd(self.1, other.1)) }
        }

        #[inline(always)]
        fn times(self, other: Self) -> Self {
            unsafe { Self(_mm256_mul_pd(self.0, other.0), _mm256_mul_pd(self.1, other.1)) }
        }

        /// Four squares of four by four, each to its mirrored place.
        #[inline(always)]
        fn turned([a, b, c, d, e, f, g, h]: [Self; 8]) -> [Self; 8] {
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

    impl Eight for Avx512 {
        #[inline(always)]
        fn all(value: f64) -> Self {
            unsafe { Self(_mm512_set1_pd(value)) }
        }

        #[inline(always)]
        fn of(values: &[f64; 8]) -> Self {
            unsafe { Self(_mm512_loadu_pd(values.as_ptr())) }
        }

        #[inline(always)]
        fn put(self, values: &mut [f64; 8]) {
            unsafe { _mm512_storeu_pd(values.as_mut_ptr(), self.0) }
        }

        #[inline(always)]
        fn plus(self, other: Self) -> Self {
            unsafe { Self(_mm512_add_pd(self.0, other.0)) }
        }

        #[inline(always)]
        fn less(self, other: Self) -> Self {
            unsafe { Self(_mm512_sub_pd(self.0, other.0)) }
        }

        #[inline(always)]
        fn times(self, other: Self) -> Self {
            unsafe { Self(_mm512_mul_pd(self.0, other.0)) }
        }

        /// Pairs, then pairs of pairs, then halves.
        #[inline(always)]
        fn turned([a, b, c, d, e, f, g, h]: [Self; 8]) -> [Self; 8] {
            let [p, r, t, v] = even([a, b, c, d, e, f, g, h]);
            let [q, s, u, w] = odd([a, b, c, d, e, f, g, h]);
            [p, q, r, s, t, u, v, w]
        }
    }

    /// The columns of even number.
    #[inline(always)]
    fn even([a, b, c, d, e, f, g, h]: [Avx512; 8]) -> [Avx512; 4] {
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
    fn odd([a, b, c, d, e, f, g, h]: [Avx512; 8]) -> [Avx512; 4] {
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
    fn quarters(ab: __m512d, cd: __m512d, ef: __m512d, gh: __m512d) -> [Avx512; 4] {
        // SAFETY: as above.
        unsafe {
            let (near_even, far_even) =
                (_mm512_shuffle_f64x2::<0x88>(ab, cd), _mm512_shuffle_f64x2::<0x88>(ef, gh));
            let (near_odd, far_odd) =
                (_mm512_shuffle_f64x2::<0xdd>(ab, cd), _mm512_shuffle_f64x2::<0xdd>(ef, gh));
            [
                Avx512(_mm512_shuffle_f64x2::<0x88>(near_even, far_even)),
                Avx512(_mm512_shuffle_f64x2::<0x88>(near_odd, far_odd)),
                Avx512(_mm512_shuffle_f64x2::<0xdd>(near_even, far_even)),
                Avx512(_mm512_shuffle_f64x2::<0xdd>(near_odd, far_odd)),
            ]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 0 to 63 in lines of eight: entry j of column i is 8 j + i.
    fn check<E: Eight>() {
        let lines: [E; 8] =
            std::array::from_fn(|i| E::of(&std::array::from_fn(|j| f64::from(8 * i as u32 + j as u32))));
        for (i, column) in E::turned(lines).into_iter().enumerate() {
            let mut found = [0.0; 8];
            column.put(&mut found);
            let wanted: Vec<usize> = (0..8).map(|j| 8 * j + i).collect();
            assert_eq!(found.map(|v| v as usize).to_vec(), wanted);
        }
    }

    #[test]
    fn lines_become_columns_with_every_kind_of_vector() {
        check::<Plain>();
        #[cfg(target_arch = "x86_64")]
        {
            if is_x86_feature_detected!("avx2") {
                check::<x86::Avx>();
            }
            if is_x86_feature_detected!("avx512f") {
                check::<x86::Avx512>();
            }
        }
    }
}
