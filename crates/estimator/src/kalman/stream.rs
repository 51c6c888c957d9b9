//! Sample-by-sample filter in bounded time, without allocation. The filter of whole flights is a loop over it.
//!
//! The covariance depends on no measurement, so the gain converges while no position is missing.
//! [`Stream::steady_state`] then keeps this gain, which saves nine tenths of a step's time. [`Stream::constant_time`]
//! computes every gain, so its longest step takes as many operations as its mean step (a missing sample takes fewer).
//! Neither uses fused multiply-add: both give the same bits on every machine.

use nalgebra::{Matrix3, Vector3};

use crate::error::Error;
use crate::kalman::filter::{Filter, FilterStep, KalmanState, distance};

/// Relative difference of the covariance from its steady state below which the steady-state gain is used. The relative
/// error of S that this causes is as small, and decays.
const NEAR: f64 = 1e-13;

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
/// let mut s_m = f64::NAN;
/// for _ in 0..500 {
///     s_m = stream.push(40e-6, 0.0)?.s_m();
/// }
/// assert!((s_m - 40e-6).abs() < 1e-9);
/// # Ok::<(), estimator::Error>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Stream {
    filter: Filter,
    steady: Option<SteadyGain>,
    /// x(k+1/k) and P(k+1/k) of the next sample, once a position was measured.
    prior: Option<KalmanState>,
    /// Whether the covariance has converged to that of the steady-state gain.
    settled: bool,
    /// The last load that was not missing, N.
    held_load_n: f64,
}

/// What one sample did to a [`Stream`]; all are NaN before the first measured position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StreamStep {
    /// State x(k+1/k+1) = [δX m, δẊ m/s, S m].
    pub x: Vector3<f64>,
    /// e = y − C x(k+1/k), m; NaN where the position is missing.
    pub innovation_m: f64,
    /// Its variance C P Cᵀ + V_d, m².
    pub innovation_variance_m2: f64,
}

impl StreamStep {
    /// S, m: the relative position that elastic deflection does not explain.
    pub fn s_m(&self) -> f64 {
        self.x[2]
    }
}

/// The steady-state gain K and its covariance.
#[derive(Debug, Clone, Copy)]
struct SteadyGain {
    gain: Vector3<f64>,
    /// Coefficients of x(k+1/k), y and u in the predicted position and speed: the first two rows of
    /// `[A_d (I − K C), A_d K, B_d]`.
    ahead: [[f64; 5]; 2],
    /// P(k+1/k).
    p: Matrix3<f64>,
    variance_m2: f64,
}

impl Stream {
    /// The whole recursion (24–28) at each step: the longest step takes as long as the mean step.
    ///
    /// S differs from that of [`Stream::steady_state`] by less than 1e-12 of its peak.
    pub fn constant_time(filter: &Filter) -> Self {
        Self { filter: *filter, steady: None, prior: None, settled: false, held_load_n: 0.0 }
    }

    /// The whole recursion (24–28) until the gain converges, (24) and (27) with that gain afterwards. The filter of whole
    /// flights does the same, so its S is bitwise identical.
    ///
    /// Where the gain does not converge, each step is that of [`Stream::constant_time`].
    pub fn steady_state(filter: &Filter) -> Self {
        let settled = filter.steady_state_gain().ok();
        let steady = settled.map(|(gain, p)| SteadyGain::new(filter, gain, p));
        Self { steady, ..Self::constant_time(filter) }
    }

    /// Filters the next sample, from the relative position `y_m`, m, and the load, N; NaN where missing.
    ///
    /// A missing load is replaced by the one before it. S is NaN until a first position is measured. Only before that
    /// measurement does the filter of whole flights differ: it starts from the same measurement, but at the segment's
    /// first row.
    ///
    /// # Errors
    /// [`Error::InnovationCovariance`] for noise levels that contradict each other.
    #[inline]
    pub fn push(&mut self, y_m: f64, load_n: f64) -> Result<StreamStep, Error> {
        if let Some((steady, x)) = self.settled_state().filter(|_| is_complete(y_m, load_n)) {
            let (step, x) = steady.step(&x, y_m, load_n);
            self.keep_state(x, load_n);
            return Ok(step);
        }
        self.push_unsettled(y_m, load_n)
    }

    /// Pushes all samples in order, and passes each step to `put`.
    ///
    /// The same numbers as [`Stream::push`]. While the gain is settled and no sample is missing, the state stays in
    /// registers, which saves more than half of the time.
    ///
    /// # Errors
    /// As [`Stream::push`].
    #[cfg(feature = "std")]
    #[inline]
    pub(crate) fn push_all<'a>(
        &mut self,
        samples: impl Iterator<Item = (&'a f64, &'a f64)>,
        mut put: impl FnMut(&StreamStep),
    ) -> Result<(), Error> {
        let mut samples = samples.peekable();
        loop {
            if let Some((steady, mut x)) = self.settled_state() {
                let mut before_n = self.held_load_n;
                while let Some((&y_m, &load_n)) =
                    samples.next_if(|(y_m, load_n)| is_complete(**y_m, **load_n))
                {
                    let step;
                    (step, x) = steady.step(&x, y_m, load_n);
                    before_n = load_n;
                    put(&step);
                }
                self.keep_state(x, before_n);
            }
            let Some((&y_m, &load_n)) = samples.next() else { return Ok(()) };
            put(&self.push_unsettled(y_m, load_n)?);
        }
    }

    /// The steady-state gain and x(k+1/k); `None` while the covariance has not converged.
    #[inline]
    fn settled_state(&self) -> Option<(SteadyGain, Vector3<f64>)> {
        if !self.settled {
            return None;
        }
        self.steady.zip(self.prior.map(|prior| prior.x))
    }

    #[inline]
    fn keep_state(&mut self, x: Vector3<f64>, load_n: f64) {
        self.held_load_n = load_n;
        if let Some(prior) = &mut self.prior {
            prior.x = x;
        }
    }

    /// The whole recursion.
    fn push_unsettled(&mut self, y_m: f64, load_n: f64) -> Result<StreamStep, Error> {
        self.held_load_n = if load_n.is_nan() { self.held_load_n } else { load_n };
        if self.prior.is_none() && !y_m.is_nan() {
            self.start(y_m, self.held_load_n);
        }
        let Some(prior) = &self.prior else {
            let nan = f64::NAN;
            return Ok(StreamStep {
                x: Vector3::repeat(nan),
                innovation_m: nan,
                innovation_variance_m2: nan,
            });
        };
        let step = self.filter.update(prior, y_m)?;
        self.settled = self.steady.as_ref().is_some_and(|steady| steady.is_reached(&step));
        self.prior = Some(self.filter.predict(&step.posterior, self.held_load_n));
        let FilterStep { posterior, innovation_m, innovation_variance_m2, .. } = step;
        Ok(StreamStep { x: posterior.x, innovation_m, innovation_variance_m2 })
    }

    /// Sets the initial state, from a position, m, and a load, N, for the next sample.
    pub(crate) fn start(&mut self, y_m: f64, load_n: f64) {
        self.prior = Some(self.filter.initial_state(y_m, load_n));
    }

    /// Restarts the filter: the next sample is the first of a new segment.
    pub fn restart(&mut self) {
        *self = Self { steady: self.steady, ..Self::constant_time(&self.filter) };
    }
}

/// Whether neither position nor load is missing (NaN).
#[inline]
fn is_complete(y_m: f64, load_n: f64) -> bool {
    y_m.partial_cmp(&load_n).is_some()
}

impl SteadyGain {
    fn new(filter: &Filter, gain: Vector3<f64>, p: Matrix3<f64>) -> Self {
        let (a, b) = (&filter.discrete().a_d, &filter.discrete().b_d);
        let a_k = a * gain;
        let ahead = [0, 1].map(|i| [a[(i, 0)] - a_k[i], a[(i, 1)], a[(i, 2)], a_k[i], b[i]]);
        Self { gain, ahead, p, variance_m2: p[(0, 0)] + filter.noise().v_d_m2 }
    }

    /// Corrects with one sample (27), and predicts the next state (24), in which S does not change.
    ///
    /// The prediction is A_d (I − K C) x + A_d K y + B_d u: the processor computes it without waiting for the innovation.
    #[inline]
    fn step(&self, prior: &Vector3<f64>, y_m: f64, load_n: f64) -> (StreamStep, Vector3<f64>) {
        let innovation_m = y_m - prior[0];
        let x = prior + self.gain * innovation_m;
        let [position_m, speed_m_per_s] = self.ahead.map(|row| {
            (row[0] * prior[0] + row[1] * prior[1]) + (row[2] * prior[2] + (row[3] * y_m + row[4] * load_n))
        });
        let step = StreamStep { x, innovation_m, innovation_variance_m2: self.variance_m2 };
        (step, Vector3::new(position_m, speed_m_per_s, x[2]))
    }

    /// Whether the step corrected the state with a covariance that has converged to that of this gain.
    fn is_reached(&self, step: &FilterStep) -> bool {
        !step.innovation_m.is_nan() && distance(&self.p, &step.prior.p) <= NEAR
    }
}
