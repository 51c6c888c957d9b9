//! Newton's law for motor and screw, stepped so that energy is never created.
//!
//! ```text
//! m_m dV₁/dt = drive + c − friction_m(V₁)        dX₁/dt = V₁
//! m_s dV₂/dt = load  − c − friction_s(V₂)        dX₂/dt = V₂
//! ```
//! c is the force in the coupling, positive when the screw is ahead. Over a step of length h the
//! mean speeds U₁, U₂ are unknown; X′ = X + h U, V′ = 2U − V, c is the mean contact force along the
//! step and friction is taken at U. That is the implicit midpoint rule with a discrete gradient: of
//! second order, stable at any stiffness, elastic energy exchanged exactly, friction only dissipates.
//! A mass that friction holds has U = 0 exactly, and stops: V′ = 0.
//!
//! U₁ and U₂ are monotonic in c, and c in U₂ − U₁, so one scalar equation with one root
//! remains; Newton's method inside a bracket finds it in two or three iterations.

use crate::plant::actuator_plant::Plant;

/// Tolerance of the equation for U₂ − U₁, m/s: 10⁻¹⁷ m over a step of 10⁻⁴ s.
const SPEED_TOLERANCE_M_PER_S: f64 = 1e-13;
/// Most iterations: far more than bisection alone would need.
const TURNS: usize = 80;

/// Positions and speeds of both masses, and bend of their friction bristles.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct State {
    /// X₁, metres.
    pub(crate) motor_m: f64,
    /// dX₁/dt, m/s.
    pub(crate) motor_m_per_s: f64,
    /// X₂, metres.
    pub(crate) screw_m: f64,
    /// dX₂/dt, m/s.
    pub(crate) screw_m_per_s: f64,
    /// Bend of the motor's friction bristles, −1 to 1; 0 unless the law has bristles.
    pub(crate) motor_bend: f64,
    /// Bend of the screw's friction bristles, −1 to 1.
    pub(crate) screw_bend: f64,
}

/// The forces from outside, constant over a step.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Forces {
    /// Force of the motor's field, at the screw, N.
    pub(crate) drive_n: f64,
    /// The aerodynamic load on the screw, N, positive along +X.
    pub(crate) load_n: f64,
    /// Prescribed vibration of the motor, added to X₁, at the start of the step, metres.
    pub(crate) shake_m: f64,
    /// Mean speed of this vibration over the step, m/s.
    pub(crate) shake_m_per_s: f64,
}

/// The state one step later.
pub(crate) fn advance(plant: &Plant, state: &State, forces: Forces, step_s: f64) -> State {
    let body = |friction, mass_kg: f64, speed, bend, force_n: f64| {
        let rate = 2.0 * mass_kg / step_s;
        let body = plant.friction_law.body(friction, forces.load_n, speed, bend, rate, step_s);
        (body, rate * speed + force_n)
    };
    let (v1, v2) = (state.motor_m_per_s, state.screw_m_per_s);
    let (motor, motor_push_n) =
        body(&plant.motor_friction, plant.motor_mass_kg, v1, state.motor_bend, forces.drive_n);
    let (screw, screw_push_n) =
        body(&plant.screw_friction, plant.screw_mass_kg, v2, state.screw_bend, forces.load_n);
    // The mean speeds at which both masses and the coupling agree. The mismatch falls at least as fast as the relative speed
    // rises, so the root lies between the guess and the guess plus the mismatch.
    let delta_m = state.screw_m - state.motor_m - forces.shake_m;
    let (mut relative, mut low, mut high) = (v2 - v1, f64::NEG_INFINITY, f64::INFINITY);
    let (mut u1, mut u2) = (0.0, 0.0);
    for _ in 0..TURNS {
        let coupling = plant.contact.mean_force(delta_m, relative - forces.shake_m_per_s, step_s);
        let (slope1, slope2);
        (u1, slope1) = motor.mean_velocity(motor_push_n + coupling.force_n);
        (u2, slope2) = screw.mean_velocity(screw_push_n - coupling.force_n);
        let miss = u2 - u1 - relative;
        if miss.abs() < SPEED_TOLERANCE_M_PER_S {
            break;
        }
        if miss > 0.0 {
            (low, high) = (relative, high.min(relative + miss));
        } else {
            (low, high) = (low.max(relative + miss), relative);
        }
        let newton = relative + miss / (1.0 + (slope1 + slope2) * coupling.slope_n_s_per_m);
        relative = if newton >= low && newton <= high { newton } else { 0.5 * (low + high) };
    }
    State {
        motor_m: state.motor_m + step_s * u1,
        motor_m_per_s: after(v1, u1),
        screw_m: state.screw_m + step_s * u2,
        screw_m_per_s: after(v2, u2),
        motor_bend: motor.bristle_update(u1),
        screw_bend: screw.bristle_update(u2),
    }
}

/// Speed after a step: zero for a mass that friction holds, else by the midpoint rule.
fn after(before: f64, mean: f64) -> f64 {
    if mean == 0.0 { 0.0 } else { 2.0 * mean - before }
}
