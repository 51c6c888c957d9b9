//! Process and measurement noise, from sensor data and a bandwidth, or as given.

use core::f64::consts::TAU;

use nalgebra::{ComplexField, Matrix3, Vector3};

use crate::error::Error;
use crate::model::actuator::{ActuatorModel, positive};
use crate::model::discretise::{DiscreteModel, white_covariance};

/// How W_d and V_d are found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NoiseModel {
    /// From what is known of sensors and friction; the default.
    Sensors(SensorNoise),
    /// As the paper has them: per step, right for one sample rate.
    PerStep {
        /// W_d, 3×3, covariance of the states [m, m/s, m] over a step.
        w_d: Matrix3<f64>,
        /// V_d, m².
        v_d_m2: f64,
    },
    /// Exact discretisation of white densities. Not suitable where the structural mode is above Nyquist: the mode is
    /// excited by noise above Nyquist, and the gap is 9–15 % low at 100 Hz.
    Continuous {
        /// Density of the unknown force, N²·s.
        force_psd_n2_s: f64,
        /// Density of the backlash rate, m²/s.
        backlash_rate_psd_m2_per_s: f64,
        /// V_d, m².
        v_d_m2: f64,
    },
}

/// Sensor facts, m at the screw axis, and the bandwidth in which the backlash may move.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SensorNoise {
    /// Noise of the screw position, rms, m.
    pub screw_rms_m: f64,
    /// Its smallest step, m.
    pub screw_resolution_m: f64,
    /// Noise of the motor position, rms, m.
    pub motor_rms_m: f64,
    /// Its smallest step, m.
    pub motor_resolution_m: f64,
    /// Rms of the force the model does not know, N.
    pub unknown_force_n: f64,
    /// f_S, Hz.
    pub bandwidth_hz: f64,
}

/// A bandwidth above the sample rate cannot be had: the process noise it needs grows as e^(2π f_S Ts) without end.
const MAX_BANDWIDTH_PER_RATE: f64 = 1.0;

/// W_d and V_d of one sample rate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NoiseCovariances {
    /// W_d, 3×3.
    pub w_d: Matrix3<f64>,
    /// V_d, m².
    pub v_d_m2: f64,
}

impl SensorNoise {
    /// σ_y² = both noise variances plus resolution²/12 each, m² (quantisation noise: Bennett 1948,
    /// <https://doi.org/10.1002/j.1538-7305.1948.tb01340.x>).
    pub(crate) fn variance_m2(&self) -> f64 {
        let square = |v: f64| v * v;
        square(self.screw_rms_m)
            + square(self.motor_rms_m)
            + (square(self.screw_resolution_m) + square(self.motor_resolution_m)) / 12.0
    }

    /// W_d = σ_F² B_d B_dᵀ + diag(0, 0, (σ_y² + (σ_F/K)²) g²/(1 − g)), V_d = σ_y², with
    /// g = 1 − e^(−2π f_S Ts): the slow pole of the closed loop then sits at f_S.
    fn covariances(
        &self,
        actuator: &ActuatorModel,
        discrete: &DiscreteModel,
        step_s: f64,
    ) -> Result<NoiseCovariances, Error> {
        for (name, value) in [
            ("screw_rms_m", self.screw_rms_m),
            ("screw_resolution_m", self.screw_resolution_m),
            ("motor_rms_m", self.motor_rms_m),
            ("motor_resolution_m", self.motor_resolution_m),
            ("unknown_force_n", self.unknown_force_n),
        ] {
            not_negative(name, value)?;
        }
        positive("bandwidth_hz", self.bandwidth_hz)?;
        if self.bandwidth_hz * step_s > MAX_BANDWIDTH_PER_RATE {
            return Err(Error::Parameter { name: "bandwidth_hz", value: self.bandwidth_hz });
        }
        let v_d_m2 = self.variance_m2();
        positive("measurement variance", v_d_m2)?;
        let g = -ComplexField::exp_m1(-TAU * self.bandwidth_hz * step_s);
        let slack = self.unknown_force_n / actuator.stiffness_n_per_m();
        let q = (v_d_m2 + slack * slack) * g * g / (1.0 - g);
        let force = discrete.b_d * discrete.b_d.transpose() * (self.unknown_force_n * self.unknown_force_n);
        Ok(NoiseCovariances { w_d: force + Matrix3::from_diagonal(&Vector3::new(0.0, 0.0, q)), v_d_m2 })
    }
}

impl NoiseModel {
    /// W_d, 3×3 in the units of [m, m/s, m], and V_d, m², at a step, s (4, 9, 10, 22).
    ///
    /// `Sensors` and `PerStep` as in `docs/equations.md`, "Discretisation"; `Continuous` by van Loan 1978
    /// (<https://doi.org/10.1109/TAC.1978.1101743>).
    ///
    /// # Errors
    /// [`Error::Parameter`] for a level that is negative or not finite, or a measurement without noise.
    pub(crate) fn covariances(
        &self,
        actuator: &ActuatorModel,
        discrete: &DiscreteModel,
        step_s: f64,
    ) -> Result<NoiseCovariances, Error> {
        match *self {
            Self::Sensors(sensors) => sensors.covariances(actuator, discrete, step_s),
            Self::PerStep { w_d, v_d_m2 } => {
                positive("v_d_m2", v_d_m2)?;
                w_d.iter().try_for_each(|v| {
                    if v.is_finite() { Ok(()) } else { Err(Error::Parameter { name: "w_d", value: *v }) }
                })?;
                w_d.diagonal().iter().try_for_each(|v| not_negative("w_d", *v))?;
                Ok(NoiseCovariances { w_d, v_d_m2 })
            }
            Self::Continuous { force_psd_n2_s, backlash_rate_psd_m2_per_s, v_d_m2 } => {
                positive("v_d_m2", v_d_m2)?;
                not_negative("force_psd_n2_s", force_psd_n2_s)?;
                not_negative("backlash_rate_psd_m2_per_s", backlash_rate_psd_m2_per_s)?;
                let b = actuator.b();
                let s = Matrix3::from_diagonal(&Vector3::new(0.0, 0.0, backlash_rate_psd_m2_per_s));
                let q_c = b * b.transpose() * force_psd_n2_s + s;
                Ok(NoiseCovariances { w_d: white_covariance(actuator, &q_c, step_s), v_d_m2 })
            }
        }
    }
}

pub(crate) fn not_negative(name: &'static str, value: f64) -> Result<(), Error> {
    if value.is_finite() && value >= 0.0 { Ok(()) } else { Err(Error::Parameter { name, value }) }
}
