//! The actuator brought to the screw axis, and its relative dynamics (equations 1–17).

use core::f64::consts::TAU;

use nalgebra::{ComplexField, Matrix3, Vector3};

use crate::error::Error;

/// Motor position brought to the screw axis: X₁ = θ·r/2π, m.
///
/// `lead_m_per_rev` is the travel for one turn; the paper calls it reduction ratio.
pub fn motor_position_m(angle_rad: f64, lead_m_per_rev: f64) -> f64 {
    angle_rad * lead_m_per_rev / TAU
}

/// Motor inertia seen at the screw axis: m_m = J_m (2π/r)², kg.
///
/// The paper prints J_m (r/2π)², which is no mass (kg·m⁴).
pub fn reflected_mass_kg(inertia_kg_m2: f64, lead_m_per_rev: f64) -> f64 {
    inertia_kg_m2 * ComplexField::powi(TAU / lead_m_per_rev, 2)
}

/// Stiffness, damping and screw mass of an actuator at the screw axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ActuatorModel {
    stiffness_n_per_m: f64,
    damping_n_s_per_m: f64,
    screw_mass_kg: f64,
}

impl ActuatorModel {
    /// A linear actuator: K in N/m, f in N·s/m, m_s in kg.
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

    /// A part that only turns, seen at a radius r: x = rθ, so K = k/r², f = c/r², m = J/r².
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

    /// K, N/m.
    pub fn stiffness_n_per_m(&self) -> f64 {
        self.stiffness_n_per_m
    }

    /// A, 3×3, of ẋ = A x + B u (11), state x = [δX m, δẊ m/s, S m] (7).
    pub fn a(&self) -> Matrix3<f64> {
        let (k, f) =
            (self.stiffness_n_per_m / self.screw_mass_kg, self.damping_n_s_per_m / self.screw_mass_kg);
        Matrix3::new(0.0, 1.0, 0.0, -k, -f, k, 0.0, 0.0, 0.0)
    }

    /// B, 3×1, of the load (12).
    pub fn b(&self) -> Vector3<f64> {
        Vector3::new(0.0, self.screw_mass_kg.recip(), 0.0)
    }
}

/// Friction of equation 1, N, at a speed that is not zero: F_v Ẋ + sign(Ẋ)(F_dry + η|F_l|).
///
/// η is the fraction of the load lost, about 1 − efficiency; the paper prints "efficiency". At rest the
/// sign is set-valued: a stopped screw holds any force within ±(F_dry + η|F_l|), here returned as zero.
pub fn friction_n(
    speed_m_per_s: f64,
    load_n: f64,
    viscous_n_s_per_m: f64,
    dry_n: f64,
    lost_fraction: f64,
) -> f64 {
    let side = if speed_m_per_s == 0.0 { 0.0 } else { speed_m_per_s.signum() };
    viscous_n_s_per_m * speed_m_per_s + side * (dry_n + lost_fraction * load_n.abs())
}

pub(crate) fn positive(name: &'static str, value: f64) -> Result<(), Error> {
    if value.is_finite() && value > 0.0 { Ok(()) } else { Err(Error::Parameter { name, value }) }
}
