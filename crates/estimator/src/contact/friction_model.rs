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
pub(super) struct FrictionState {
    pub(super) stiffness_n_per_m: f64,
    pub(super) gap_m: f64,
    pub(super) friction: Friction,
    pub(super) skew_s: f64,
}

/// Force in the coupling, and how it answers to friction.
#[derive(Debug, Clone, Copy)]
pub(super) struct CouplingForce {
    /// c, N; NaN where a channel is missing.
    pub(super) force_n: f64,
    /// ∂c/∂F_d.
    pub(super) by_dry: f64,
    /// ∂c/∂η, N.
    pub(super) by_share_n: f64,
}

impl CouplingForce {
    /// Where a channel is missing.
    pub(super) const UNKNOWN: Self = Self { force_n: f64::NAN, by_dry: 0.0, by_share_n: 0.0 };
}

/// What a walk's steps depend on.
#[derive(Debug, Clone, Copy)]
pub(super) struct CouplingParams {
    stiffness_n_per_m: f64,
    compliance_m_per_n: f64,
    half_gap_m: f64,
    friction: Friction,
}

/// The coupling followed from block to block; each segment starts at rest, its friction unknown.
#[derive(Debug)]
pub(super) struct CouplingIntegrator {
    ways: CouplingParams,
    screw: Option<ScrewState>,
}

/// The screw between two blocks.
#[derive(Debug, Clone, Copy)]
pub(super) struct ScrewState {
    pub(super) motor_m: f64,
    /// Relative position from the middle of the gap, m.
    pub(super) relative_m: f64,
    pub(super) coupling: CouplingForce,
    /// Whether it slipped last, so that nothing before tells what comes after.
    pub(super) has_slipped: bool,
}

impl CouplingParams {
    pub(super) fn new(state: &FrictionState) -> Self {
        Self {
            stiffness_n_per_m: state.stiffness_n_per_m,
            compliance_m_per_n: state.stiffness_n_per_m.recip(),
            half_gap_m: 0.5 * state.gap_m,
            friction: state.friction,
        }
    }

    /// The screw a block later. Both what holds and what slips is found, and one of the two taken: so that it can be
    /// asked of several at once.
    #[inline(always)]
    #[allow(clippy::inline_always, reason = "see `widest`")]
    pub(super) fn moved(&self, before: &ScrewState, motor_m: f64, load_n: f64) -> ScrewState {
        let held_m = before.relative_m - (motor_m - before.motor_m);
        let above_m = if held_m < -self.half_gap_m { -self.half_gap_m } else { held_m };
        let free_m = if above_m > self.half_gap_m { self.half_gap_m } else { above_m };
        let held_n = self.stiffness_n_per_m * (held_m - free_m);
        let friction_n = self.friction.at_n(load_n);
        let (low_n, high_n) = (load_n - friction_n, load_n + friction_n);
        let (is_low, is_high) = (held_n < low_n, held_n > high_n);
        let has_slipped = is_low | is_high;
        let force_n = if is_low { low_n } else { held_n };
        let force_n = if is_high { high_n } else { force_n };
        let way = if is_low { -1.0 } else { 1.0 };
        let is_touching = held_n * before.coupling.force_n > 0.0;
        let held_by_dry = if is_touching { before.coupling.by_dry } else { 0.0 };
        let held_by_share_n = if is_touching { before.coupling.by_share_n } else { 0.0 };
        ScrewState {
            motor_m,
            relative_m: if has_slipped { self.relative_m(force_n) } else { held_m },
            coupling: CouplingForce {
                force_n,
                by_dry: if has_slipped { way } else { held_by_dry },
                by_share_n: if has_slipped { way * load_n.abs() } else { held_by_share_n },
            },
            has_slipped,
        }
    }

    /// Where the screw stands against the motor under a force, m.
    #[inline(always)]
    #[allow(clippy::inline_always, reason = "see `widest`")]
    fn relative_m(&self, force_n: f64) -> f64 {
        let above_m = if force_n > 0.0 { self.half_gap_m } else { 0.0 };
        let flank_m = if force_n < 0.0 { -self.half_gap_m } else { above_m };
        force_n * self.compliance_m_per_n + flank_m
    }
}

impl CouplingIntegrator {
    /// At rest, where nothing is known of the friction.
    pub(super) fn new(ways: CouplingParams) -> Self {
        Self { ways, screw: None }
    }

    /// Whether the screw slipped last.
    pub(super) fn has_slipped(&self) -> bool {
        self.screw.is_some_and(|screw| screw.has_slipped)
    }

    /// Goes on from elsewhere.
    pub(super) fn set(&mut self, screw: ScrewState) {
        self.screw = Some(screw);
    }

    /// The coupling at the next block. One with a channel missing is passed over.
    #[inline]
    pub(super) fn step(&mut self, motor_m: f64, load_n: f64) -> CouplingForce {
        if !(motor_m + load_n).is_finite() {
            return CouplingForce::UNKNOWN;
        }
        let screw = self.screw.map_or_else(
            || ScrewState {
                motor_m,
                relative_m: self.ways.relative_m(load_n),
                coupling: CouplingForce { force_n: load_n, by_dry: 0.0, by_share_n: 0.0 },
                has_slipped: false,
            },
            |before| self.ways.moved(&before, motor_m, load_n),
        );
        self.screw = Some(screw);
        screw.coupling
    }
}
