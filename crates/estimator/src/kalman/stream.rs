//! The filter as the samples come: one at a time, in bounded time and without allocating.
//!
//! The step loops over nothing and decides nothing by the value of a sample, but for one question: is it
//! there? [`Stream::constant_time`] runs the whole recursion at each step, before it has settled and after, so
//! the longest step takes as many operations as the mean one (a missing sample, fewer).
//! [`Stream::steady_state`] takes the settled shortcut of the batch and gives its bits; its longest step is
//! the even one.

use crate::error::Error;
use crate::kalman::filter::{Filter, KalmanState};
use crate::kalman::steady_state::{self, SteadyState, SteadyStateFilter};

/// A filter under way.
#[derive(Debug, Clone, Copy)]
pub struct Stream {
    filter: Filter,
    folded: Option<SteadyStateFilter>,
    state: Option<KalmanState>,
    /// Whether the covariance has come to that of the folded map.
    settled: bool,
    /// The state as the folded map has it, once it has taken a sample and while it takes all.
    bent: Option<SteadyState>,
    /// Load of the last sample, N; NaN where it was missing.
    last_load_n: f64,
    /// The last load that was there, N.
    held_load_n: f64,
}

impl Stream {
    /// The whole recursion at each step: worst time equals mean time, and nothing is computed ahead.
    ///
    /// Differs from the batch by less than 1e-12 of the peak of S.
    pub fn constant_time(filter: &Filter) -> Self {
        let (filter, nan) = (*filter, f64::NAN);
        let (folded, state, bent) = (None, None, None);
        Self { filter, folded, state, settled: false, bent, last_load_n: nan, held_load_n: 0.0 }
    }

    /// The batch's bits: the whole recursion until the gain has settled, one constant map from there.
    ///
    /// Where the gain never settles it goes on as [`Stream::constant_time`], like the batch.
    pub fn steady_state(filter: &Filter) -> Self {
        let folded =
            filter.steady_state_gain().ok().map(|(gain, p)| SteadyStateFilter::new(filter, &gain, &p));
        Self { folded, ..Self::constant_time(filter) }
    }

    /// Takes the next sample, and gives S, m: relative position `y_m` in m and load in N, NaN where missing.
    ///
    /// A missing load is taken to be the one before it. S is NaN until a first position is measured. There
    /// alone the batch knows more: it looks ahead, and starts at the segment's first row from the first
    /// measurement; this filter starts at that measurement, and is the batch of what follows.
    ///
    /// # Errors
    /// [`Error::InnovationCovariance`], for noise levels that contradict each other.
    pub fn push(&mut self, y_m: f64, load_n: f64) -> Result<f64, Error> {
        let before_n = self.last_load_n;
        self.last_load_n = load_n;
        let held_before_n = self.held_load_n;
        self.held_load_n = if load_n.is_nan() { held_before_n } else { load_n };
        let Some(state) = &mut self.state else { return self.start(y_m) };
        let whole = self.settled && !(y_m + before_n).is_nan();
        if let Some(folded) = self.folded.as_ref().filter(|_| whole) {
            let bent = self.bent.get_or_insert_with(|| folded.transform(&state.x));
            steady_state::step(folded, bent, y_m, before_n);
            state.x = folded.inverse_transform(*bent);
            return Ok(bent[2]);
        }
        self.bent = None;
        let prior = self.filter.predict(state, held_before_n);
        self.correct(prior, y_m)
    }

    /// The state after the last sample, once a position was measured. In the settled shortcut its
    /// covariance stays that of the step before it.
    pub fn estimate(&self) -> Option<&KalmanState> {
        self.state.as_ref()
    }

    /// Forgets all samples: the next is the first of a new segment.
    pub fn restart(&mut self) {
        *self = Self { folded: self.folded, ..Self::constant_time(&self.filter) };
    }

    fn start(&mut self, y_m: f64) -> Result<f64, Error> {
        if y_m.is_nan() {
            return Ok(f64::NAN);
        }
        self.correct(self.filter.initial_state(y_m, self.held_load_n), y_m)
    }

    fn correct(&mut self, prior: KalmanState, y_m: f64) -> Result<f64, Error> {
        let step = self.filter.update(&prior, y_m)?;
        self.settled = self.folded.as_ref().is_some_and(|folded| folded.is_converged(&step));
        self.state = Some(step.posterior);
        Ok(step.posterior.x[2])
    }
}
