//! Sample-by-sample filter in bounded time, without allocation.
//!
//! A step has no loop, and its only branch on a sample is whether the sample is missing.
//! [`Stream::constant_time`] runs the whole recursion at each step, so the longest step takes as many operations as the
//! mean one (a missing sample, fewer). [`Stream::steady_state`] switches to the steady-state filter as the batch does,
//! and is bitwise identical to it; its longest step is that of the constant-time filter.

use crate::error::Error;
use crate::kalman::filter::{Filter, KalmanState};
use crate::kalman::steady_state::{self, SteadyState, SteadyStateFilter};

/// Kalman filter (24–28) with its current state.
///
/// ```
/// use estimator::{ActuatorModel, Filter, NoiseModel, Stream};
///
/// let actuator = ActuatorModel::linear(5e7, 2000.0, 8.0)?;
/// let noise = NoiseModel::Continuous {
///     force_psd_n2_s: 100.0,
///     backlash_rate_psd_m2_per_s: 1e-9,
///     v_d_m2: 1e-11,
/// };
/// let mut stream = Stream::constant_time(&Filter::new(&actuator, 0.004, &noise)?);
/// // δX = 40 µm without load: S = 40 µm.
/// let s_m = (0..500).map(|_| stream.push(40e-6, 0.0)).last().unwrap_or(Ok(f64::NAN))?;
/// assert!((s_m - 40e-6).abs() < 1e-9);
/// # Ok::<(), estimator::Error>(())
/// ```
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
    /// The whole recursion (24–28) at each step: worst time equals mean time, and nothing is computed ahead.
    ///
    /// Differs from the batch by less than 1e-12 of the peak of S.
    pub fn constant_time(filter: &Filter) -> Self {
        let (filter, nan) = (*filter, f64::NAN);
        let (folded, state, bent) = (None, None, None);
        Self { filter, folded, state, settled: false, bent, last_load_n: nan, held_load_n: 0.0 }
    }

    /// Bitwise identical to the batch: the whole recursion (24–28) until the steady state, one constant map afterwards.
    ///
    /// Without a steady state it continues as [`Stream::constant_time`], like the batch.
    pub fn steady_state(filter: &Filter) -> Self {
        let folded =
            filter.steady_state_gain().ok().map(|(gain, p)| SteadyStateFilter::new(filter, &gain, &p));
        Self { folded, ..Self::constant_time(filter) }
    }

    /// Filters the next sample and returns S, m, from the relative position `y_m`, m, and the load, N; NaN where missing.
    ///
    /// A missing load is replaced by the one before it. S is NaN until a first position is measured. Only there the
    /// batch differs: it starts at the segment's first row from the first
    /// measurement; this filter starts at that measurement.
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

    /// The state after the last sample, once a position was measured. In the steady state its
    /// covariance stays that of the last transient step.
    pub fn estimate(&self) -> Option<&KalmanState> {
        self.state.as_ref()
    }

    /// Restarts the filter: the next sample is the first of a new segment.
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
