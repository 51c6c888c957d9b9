//! The linear Kalman filter (equations 24–28), one sample at a time and without allocating.

use nalgebra::{ComplexField, Matrix3, Vector3};

use crate::error::Error;
use crate::model::ActuatorModel;
use crate::model::DiscreteModel;
use crate::model::{NoiseCovariances, NoiseModel, not_negative};

/// The covariance has settled when it changes by less than this share of itself in a step.
const SETTLED: f64 = 1e-15;
/// Rounding may keep the covariance from settling so far. It has then settled after this number of steps without a
/// smaller change, if its change is below this share.
const STALLED: (usize, f64) = (100, 1e-9);
/// Steps within which a sound tuning settles many times over.
const SETTLING_STEPS: usize = 200_000;

/// State x = [δX m, δẊ m/s, S m] and its covariance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KalmanState {
    /// The state, 3×1 (7).
    pub x: Vector3<f64>,
    /// Its covariance, 3×3.
    pub p: Matrix3<f64>,
}

/// Variances of the initial state, P₀ = diag(position, speed, backlash): the paper gives none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InitialVariances {
    /// Variance of the initial relative position, m²; by default V_d, since the first measurement is the position.
    pub position_m2: Option<f64>,
    /// Variance of the initial relative speed, (m/s)².
    pub speed_m2_per_s2: f64,
    /// Variance of the initial backlash, m².
    pub backlash_m2: f64,
}

impl Default for InitialVariances {
    /// V_d, 10⁻⁴ (m/s)² and 10⁻⁶ m².
    fn default() -> Self {
        Self { position_m2: None, speed_m2_per_s2: 1e-4, backlash_m2: 1e-6 }
    }
}

/// What one sample did to the state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FilterStep {
    /// Before the measurement: x(k+1/k), P(k+1/k).
    pub prior: KalmanState,
    /// After it: x(k+1/k+1), P(k+1/k+1); the prior where the measurement is missing.
    pub posterior: KalmanState,
    /// e = y − C x(k+1/k), m; NaN where the measurement is missing.
    pub innovation_m: f64,
    /// Its variance C P Cᵀ + V_d, m².
    pub innovation_variance_m2: f64,
    /// K_f, 3×1 [1, s⁻¹, 1] (26); zero where the measurement is missing.
    pub gain: Vector3<f64>,
}

/// A filter for one actuator, step and noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Filter {
    discrete: DiscreteModel,
    noise: NoiseCovariances,
    stiffness_n_per_m: f64,
    step_s: f64,
    initial: InitialVariances,
}

impl Filter {
    /// Discretises model (20, 21) and noise (22) for a step, s.
    ///
    /// ```
    /// use estimator::{ActuatorModel, Filter, NoiseModel};
    ///
    /// let actuator = ActuatorModel::linear(5e7, 2000.0, 8.0)?;
    /// let noise = NoiseModel::Continuous {
    ///     force_psd_n2_s: 100.0,
    ///     backlash_rate_psd_m2_per_s: 1e-9,
    ///     v_d_m2: 1e-11,
    /// };
    /// let filter = Filter::new(&actuator, 0.004, &noise)?;
    /// // δX = 0.1 mm under 4 kN: S = δX − F/K = 20 µm.
    /// let state = filter.initial_state(1e-4, 4e3);
    /// assert!((state.x[2] - 20e-6).abs() < 1e-12);
    /// # Ok::<(), estimator::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Parameter`] for a step or noise level that no log can have.
    pub fn new(actuator: &ActuatorModel, step_s: f64, noise: &NoiseModel) -> Result<Self, Error> {
        let discrete = DiscreteModel::new(actuator, step_s)?;
        let noise = noise.covariances(actuator, &discrete, step_s)?;
        Ok(Self {
            discrete,
            noise,
            stiffness_n_per_m: actuator.stiffness_n_per_m(),
            step_s,
            initial: InitialVariances::default(),
        })
    }

    /// The same filter with other variances of its initial state, P₀.
    ///
    /// # Errors
    /// [`Error::Parameter`] for a variance that is negative or not finite.
    pub fn with_initial_variances(self, initial: InitialVariances) -> Result<Self, Error> {
        not_negative("initial position variance", initial.position_m2.unwrap_or(0.0))?;
        not_negative("initial speed variance", initial.speed_m2_per_s2)?;
        not_negative("initial backlash variance", initial.backlash_m2)?;
        Ok(Self { initial, ..self })
    }

    /// A_d and B_d.
    pub fn discrete(&self) -> &DiscreteModel {
        &self.discrete
    }

    /// W_d and V_d.
    pub fn noise(&self) -> &NoiseCovariances {
        &self.noise
    }

    /// Initial state from the first measurement, m, and its load, N:
    /// x₀ = [y, 0, y − u/K], P₀ = diag(V_d, 10⁻⁴, 10⁻⁶) in m², (m/s)², m², or the filter's [`InitialVariances`].
    ///
    /// The paper gives none (`docs/equations.md`, "The filter"). x₀ = 0 adds 650 % to the
    /// gap where δX has an offset of a millimetre.
    pub fn initial_state(&self, y_m: f64, load_n: f64) -> KalmanState {
        let InitialVariances { position_m2, speed_m2_per_s2, backlash_m2 } = self.initial;
        let position_m2 = position_m2.unwrap_or(self.noise.v_d_m2);
        KalmanState {
            x: Vector3::new(y_m, 0.0, y_m - load_n / self.stiffness_n_per_m),
            p: Matrix3::from_diagonal(&Vector3::new(position_m2, speed_m2_per_s2, backlash_m2)),
        }
    }

    /// One step ahead under a held load (24, 25): x = A_d x + B_d u, P = A_d P A_dᵀ + W_d.
    pub fn predict(&self, posterior: &KalmanState, load_n: f64) -> KalmanState {
        let a_d = &self.discrete.a_d;
        let p = symmetric(&(a_d * posterior.p * a_d.transpose() + self.noise.w_d));
        debug_assert!(has_positive_variances(&p, &p), "P(k+1/k) = {p}");
        KalmanState { x: self.predict_state(&posterior.x, load_n), p }
    }

    /// x = A_d x + B_d u.
    pub(crate) fn predict_state(&self, x: &Vector3<f64>, load_n: f64) -> Vector3<f64> {
        self.discrete.a_d * x + self.discrete.b_d * load_n
    }

    /// Folds one measured relative position into the predicted state (26–28).
    ///
    /// ```text
    /// e = y − C x        1×1  m            s = C P Cᵀ + V_d   1×1  m²
    /// K = P Cᵀ / s       3×1  (26)         x = x + K e        3×1  (27)
    /// P = (I − K C) P    3×3  (28), made symmetric
    /// ```
    /// The paper calls this step a prediction and prints C as a column; it is a correction and a row.
    /// A missing measurement (NaN) leaves the prediction as it is.
    ///
    /// # Errors
    /// [`Error::InnovationCovariance`] when s is not a positive, finite number.
    pub fn update(&self, prior: &KalmanState, y_m: f64) -> Result<FilterStep, Error> {
        let s_m2 = prior.p[(0, 0)] + self.noise.v_d_m2;
        if !(s_m2.is_finite() && s_m2 > 0.0) {
            return Err(Error::InnovationCovariance { s_m2 });
        }
        let mut step = FilterStep {
            prior: *prior,
            posterior: *prior,
            innovation_m: f64::NAN,
            innovation_variance_m2: s_m2,
            gain: Vector3::zeros(),
        };
        if !y_m.is_nan() {
            step.gain = prior.p.column(0) / s_m2;
            step.innovation_m = y_m - prior.x[0];
            let p = symmetric(&(prior.p - step.gain * prior.p.row(0)));
            debug_assert!(has_positive_variances(&p, &prior.p), "P(k+1/k+1) = {p}");
            step.posterior = KalmanState { x: prior.x + step.gain * step.innovation_m, p };
        }
        Ok(step)
    }

    /// Steady-state gain, 3×1 [1, s⁻¹, 1], and its P(k+1/k), 3×3: the fixed point of 25, 26 and 28 (discrete algebraic
    /// Riccati equation; Anderson and Moore 1979, *Optimal Filtering*, section 4.4), by iteration.
    ///
    /// # Errors
    /// [`Error::Unsettled`] when it does not settle; [`Error::InnovationCovariance`].
    pub fn steady_state_gain(&self) -> Result<(Vector3<f64>, Matrix3<f64>), Error> {
        let mut state = self.initial_state(0.0, 0.0);
        let (mut least, mut since) = (f64::INFINITY, 0);
        for _ in 0..SETTLING_STEPS {
            let step = self.update(&state, 0.0)?;
            let next = self.predict(&step.posterior, 0.0);
            let change = distance(&next.p, &state.p);
            (least, since) = if change < least { (change, 0) } else { (least, since + 1) };
            if change <= SETTLED || (since > STALLED.0 && least <= STALLED.1) {
                return Ok((step.gain, next.p));
            }
            state = next;
        }
        Err(Error::Unsettled { steps: SETTLING_STEPS })
    }

    /// Bandwidth of the steady-state filter, Hz: its slowest pole z = e^(s Ts), so f = −ln ρ/(2π Ts) with ρ
    /// the spectral radius of (I − K C) A_d. Compare it with the configured bandwidth.
    ///
    /// # Errors
    /// As [`Filter::steady_state_gain`].
    pub fn bandwidth_hz(&self) -> Result<f64, Error> {
        Ok(-ComplexField::ln(self.spectral_radius()?) / (core::f64::consts::TAU * self.step_s))
    }

    /// Spectral radius ρ of (I − K C) A_d, no unit: an initial-state error decays by this factor per step
    /// (error dynamics of 24 and 27). Infinite where the eigenvalues cannot be found.
    ///
    /// # Errors
    /// As [`Filter::steady_state_gain`].
    pub fn spectral_radius(&self) -> Result<f64, Error> {
        // Without a bound the iteration never ends on matrices that are not finite, or barely so.
        const MAX_ITERATIONS: usize = 1000;
        let (gain, _) = self.steady_state_gain()?;
        let mut keep = Matrix3::<f64>::identity();
        for row in 0..3 {
            keep[(row, 0)] -= gain[row];
        }
        let error = keep * self.discrete.a_d;
        let schur = nalgebra::Schur::try_new(error, f64::EPSILON, MAX_ITERATIONS);
        let schur = schur.filter(|_| error.iter().all(|entry: &f64| f64::is_finite(*entry)));
        Ok(schur.map_or(f64::INFINITY, |schur| {
            schur.complex_eigenvalues().iter().map(|pole| pole.modulus()).fold(0.0, f64::max)
        }))
    }
}

/// The largest difference of two symmetric covariances. Entries are of several units; each is held against the
/// spread of its own two states.
pub(crate) fn distance(p: &Matrix3<f64>, other: &Matrix3<f64>) -> f64 {
    let entry =
        |i: usize, j: usize| (p[(i, j)] - other[(i, j)]).abs() / ComplexField::sqrt(p[(i, i)] * p[(j, j)]);
    [(0, 0), (1, 1), (2, 2), (1, 0), (2, 0), (2, 1)].map(|(i, j)| entry(i, j)).into_iter().fold(0.0, f64::max)
}

/// Whether no variance is negative by more than rounding of the variances before.
fn has_positive_variances(p: &Matrix3<f64>, before: &Matrix3<f64>) -> bool {
    (0..3).all(|k| p[(k, k)].is_nan() || p[(k, k)] >= -1e-9 * before[(k, k)].abs())
}

fn symmetric(p: &Matrix3<f64>) -> Matrix3<f64> {
    (p + p.transpose()) * 0.5
}
