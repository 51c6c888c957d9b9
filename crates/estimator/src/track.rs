//! The filter over whole flights: S(t) of every segment.
//!
//! The covariance depends on no measurement, so while every sample is measured the gain settles. From
//! there predict and correct fold into one map with constant coefficients, three chains of products that
//! the processor runs side by side. A missing sample sets the covariance moving again, and the plain
//! recursion runs until it is back.

use nalgebra::Vector3;

use crate::Samples;
use crate::error::Error;
use crate::filter::Filter;
use crate::folded::Folded;

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
