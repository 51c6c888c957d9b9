//! Quasi-static stick–slip model of the force in the coupling (equation 1, corrected).
//!
//! The screw slips when the force on it exceeds the friction level; otherwise it is held. While it is held, bristles of
//! compliance a bend under the friction force (pre-sliding displacement; Dahl 1968, Canudas de Wit et al. 1995).
//! One step, with w the anchor of the bristles relative to the motor and F the load less the zero of its cell:
//!
//! ```text
//! w ← w − ΔX₁                                   the motor moves under a held screw
//! c ← dead_zone(w + a·F, ΔS) / (1/K + a)        force in the coupling while the screw is held
//! c ← clamp(c, F − F_f, F + F_f)                the screw slips as far as the friction level asks
//! F_f = (F_d + η·|F|)·(1 + p·e^−(v/v_s)²)       v_s = 3 mm/s (Stribeck effect)
//! ```
//! A moving screw has c = F − F_f·sgn Ẋ₂, and a resting one keeps its c. When the load changes while the motor rests, c
//! follows a loop that a model by the sign of the motor's speed would miss.

/// Dry friction of the screw and the share of the load that is lost (equation 1).
#[derive(Debug, Clone, Copy, Default, PartialEq)]
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
}

/// Parameters of the screw, its coupling and the channels that the regression iterates over.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct FrictionState {
    pub(crate) stiffness_n_per_m: f64,
    pub(crate) gap_m: f64,
    pub(crate) friction: Friction,
    /// p, the excess of the friction level at rest over that in motion.
    pub(crate) stribeck: f64,
    /// a, compliance of the bristles, m/N; zero for a screw that is held rigidly.
    pub(crate) bristle_m_per_n: f64,
    /// F₀, reading of the load cell under no load, N.
    pub(crate) load_zero_n: f64,
    /// τ in `load_logged(t) = F(t − τ)`, s.
    pub(crate) load_delay_s: f64,
    /// τ in `screw_logged(t) = X₂(t − τ)`, s.
    pub(crate) skew_s: f64,
}

/// The coupling at one block: its force, the derivatives of the force by the friction parameters, and its position.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Coupling {
    /// c, N; NaN where a channel is missing.
    pub(crate) force_n: f64,
    /// ∂c/∂F_d.
    pub(crate) dforce_ddry: f64,
    /// ∂c/∂η, N.
    pub(crate) dforce_dloss_n: f64,
    /// ∂c/∂p, N.
    pub(crate) dforce_dstribeck_n: f64,
    /// Relative position from the middle of the gap, m; NaN where a channel is missing.
    pub(crate) relative_m: f64,
}

impl Coupling {
    /// Where a channel is missing.
    pub(crate) const UNKNOWN: Self = Self {
        force_n: f64::NAN,
        dforce_ddry: 0.0,
        dforce_dloss_n: 0.0,
        dforce_dstribeck_n: 0.0,
        relative_m: f64::NAN,
    };
}

/// One block of the channels that drive the model.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Drive {
    pub(crate) motor_m: f64,
    pub(crate) load_n: f64,
    /// e^−(v/v_s)².
    pub(crate) slowness: f64,
}

/// Constants of an integration.
#[derive(Debug, Clone, Copy)]
pub(crate) struct CouplingParams {
    state: FrictionState,
    compliance_m_per_n: f64,
    /// 1/(1/K + a).
    held_n_per_m: f64,
    half_gap_m: f64,
    motor_sense: f64,
}

/// The screw between two blocks.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ScrewState {
    pub(crate) motor_m: f64,
    /// w: anchor of the bristles relative to the motor, from the middle of the gap, m.
    pub(crate) anchor_m: f64,
    /// ∂c/∂F_d, ∂c/∂η and ∂c/∂p once the screw presses a flank, kept since it slipped last.
    pub(crate) memory: [f64; 3],
    pub(crate) coupling: Coupling,
    /// Whether it slipped in this block, so that no earlier state matters.
    pub(crate) has_slipped: bool,
}

#[allow(clippy::inline_always, reason = "compiled within each version of its caller")]
impl CouplingParams {
    pub(crate) fn new(state: &FrictionState, motor_sense: f64) -> Self {
        let compliance_m_per_n = state.stiffness_n_per_m.recip();
        Self {
            state: *state,
            compliance_m_per_n,
            held_n_per_m: (compliance_m_per_n + state.bristle_m_per_n).recip(),
            half_gap_m: 0.5 * state.gap_m,
            motor_sense,
        }
    }

    /// The screw a block later. Both the held and the slipping solution are computed and one is selected, so that
    /// several screws can be integrated in parallel lanes.
    #[inline(always)]
    pub(crate) fn step(&self, before: &ScrewState, drive: Drive) -> ScrewState {
        let load_n = drive.load_n - self.state.load_zero_n;
        let anchor_m = before.anchor_m - self.motor_sense * (drive.motor_m - before.motor_m);
        let free_m = anchor_m + self.state.bristle_m_per_n * load_n;
        let above_m = if free_m < -self.half_gap_m { -self.half_gap_m } else { free_m };
        let inside_m = if above_m > self.half_gap_m { self.half_gap_m } else { above_m };
        let held_n = self.held_n_per_m * (free_m - inside_m);
        let size_n = load_n.abs();
        let level_n = self.state.friction.at_n(load_n);
        let excess = 1.0 + self.state.stribeck * drive.slowness;
        let friction_n = level_n * excess;
        let (low_n, high_n) = (load_n - friction_n, load_n + friction_n);
        let (is_low, is_high) = (held_n < low_n, held_n > high_n);
        let has_slipped = is_low | is_high;
        let force_n = if is_low { low_n } else { held_n };
        let force_n = if is_high { high_n } else { force_n };
        let way = if is_low { -1.0 } else { 1.0 };
        let touch = if force_n == 0.0 { 0.0 } else { 1.0 };
        let slipping = [way * excess, way * size_n * excess, way * level_n * drive.slowness];
        let mut memory = before.memory;
        for (kept, now) in memory.iter_mut().zip(slipping) {
            *kept = if has_slipped { now } else { *kept };
        }
        let bent_m = self.state.bristle_m_per_n * (load_n - force_n);
        let relative_m = if has_slipped { self.relative_m(force_n) } else { anchor_m + bent_m };
        ScrewState {
            motor_m: drive.motor_m,
            anchor_m: if has_slipped { relative_m - bent_m } else { anchor_m },
            memory,
            coupling: Coupling {
                force_n,
                dforce_ddry: touch * memory[0],
                dforce_dloss_n: touch * memory[1],
                dforce_dstribeck_n: touch * memory[2],
                relative_m,
            },
            has_slipped,
        }
    }

    /// Takes a screw, if there is one yet, to the next block, and returns the coupling there. A block with a missing channel
    /// is skipped.
    #[inline]
    pub(crate) fn follow(&self, screw: &mut Option<ScrewState>, drive: Drive) -> Coupling {
        if !(drive.motor_m + drive.load_n).is_finite() {
            return Coupling::UNKNOWN;
        }
        let next = screw.map_or_else(|| self.rest(drive), |before| self.step(&before, drive));
        *screw = Some(next);
        next.coupling
    }

    /// The screw at the start of a segment: at rest, its friction unknown.
    fn rest(&self, drive: Drive) -> ScrewState {
        let force_n = drive.load_n - self.state.load_zero_n;
        let relative_m = self.relative_m(force_n);
        ScrewState {
            motor_m: drive.motor_m,
            anchor_m: relative_m,
            memory: [0.0; 3],
            coupling: Coupling { force_n, relative_m, ..Coupling::UNKNOWN },
            has_slipped: false,
        }
    }

    /// Relative position on a flank under a force, m.
    #[inline(always)]
    fn relative_m(&self, force_n: f64) -> f64 {
        let above_m = if force_n > 0.0 { self.half_gap_m } else { 0.0 };
        let flank_m = if force_n < 0.0 { -self.half_gap_m } else { above_m };
        force_n * self.compliance_m_per_n + flank_m
    }
}
