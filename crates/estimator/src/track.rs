//! The filter over whole flights: S(t) of every segment.
//!
//! The covariance depends on no measurement, so while every sample is measured the gain settles. From
//! there predict and correct fold into one map with constant coefficients, three chains of products that
//! the processor runs side by side. A missing sample sets the covariance moving again, and the plain
//! recursion runs until it is back.

use nalgebra::{Matrix3, Vector3};

use crate::Samples;
use crate::error::Error;
use crate::filter::{Filter, Step, distance};

/// The folded map takes over when the covariance is this near to its limit, as a share of itself. The
/// difference leaves a share as small in S, and is forgotten.
const NEAR: f64 = 1e-13;

/// S(t) of one actuator's flight, and how well the model explained it.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    /// S at each sample, m; NaN outside the segments.
    pub s_m: Vec<f64>,
    /// Mean normalised innovation squared over the measured samples; 1 for a true model.
    pub nis: f64,
    /// Measured samples.
    pub measured: usize,
}

/// What a batch may hand out for each sample.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Innovations {
    /// e, m; NaN where nothing was measured.
    pub innovation_m: Vec<f64>,
    /// Its variance, m².
    pub variance_m2: Vec<f64>,
}

impl Filter {
    /// Runs over all segments, each from a start of its own, and hands out S(t).
    ///
    /// A missing load (NaN) is taken to be the one before it.
    ///
    /// # Errors
    /// [`Error::Lengths`] for channels that do not fit, [`Error::NothingMeasured`] when no segment
    /// holds a measurement.
    pub fn track(
        &self,
        samples: &Samples<'_>,
        mut innovations: Option<&mut Innovations>,
    ) -> Result<Track, Error> {
        samples.check()?;
        let count = samples.dx_m.len();
        if let Some(out) = innovations.as_deref_mut() {
            out.innovation_m = vec![f64::NAN; count];
            out.variance_m2 = vec![f64::NAN; count];
        }
        let mut pass = Pass {
            filter: self,
            folded: self.settled().ok().map(|(gain, p)| Folded::new(self, &gain, &p)),
            innovations,
            track: Track { s_m: vec![f64::NAN; count], nis: 0.0, measured: 0 },
        };
        for segment in samples.segments {
            let (y_m, load_n) = (&samples.dx_m[segment.clone()], &samples.load_n[segment.clone()]);
            pass.segment(y_m, load_n, segment.start)?;
        }
        let mut track = pass.track;
        if track.measured == 0 {
            return Err(Error::NothingMeasured);
        }
        track.nis /= track.measured as f64;
        Ok(track)
    }
}

/// A run over segments, and what it has handed out so far.
struct Pass<'f> {
    filter: &'f Filter,
    folded: Option<Folded>,
    innovations: Option<&'f mut Innovations>,
    track: Track,
}

impl Pass<'_> {
    fn segment(&mut self, y_m: &[f64], load_n: &[f64], offset: usize) -> Result<(), Error> {
        let Some(first) = y_m.iter().position(|y| !y.is_nan()) else { return Ok(()) };
        let load_at = |k: usize| load_n[..=k].iter().rfind(|u| !u.is_nan()).copied().unwrap_or(0.0);
        let mut state = self.filter.start(y_m[first], load_at(first));
        let mut k = 0;
        while k < y_m.len() {
            if k > 0 {
                state = self.filter.predict(&state, load_at(k - 1));
            }
            let step = self.filter.correct(&state, y_m[k])?;
            self.put(offset + k, &step.posterior.x, step.innovation_m, step.innovation_variance_m2);
            state = step.posterior;
            k += 1;
            if let Some(folded) = self.folded.filter(|folded| folded.suits(&step)) {
                let end = k + whole_until(&y_m[k..], &load_n[k - 1..]);
                state.x = self.stretch(&folded, state.x, &y_m[k..end], &load_n[k - 1..end], offset + k);
                k = end;
            }
        }
        Ok(())
    }

    fn put(&mut self, at: usize, x: &Vector3<f64>, innovation_m: f64, variance_m2: f64) {
        self.track.s_m[at] = x[2];
        if let Some(out) = self.innovations.as_deref_mut() {
            (out.innovation_m[at], out.variance_m2[at]) = (innovation_m, variance_m2);
        }
        if !innovation_m.is_nan() {
            self.track.nis += innovation_m * innovation_m / variance_m2;
            self.track.measured += 1;
        }
    }

    /// Samples without a gap, under a settled gain: x⁺ = F x + g u + k y.
    fn stretch(
        &mut self,
        map: &Folded,
        x: Vector3<f64>,
        y_m: &[f64],
        load_n: &[f64],
        at: usize,
    ) -> Vector3<f64> {
        let s_m = &mut self.track.s_m[at..at + y_m.len()];
        let (x, squares_m2) = match self.innovations.as_deref_mut() {
            None => map.run(x, y_m, load_n, s_m, |_, _| ()),
            Some(out) => {
                out.variance_m2[at..at + y_m.len()].fill(map.variance_m2);
                let innovation_m = &mut out.innovation_m[at..at + y_m.len()];
                map.run(x, y_m, load_n, s_m, |k, e_m| innovation_m[k] = e_m)
            }
        };
        self.track.nis += squares_m2 / map.variance_m2;
        self.track.measured += y_m.len();
        x
    }
}

/// How many samples from here have both a measurement and a load before it.
fn whole_until(y_m: &[f64], load_n: &[f64]) -> usize {
    y_m.iter().zip(load_n).position(|(y, u)| (y + u).is_nan()).unwrap_or(y_m.len())
}

/// Predict and correct in one, at the settled gain K: F = (I − K C) A_d, g = (I − K C) B_d, k = K.
#[derive(Debug, Clone, Copy)]
struct Folded {
    f: [[f64; 3]; 3],
    g: [f64; 3],
    k: [f64; 3],
    /// First rows of A_d and B_d, which predict y.
    a: [f64; 3],
    b: f64,
    variance_m2: f64,
    p: Matrix3<f64>,
}

impl Folded {
    fn new(filter: &Filter, gain: &Vector3<f64>, p: &Matrix3<f64>) -> Self {
        let (a_d, b_d) = (&filter.discrete().a_d, &filter.discrete().b_d);
        Self {
            f: std::array::from_fn(|i| std::array::from_fn(|j| a_d[(i, j)] - gain[i] * a_d[(0, j)])),
            g: std::array::from_fn(|i| b_d[i] - gain[i] * b_d[0]),
            k: std::array::from_fn(|i| gain[i]),
            a: std::array::from_fn(|j| a_d[(0, j)]),
            b: b_d[0],
            variance_m2: p[(0, 0)] + filter.noise().v_d_m2,
            p: *p,
        }
    }

    /// Whether a correction was made with a covariance near to the limit this map belongs to.
    fn suits(&self, step: &Step) -> bool {
        !step.innovation_m.is_nan() && distance(&self.p, &step.prior.p) <= NEAR
    }

    /// The last state, and the sum of the squared innovations.
    ///
    /// Sums are taken as trees, or each sample would wait for eight additions in a row.
    #[inline]
    fn run(
        &self,
        x: Vector3<f64>,
        y_m: &[f64],
        load_n: &[f64],
        s_m: &mut [f64],
        mut note: impl FnMut(usize, f64),
    ) -> (Vector3<f64>, f64) {
        let Self { f, g, k, a, b, .. } = self;
        let [mut x0, mut x1, mut x2] = [x[0], x[1], x[2]];
        let mut squares_m2 = 0.0;
        for (at, ((&y, &u), s)) in y_m.iter().zip(load_n).zip(s_m).enumerate() {
            let e = (y - b * u) - (a[0] * x0 + (a[1] * x1 + a[2] * x2));
            let next = |i: usize| ((g[i] * u + k[i] * y) + f[i][0] * x0) + (f[i][1] * x1 + f[i][2] * x2);
            [x0, x1, x2] = [next(0), next(1), next(2)];
            *s = x2;
            squares_m2 += e * e;
            note(at, e);
        }
        (Vector3::new(x0, x1, x2), squares_m2)
    }
}
