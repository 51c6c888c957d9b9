//! Friction of equation 1, set-valued at rest, and two laws that depart from it on purpose.
//!
//! ```text
//! F_f = F_v Ẋ + sign(Ẋ) (F_dry + η |F_l|)                                             (1)
//! ```
//! sign(·) is a set at rest: a stopped mass holds any push up to the level in brackets. Nothing is
//! smeared by a tanh, so a held mass does not creep.

use serde::{Deserialize, Serialize};

use crate::error::{Error, not_negative, positive, within};

/// The parameters of equation 1 for one mass.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Friction {
    /// `F_dry`, N.
    pub dry_n: f64,
    /// η: the share of the load that is lost, about one minus the efficiency.
    pub load_share: f64,
    /// `F_v`, N·s/m.
    pub viscous_n_s_per_m: f64,
}

impl Friction {
    /// The same friction, dry and load-dependent parts times a factor.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        Self { dry_n: self.dry_n * factor, load_share: self.load_share * factor, ..self }
    }

    pub(crate) fn check(&self, key: &str) -> Result<(), Error> {
        not_negative(&format!("{key}.dry_n"), self.dry_n)?;
        within(&format!("{key}.load_share"), self.load_share, 0.0, 1.0, "between 0 and 1")?;
        not_negative(&format!("{key}.viscous_n_s_per_m"), self.viscous_n_s_per_m)
    }
}

/// How the dry part answers to speed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Law {
    /// Equation 1 as it stands.
    #[default]
    Coulomb,
    /// The level is `ratio` times higher at rest and falls with speed as `exp(−(v/speed)²)`.
    Stribeck {
        /// Break-away level over sliding level, 1 or more.
        ratio: f64,
        /// The speed at which most of the difference is gone, m/s.
        speed_m_per_s: f64,
    },
    /// Bristles that bend before they slide (Dahl's equation, the elastic heart of `LuGre`):
    /// `ṡ = (v − |v| s)/travel`, friction = level · s.
    Presliding {
        /// The travel over which the bristles bend, metres.
        travel_m: f64,
    },
}

impl Law {
    pub(crate) fn check(&self) -> Result<(), Error> {
        match *self {
            Self::Coulomb => Ok(()),
            Self::Stribeck { ratio, speed_m_per_s } => {
                within("friction_law.stribeck.ratio", ratio, 1.0, 10.0, "between 1 and 10")?;
                positive("friction_law.stribeck.speed_m_per_s", speed_m_per_s)
            }
            Self::Presliding { travel_m } => positive("friction_law.presliding.travel_m", travel_m),
        }
    }

    /// The dry level in force during a step that starts at the speed given, N.
    pub(crate) fn level_n(&self, friction: &Friction, load_n: f64, speed_m_per_s: f64) -> f64 {
        let sliding_n = friction.dry_n + friction.load_share * load_n.abs();
        match *self {
            Self::Stribeck { ratio, speed_m_per_s: knee } => {
                sliding_n * (1.0 + (ratio - 1.0) * (-(speed_m_per_s / knee).powi(2)).exp())
            }
            Self::Coulomb | Self::Presliding { .. } => sliding_n,
        }
    }
}

/// One mass during one step: `mass · v + friction(v) = push`, to be solved for the mean speed v.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Body {
    /// Everything linear in v: twice the mass over the step, plus viscous friction, N·s/m.
    pub(crate) inertia_n_s_per_m: f64,
    /// The dry level, N.
    pub(crate) level_n: f64,
    /// Bend of the bristles before the step, −1 to 1, and step over travel, s/m; none without bristles.
    pub(crate) bristle: Option<(f64, f64)>,
}

impl Body {
    /// The mean speed under a push, m/s, and its derivative by the push; exactly zero when held.
    pub(crate) fn respond(&self, push_n: f64) -> (f64, f64) {
        if let Some((bend, rate)) = self.bristle {
            return self.bend(push_n, bend, rate);
        }
        if push_n.abs() <= self.level_n {
            return (0.0, 0.0);
        }
        let free_n = push_n - self.level_n.copysign(push_n);
        (free_n / self.inertia_n_s_per_m, 1.0 / self.inertia_n_s_per_m)
    }

    /// With `s′ = (s + r v)/(1 + r|v|)` the balance is a quadratic in v on the side the push points to.
    fn bend(&self, push_n: f64, bend: f64, rate: f64) -> (f64, f64) {
        let free_n = push_n - self.level_n * bend;
        let side = if free_n < 0.0 { -1.0 } else { 1.0 };
        let (a, b, s) = (self.inertia_n_s_per_m, push_n * side, bend * side);
        let linear = a + (self.level_n - b) * rate;
        let root = (linear * linear + 4.0 * a * rate * free_n.abs()).sqrt();
        let speed = if linear > 0.0 {
            2.0 * free_n.abs() / (linear + root)
        } else {
            (root - linear) / (2.0 * a * rate)
        };
        let stiffening = self.level_n * rate * (1.0 - s) / (1.0 + rate * speed).powi(2);
        (side * speed, 1.0 / (a + stiffening))
    }

    /// The bend of the bristles after a step at a mean speed.
    pub(crate) fn bent(&self, speed_m_per_s: f64) -> f64 {
        let bend = |(s, r): (f64, f64)| (s + r * speed_m_per_s) / (1.0 + r * speed_m_per_s.abs());
        self.bristle.map_or(0.0, bend)
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "these values are exact")]
mod tests {
    use super::*;

    #[test]
    fn a_push_below_the_level_moves_nothing_and_one_above_moves_by_the_excess() {
        let body = Body { inertia_n_s_per_m: 2.0, level_n: 10.0, bristle: None };
        assert_eq!(body.respond(9.9), (0.0, 0.0));
        assert_eq!(body.respond(-14.0), (-2.0, 0.5));
    }

    #[test]
    fn stribeck_holds_more_than_it_drags() {
        let friction = Friction { dry_n: 100.0, load_share: 0.1, viscous_n_s_per_m: 0.0 };
        let law = Law::Stribeck { ratio: 1.5, speed_m_per_s: 1e-3 };
        assert_eq!(law.level_n(&friction, -1000.0, 0.0), 300.0);
        assert!((law.level_n(&friction, -1000.0, 1.0) - 200.0).abs() < 1e-9);
    }

    /// The solution is put back into the balance it should solve.
    #[test]
    fn bent_bristles_balance_the_push() {
        for (push_n, bend) in [(3.0, 0.0), (12.0, 0.9), (-7.0, 0.5), (500.0, 0.2), (-500.0, 1.0)] {
            let body = Body { inertia_n_s_per_m: 50.0, level_n: 10.0, bristle: Some((bend, 20.0)) };
            let (speed, _) = body.respond(push_n);
            let balance = 50.0 * speed + 10.0 * body.bent(speed);
            assert!((balance - push_n).abs() < 1e-9, "{balance} for {push_n}");
        }
    }
}
