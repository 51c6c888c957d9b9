//! Friction of equation 1, set-valued at rest, and laws that depart from it on purpose.
//!
//! ```text
//! F_f = F_v Ẋ + sign(Ẋ) (F_dry + η |F_l|)                                             (1)
//! ```
//! At rest, sign(·) is any value from −1 to 1: friction holds a stopped mass against any force up to the level in
//! brackets. No tanh smooths the sign, so a held mass does not creep.
#![expect(missing_docs, reason = "docs/simulator.md explains each key")]

use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;

/// The parameters of equation 1 for one mass, and of departures from it. Without any key there is no friction.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, SmartDefault)]
#[serde(deny_unknown_fields, default)]
pub struct Friction {
    pub dry_n: f64,
    pub load_share: f64,
    pub viscous_n_s_per_m: f64,
    pub backdriven_load_share: Option<f64>,
    pub asymmetry: f64,
    pub grease_n: f64,
    #[default(2e-3)]
    pub grease_m_per_s: f64,
    #[default(1.0)]
    pub cold_factor: f64,
    #[default(300.0)]
    pub warm_up_s: f64,
}

/// The level of dry friction against motion along either direction, N.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Levels {
    /// Against motion along +X.
    pub(crate) up_n: f64,
    /// Against motion along −X.
    pub(crate) down_n: f64,
}

impl Friction {
    /// Friction of equation 1 without departures.
    pub fn new(dry_n: f64, load_share: f64, viscous_n_s_per_m: f64) -> Self {
        Self { dry_n, load_share, viscous_n_s_per_m, ..Self::default() }
    }

    /// The same friction, dry and load-dependent parts times a factor.
    pub(crate) fn scaled(self, factor: f64) -> Self {
        let backdriven_load_share = self.backdriven_load_share.map(|share| share * factor);
        let (dry_n, load_share) = (self.dry_n * factor, self.load_share * factor);
        Self { dry_n, load_share, backdriven_load_share, ..self }
    }

    /// Whether viscous and grease drag change during a log.
    pub(crate) fn is_warming(&self) -> bool {
        (self.cold_factor - 1.0).abs() > 0.0
    }

    /// The friction at a time of the log, seconds.
    pub(crate) fn at(self, time_s: f64) -> Self {
        if !self.is_warming() {
            return self;
        }
        let drag = 1.0 + (self.cold_factor - 1.0) * (-time_s.max(0.0) / self.warm_up_s).exp();
        Self { viscous_n_s_per_m: self.viscous_n_s_per_m * drag, grease_n: self.grease_n * drag, ..self }
    }

    /// Drag over speed at a speed, N·s/m: viscous friction and the grease film.
    pub(crate) fn drag_n_s_per_m(&self, speed_m_per_s: f64) -> f64 {
        if self.grease_n == 0.0 {
            return self.viscous_n_s_per_m;
        }
        let u = speed_m_per_s / self.grease_m_per_s;
        self.viscous_n_s_per_m + 2.0 * self.grease_n / self.grease_m_per_s / (1.0 + u * u)
    }

    pub(crate) fn sliding(&self, load_n: f64) -> Levels {
        // The load drives motion along its own sign.
        let driven = self.backdriven_load_share.unwrap_or(self.load_share);
        let (up, down) = if load_n > 0.0 { (driven, self.load_share) } else { (self.load_share, driven) };
        let level_n = |share: f64, factor: f64| factor * (self.dry_n + share * load_n.abs());
        Levels { up_n: level_n(up, 1.0 + self.asymmetry), down_n: level_n(down, 1.0 - self.asymmetry) }
    }
}

/// Dependence of dry friction on speed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum FrictionLaw {
    /// Independent of speed, as in equation 1.
    #[default]
    Coulomb,
    /// The level is `ratio` times higher at rest and falls with speed as `exp(−(v/speed)²)`.
    Stribeck { ratio: f64, speed_m_per_s: f64 },
    /// Bristles that bend before they slide (Dahl's equation, the elastic heart of `LuGre`):
    /// `ṡ = (v − |v| s)/travel`, friction = level · s.
    Presliding { travel_m: f64 },
    /// The `LuGre` law: bristles of stiffness `level/travel` and a Stribeck curve g(v),
    /// `ż = v − |v| z/(g(v)/stiffness)`, friction = stiffness · z + damping · ż.
    LuGre { travel_m: f64, ratio: f64, speed_m_per_s: f64, damping_n_s_per_m: f64 },
}

impl FrictionLaw {
    /// The law as `LuGre`'s parameters: break-away ratio, Stribeck speed, and the bristles' travel and damping, if any.
    fn parameters(&self) -> (f64, f64, Option<(f64, f64)>) {
        match *self {
            Self::Coulomb => (1.0, 1.0, None),
            Self::Stribeck { ratio, speed_m_per_s } => (ratio, speed_m_per_s, None),
            Self::Presliding { travel_m } => (1.0, 1.0, Some((travel_m, 0.0))),
            Self::LuGre { travel_m, ratio, speed_m_per_s, damping_n_s_per_m } => {
                (ratio, speed_m_per_s, Some((travel_m, damping_n_s_per_m)))
            }
        }
    }

    /// One mass under friction during a step.
    ///
    /// `inertia_n_s_per_m` is twice the mass over the step, `bend` the bend of the bristles before the step.
    pub(crate) fn body(
        &self,
        friction: &Friction,
        load_n: f64,
        speed_m_per_s: f64,
        bend: f64,
        inertia_n_s_per_m: f64,
        step_s: f64,
    ) -> FrictionBody {
        let sliding = friction.sliding(load_n);
        let (ratio, knee_m_per_s, bristle) = self.parameters();
        let stribeck = || 1.0 + (ratio - 1.0) * (-(speed_m_per_s / knee_m_per_s).powi(2)).exp();
        let lift = if ratio > 1.0 { stribeck() } else { 1.0 };
        FrictionBody {
            inertia_n_s_per_m: inertia_n_s_per_m + friction.drag_n_s_per_m(speed_m_per_s),
            levels: Levels { up_n: sliding.up_n * lift, down_n: sliding.down_n * lift },
            bristle: bristle.map(|(travel_m, damping)| Bristle {
                bend,
                rate_s_per_m: step_s / travel_m,
                base_n: 0.5 * (sliding.up_n + sliding.down_n),
                damping_n: damping * travel_m / step_s,
            }),
        }
    }
}

/// One mass during one step: `mass · v + friction(v) = push`, to be solved for the mean speed v.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FrictionBody {
    /// Everything linear in v: twice the mass over the step, plus viscous friction, N·s/m.
    inertia_n_s_per_m: f64,
    levels: Levels,
    bristle: Option<Bristle>,
}

/// The bristles before a step; their force is `base · bend`, and `base · bend` may reach the level.
#[derive(Debug, Clone, Copy)]
struct Bristle {
    bend: f64,
    /// Step over travel.
    rate_s_per_m: f64,
    base_n: f64,
    /// Damping times travel over step: force for each unit of change of the bend.
    damping_n: f64,
}

impl Bristle {
    /// The bristles with their bend relative to the friction level of one direction, and this level over the base.
    fn up_to(&self, level_n: f64) -> (Self, f64) {
        let lift = if self.base_n > 0.0 { level_n / self.base_n } else { 1.0 };
        let (bend, rate_s_per_m) = (self.bend / lift, self.rate_s_per_m / lift);
        (Self { bend, rate_s_per_m, base_n: level_n, damping_n: self.damping_n * lift }, lift)
    }
}

impl FrictionBody {
    /// The mean speed under a force, m/s, and its derivative by the force; both are zero if friction holds the mass.
    pub(crate) fn mean_velocity(&self, push_n: f64) -> (f64, f64) {
        if let Some(bristle) = &self.bristle {
            return self.slide(push_n, bristle);
        }
        if push_n <= self.levels.up_n && push_n >= -self.levels.down_n {
            return (0.0, 0.0);
        }
        let free_n = if push_n > 0.0 { push_n - self.levels.up_n } else { push_n + self.levels.down_n };
        (free_n / self.inertia_n_s_per_m, 1.0 / self.inertia_n_s_per_m)
    }

    fn level_n(&self, is_down: bool) -> f64 {
        if is_down { self.levels.down_n } else { self.levels.up_n }
    }

    /// With `e′ = (e + r v)/(1 + r|v|)` and friction `level · e′ + damping (e′ − e)` the balance is a
    /// quadratic in v on the side the push points to.
    fn slide(&self, push_n: f64, bristle: &Bristle) -> (f64, f64) {
        let free_n = push_n - bristle.base_n * bristle.bend;
        let side = if free_n < 0.0 { -1.0 } else { 1.0 };
        let (bending, _) = bristle.up_to(self.level_n(free_n < 0.0));
        let (a, e, rate) = (self.inertia_n_s_per_m, bending.bend * side, bending.rate_s_per_m);
        let level_n = bending.base_n + bending.damping_n;
        let b = push_n * side + bending.damping_n * e;
        let linear = a + (level_n - b) * rate;
        let root = (linear * linear + 4.0 * a * rate * free_n.abs()).sqrt();
        let speed = if linear > 0.0 {
            2.0 * free_n.abs() / (linear + root)
        } else {
            (root - linear) / (2.0 * a * rate)
        };
        let stiffening = level_n * rate * (1.0 - e) / (1.0 + rate * speed).powi(2);
        (side * speed, 1.0 / (a + stiffening))
    }

    /// The bend of the bristles after a step at a mean speed.
    pub(crate) fn bristle_update(&self, speed_m_per_s: f64) -> f64 {
        let Some(bristle) = &self.bristle else { return 0.0 };
        let (Bristle { bend, rate_s_per_m: r, .. }, lift) = bristle.up_to(self.level_n(speed_m_per_s < 0.0));
        lift * ((bend + r * speed_m_per_s) / (1.0 + r * speed_m_per_s.abs()))
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "these values are exact")]
mod tests {
    use super::*;

    /// A mass of 2·10³ N·s/m times half a step.
    fn body(law: FrictionLaw, friction: &Friction, load_n: f64, speed: f64, bend: f64) -> FrictionBody {
        law.body(friction, load_n, speed, bend, 50.0, 1e-4)
    }

    #[test]
    fn a_push_below_the_level_moves_nothing_and_one_above_moves_by_the_excess() {
        let body = FrictionLaw::Coulomb.body(&Friction::new(10.0, 0.0, 0.0), 0.0, 0.0, 0.0, 2.0, 1e-4);
        assert_eq!(body.mean_velocity(9.9), (0.0, 0.0));
        assert_eq!(body.mean_velocity(-14.0), (-2.0, 0.5));
    }

    #[test]
    fn stribeck_holds_more_than_it_drags() {
        let friction = Friction::new(100.0, 0.1, 0.0);
        let law = FrictionLaw::Stribeck { ratio: 1.5, speed_m_per_s: 1e-3 };
        assert_eq!(body(law, &friction, -1000.0, 0.0, 0.0).levels.up_n, 300.0);
        assert!((body(law, &friction, -1000.0, 1.0, 0.0).levels.down_n - 200.0).abs() < 1e-9);
    }

    /// A screw that loses 10 % when it drives and 4 % when it is driven, under 1 kN along +X.
    #[test]
    fn friction_depends_on_the_direction_of_power_and_of_motion() {
        let friction = Friction { backdriven_load_share: Some(0.04), ..Friction::new(50.0, 0.1, 0.0) };
        assert_eq!(friction.sliding(1000.0), Levels { up_n: 90.0, down_n: 150.0 });
        assert_eq!(friction.sliding(-1000.0), Levels { up_n: 150.0, down_n: 90.0 });
        let lopsided = Friction { asymmetry: 0.2, ..Friction::new(50.0, 0.1, 0.0) };
        assert_eq!(lopsided.sliding(500.0), Levels { up_n: 120.0, down_n: 80.0 });
        let body = body(FrictionLaw::Coulomb, &lopsided, 500.0, 0.0, 0.0);
        assert_eq!((body.mean_velocity(119.0).0, body.mean_velocity(-90.0).0), (0.0, -10.0 / 50.0));
    }

    #[test]
    fn a_grease_film_drags_most_at_its_speed_and_less_when_warm() {
        let film = Friction { grease_n: 80.0, grease_m_per_s: 1e-3, ..Friction::new(0.0, 0.0, 0.0) };
        let drag_n = |v: f64| v * film.drag_n_s_per_m(v);
        assert!((drag_n(1e-3) - 80.0).abs() < 1e-9 && (drag_n(2e-3) - 64.0).abs() < 1e-9);
        let cold = Friction { cold_factor: 3.0, warm_up_s: 100.0, ..film };
        let expected = 80.0 * (1.0 + 2.0 * (-1.0_f64).exp());
        assert!((cold.at(100.0).grease_n - expected).abs() < 1e-9 && film.at(0.0) == film);
    }

    /// The solution is put back into the balance it should solve.
    #[test]
    fn bent_bristles_balance_the_push() {
        let friction = Friction { asymmetry: 0.3, ..Friction::new(10.0, 0.0, 0.0) };
        let lu_gre =
            FrictionLaw::LuGre { travel_m: 5e-6, ratio: 1.4, speed_m_per_s: 2e-3, damping_n_s_per_m: 90.0 };
        for law in [FrictionLaw::Presliding { travel_m: 5e-6 }, lu_gre] {
            for (push_n, bend) in [(3.0, 0.0), (12.0, 0.9), (-7.0, 0.5), (500.0, 0.2), (-500.0, 1.0)] {
                let body = body(law, &friction, 0.0, 1e-3, bend);
                let (speed, _) = body.mean_velocity(push_n);
                let after = body.bristle_update(speed);
                let damping_n = if law == lu_gre { 90.0 * 5e-6 / 1e-4 * (after - bend) } else { 0.0 };
                let balance = 50.0 * speed + 10.0 * after + damping_n;
                assert!((balance - push_n).abs() < 1e-9, "{balance} for {push_n} under {law:?}");
            }
        }
    }

    /// Slid far at one speed, the bristles of `LuGre` carry the Stribeck curve at that speed.
    #[test]
    fn lu_gre_slides_on_its_stribeck_curve() {
        let law =
            FrictionLaw::LuGre { travel_m: 5e-6, ratio: 1.6, speed_m_per_s: 2e-3, damping_n_s_per_m: 100.0 };
        let friction = Friction::new(100.0, 0.0, 0.0);
        for speed in [5e-4, 2e-3, -1e-2] {
            let mut bend = 0.0;
            for _ in 0..4000 {
                bend = law.body(&friction, 0.0, speed, bend, 50.0, 1e-4).bristle_update(speed);
            }
            let curve: f64 = 1.0 + 0.6 * (-(speed / 2e-3_f64).powi(2)).exp();
            assert!((bend / curve.copysign(speed) - 1.0).abs() < 1e-9, "{bend} at {speed}");
        }
    }
}
