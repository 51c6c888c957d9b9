//! Actuator parameters at the screw axis, and the relative dynamics (equations 3–17).

use nalgebra::{Matrix3, Vector3};

use crate::error::Error;

/// Stiffness, damping and screw mass of an actuator at the screw axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ActuatorModel {
    stiffness_n_per_m: f64,
    damping_n_s_per_m: f64,
    screw_mass_kg: f64,
}

impl ActuatorModel {
    /// Linear actuator with the parameters of equation 3: K in N/m, f in N·s/m, m_s in kg.
    ///
    /// # Errors
    /// [`Error::Parameter`] for a value that is not finite, a stiffness or mass that is not positive,
    /// or a negative damping.
    pub fn linear(stiffness_n_per_m: f64, damping_n_s_per_m: f64, screw_mass_kg: f64) -> Result<Self, Error> {
        positive("stiffness_n_per_m", stiffness_n_per_m)?;
        positive("screw_mass_kg", screw_mass_kg)?;
        if !(damping_n_s_per_m.is_finite() && damping_n_s_per_m >= 0.0) {
            return Err(Error::Parameter { name: "damping_n_s_per_m", value: damping_n_s_per_m });
        }
        Ok(Self { stiffness_n_per_m, damping_n_s_per_m, screw_mass_kg })
    }

    /// Rotary part at a radius r, m: x = r θ and F = T/r in equation 3, so K = k/r², f = c/r², m = J/r².
    ///
    /// `k` in N·m/rad, `c` in N·m·s/rad, `J` in kg·m².
    ///
    /// # Errors
    /// As [`ActuatorModel::linear`], and for a radius that is not positive.
    pub fn rotary(
        stiffness_nm_per_rad: f64,
        damping_nm_s_per_rad: f64,
        inertia_kg_m2: f64,
        reference_radius_m: f64,
    ) -> Result<Self, Error> {
        positive("reference_radius_m", reference_radius_m)?;
        let square = reference_radius_m * reference_radius_m;
        Self::linear(stiffness_nm_per_rad / square, damping_nm_s_per_rad / square, inertia_kg_m2 / square)
    }

    /// K of equation 3, N/m.
    pub fn stiffness_n_per_m(&self) -> f64 {
        self.stiffness_n_per_m
    }

    /// A, 3×3, of ẋ = A x + B u (11), state x = [δX m, δẊ m/s, S m] (7).
    pub fn a(&self) -> Matrix3<f64> {
        let (k, f) =
            (self.stiffness_n_per_m / self.screw_mass_kg, self.damping_n_s_per_m / self.screw_mass_kg);
        Matrix3::new(0.0, 1.0, 0.0, -k, -f, k, 0.0, 0.0, 0.0)
    }

    /// B, 3×1, of the load in N (12).
    pub fn b(&self) -> Vector3<f64> {
        Vector3::new(0.0, self.screw_mass_kg.recip(), 0.0)
    }
}

pub(crate) fn positive(name: &'static str, value: f64) -> Result<(), Error> {
    if value.is_finite() && value > 0.0 { Ok(()) } else { Err(Error::Parameter { name, value }) }
}
