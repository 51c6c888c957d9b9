//! The force in the coupling: the load less a friction that sticks and slips (equation 1, as it is meant).
//!
//! The screw moves when the force on it exceeds F_d + η|F|, and is held below. In quasi-static terms:
//! hold the screw, let the motor move under it, and see what the coupling would then press; if load and
//! coupling differ by more than friction can hold, the screw slips until they do not.
//!
//! ```text
//! z ← z − ΔX₁                             the motor moves under a held screw
//! c ← K·dead_zone(z, ΔS)                  what the coupling then presses
//! c ← clamp(c, F − F_f, F + F_f)          the screw slips as far as it must; z follows
//! ```
//! So a moving screw has c = F − F_f·sgn Ẋ₂, a resting one keeps its c, and a flexing one (load changes,
//! motor at rest) shows the loop that a sign of the motor's speed cannot.

/// Dry friction of the screw and the share of the load lost (equation 1).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Friction {
    /// `F_d`, N.
    pub dry_n: f64,
    /// η, about 1 − efficiency.
    pub lost_share: f64,
}

impl Friction {
    /// F_d + η|F|, N.
    pub fn at_n(&self, load_n: f64) -> f64 {
        self.dry_n + self.lost_share * load_n.abs()
    }

    /// Whether a load is under three times the friction it meets.
    pub(super) fn is_heavy(&self, load_n: f64) -> bool {
        load_n < HEAVY * self.at_n(load_n)
    }
}

/// Load over friction below which friction rules what is seen.
const HEAVY: f64 = 3.0;

/// What the screw and its coupling are thought to be.
#[derive(Debug, Clone, Copy)]
pub(super) struct State {
    pub(super) stiffness_n_per_m: f64,
    pub(super) gap_m: f64,
    pub(super) friction: Friction,
    pub(super) skew_s: f64,
}

/// Force in the coupling, and how it answers to friction.
#[derive(Debug, Clone, Copy)]
pub(super) struct Coupling {
    /// c, N; NaN where a channel is missing.
    pub(super) force_n: f64,
    /// ∂c/∂F_d.
    pub(super) by_dry: f64,
    /// ∂c/∂η, N.
    pub(super) by_share_n: f64,
}

/// The coupling followed from block to block; each segment starts at rest, its friction unknown.
#[derive(Debug)]
pub(super) struct Walk {
    stiffness_n_per_m: f64,
    compliance_m_per_n: f64,
    half_gap_m: f64,
    friction: Friction,
    screw: Option<Screw>,
}

/// The screw between two blocks.
#[derive(Debug, Clone, Copy)]
struct Screw {
    motor_m: f64,
    /// Relative position from the middle of the gap, m.
    relative_m: f64,
    coupling: Coupling,
}

impl Walk {
    pub(super) fn new(state: &State) -> Self {
        Self {
            stiffness_n_per_m: state.stiffness_n_per_m,
            compliance_m_per_n: state.stiffness_n_per_m.recip(),
            half_gap_m: 0.5 * state.gap_m,
            friction: state.friction,
            screw: None,
        }
    }

    /// A new segment begins.
    pub(super) fn restart(&mut self) {
        self.screw = None;
    }

    /// The coupling at the next block. One with a channel missing is passed over.
    #[inline]
    pub(super) fn step(&mut self, motor_m: f64, load_n: f64) -> Coupling {
        if !(motor_m + load_n).is_finite() {
            return Coupling { force_n: f64::NAN, by_dry: 0.0, by_share_n: 0.0 };
        }
        let (relative_m, coupling) = match self.screw {
            Some(before) => self.moved(&before, motor_m, load_n),
            None => (self.relative_m(load_n), Coupling { force_n: load_n, by_dry: 0.0, by_share_n: 0.0 }),
        };
        self.screw = Some(Screw { motor_m, relative_m, coupling });
        coupling
    }

    #[inline]
    fn moved(&self, before: &Screw, motor_m: f64, load_n: f64) -> (f64, Coupling) {
        let held_m = before.relative_m - (motor_m - before.motor_m);
        let held_n = self.stiffness_n_per_m * (held_m - held_m.clamp(-self.half_gap_m, self.half_gap_m));
        let friction_n = self.friction.at_n(load_n);
        let (low_n, high_n) = (load_n - friction_n, load_n + friction_n);
        if held_n >= low_n && held_n <= high_n {
            let touching = held_n * before.coupling.force_n > 0.0;
            let Coupling { by_dry, by_share_n, .. } = before.coupling;
            let (by_dry, by_share_n) = if touching { (by_dry, by_share_n) } else { (0.0, 0.0) };
            return (held_m, Coupling { force_n: held_n, by_dry, by_share_n });
        }
        let (force_n, by_dry) = if held_n < low_n { (low_n, -1.0) } else { (high_n, 1.0) };
        (self.relative_m(force_n), Coupling { force_n, by_dry, by_share_n: by_dry * load_n.abs() })
    }

    /// Where the screw stands against the motor under a force, m.
    #[inline]
    fn relative_m(&self, force_n: f64) -> f64 {
        let side = if force_n == 0.0 { 0.0 } else { force_n.signum() };
        force_n * self.compliance_m_per_n + self.half_gap_m * side
    }
}
