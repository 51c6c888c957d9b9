//! The bank of wear laws: how far a gap has grown at an age, whatever its size.
//!
//! ```text
//! gap(u) = N + A · F(u + a)     N gap when new, A amplitude, a age at first sight, u usage since
//!
//! power        F(t) = (t/1000)^p            p = ½ … 3
//! exponential  F(t) = e^(t/τ) − 1
//! settling     F(t) = 1 − e^(−t/τ)
//! onset        F(t) = max(0, t − o)/1000    flat, then a line
//! stages       F(t) = G(t/T)                the rate changes at a share of the life T
//! none         F(t) = 0
//! ```
//! Ages are hours, or another usage converted to hours by the part number's mean. Each law is parametrised by its
//! *life*: the age T at which it has grown by a given span, so A = span/F(T).
//!
//! A power or an exponential has no change of rate to come. Stages separate a fleet whose units all wear out late from
//! one whose units do not: the share of each is learned, and a unit that still wears evenly is forecast from the others.

use std::sync::LazyLock;

/// Age that a power law's amplitude refers to, hours.
const REFERENCE_HOURS: f64 = 1000.0;

const EXPONENTS: [f64; 14] =
    [0.5, 0.625, 0.75, 0.875, 1.0, 1.125, 1.25, 1.5, 1.75, 2.0, 2.25, 2.5, 2.75, 3.0];

/// The exponent of wear in proportion to usage.
const LINEAR: usize = 4;

/// Geometric grids of time constants and lives: first, hours, ratio, and count.
const EXPONENTIAL: Grid = Grid { first_hours: 250.0, ratio: 1.4235, count: 10 };
const SETTLING: Grid = Grid { first_hours: 900.0, ratio: 1.771, count: 4 };
const LIVES: Grid = Grid { first_hours: 600.0, ratio: 1.35, count: 10 };

/// Ages at first sight, hours; of stages every other one.
const AGES: [f64; 14] =
    [0.0, 75.0, 150.0, 250.0, 400.0, 600.0, 850.0, 1150.0, 1500.0, 2000.0, 2600.0, 3400.0, 4500.0, 6000.0];
const STAGES_AGE_STRIDE: usize = 2;

/// Growth at shares of a life: running in and wearing out, early and late; slow, fast, slow; steady and then away; a line
/// and then one of two and a half times its rate.
const STAGES: [fn(f64) -> f64; 5] = [
    |t| 0.4 * t.sqrt() + 0.6 * t.powi(4),
    |t| 0.25 * t.sqrt() + 0.75 * t.powi(4),
    |t| t * t * (3.0 - 2.0 * t),
    |t| 0.25 * t + 0.75 * t.powi(5),
    |t| 0.56 * t + 0.88 * (t - 0.5).max(0.0),
];

/// The same at every tenth of the life; in lines between them, and further on.
static STAGE_HEIGHTS: LazyLock<[[f64; TENTHS + 1]; STAGES.len()]> =
    LazyLock::new(|| STAGES.map(|growth| std::array::from_fn(|k| growth(k as f64 / TENTHS as f64))));

const TENTHS: usize = 10;

/// Mean and standard deviation of ln(life / time constant): of the exponential law, and of stages.
const LN_LIFE_OF_EXPONENTIAL: (f64, f64) = (1.1, 0.5);
const LN_LIFE_OF_STAGES: (f64, f64) = (0.0, 0.2);

/// Rate ratio up to which a law is reported as slowing, and from which as accelerating: the exponent of a power, the
/// next tenth's rate over the present one of stages.
const SLOWING: f64 = 0.9;
const ACCELERATING: f64 = 1.2;

/// Number of [`WearLaw::family`] values: every exponent and every form of stages is one, the other laws are one each.
pub(crate) const FAMILIES: usize = FIRST_POWER + EXPONENTS.len();
const FIRST_STAGES: usize = 4;
const FIRST_POWER: usize = FIRST_STAGES + STAGES.len();

struct Grid {
    first_hours: f64,
    ratio: f64,
    count: i32,
}

impl Grid {
    fn hours(&self) -> impl Iterator<Item = f64> {
        (0..self.count).map(|k| self.first_hours * self.ratio.powi(k))
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum WearLaw {
    /// No wear.
    None,
    /// Flat until `start` hours after first sight, then a line.
    Onset { start: f64 },
    /// Ever faster, by this time constant.
    Exponential { hours: f64 },
    /// Ever slower, by this time constant.
    Settling { hours: f64 },
    /// Index into the forms of stages, and the life.
    Stages { index: usize, life_hours: f64 },
    /// Index into the exponents.
    Power { index: usize },
}

/// A law and the age at which its unit was first seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Candidate {
    pub(crate) law: WearLaw,
    /// Age at first sight, hours.
    pub(crate) age: f64,
    /// Logarithm of the cells of the grid that it stands for, in age and in its own parameter.
    pub(crate) ln_cell: f64,
    /// Standard deviation of the height at first sight within the cell of ages.
    pub(crate) age_spread: f64,
    /// Mean and standard deviation of its ln life by its time constant, where the two are related.
    pub(crate) ln_life: Option<(f64, f64)>,
}

/// Class of wear laws that is reported.
#[derive(Debug, Clone, Copy, PartialEq, Eq, strum::Display)]
#[strum(serialize_all = "snake_case")]
pub enum WearClass {
    /// No wear.
    None,
    /// Flat, then a line.
    Onset,
    /// Wear with a falling rate.
    Slowing,
    /// Wear in proportion to usage.
    Linear,
    /// Wear with a rising rate.
    Accelerating,
}

/// Share of each family in a fleet without data.
pub(crate) fn default_shares() -> [f64; FAMILIES] {
    let mut shares = [0.30 / EXPONENTS.len() as f64; FAMILIES];
    shares[FIRST_POWER + LINEAR] += 0.10;
    shares[WearLaw::None.family()] = 0.18;
    shares[WearLaw::Onset { start: 0.0 }.family()] = 0.17;
    shares[WearLaw::Exponential { hours: 0.0 }.family()] = 0.12;
    shares[WearLaw::Settling { hours: 0.0 }.family()] = 0.06;
    shares[FIRST_STAGES..FIRST_POWER].fill(0.07 / STAGES.len() as f64);
    shares
}

impl WearLaw {
    /// The family whose share of a fleet is learned.
    pub(crate) fn family(self) -> usize {
        match self {
            Self::None => 0,
            Self::Onset { .. } => 1,
            Self::Exponential { .. } => 2,
            Self::Settling { .. } => 3,
            Self::Stages { index, .. } => FIRST_STAGES + index,
            Self::Power { index } => FIRST_POWER + index,
        }
    }

    /// F at an age.
    pub(crate) fn value(self, age: f64) -> f64 {
        match self {
            Self::None => 0.0,
            Self::Onset { start } => (age - start).max(0.0) / REFERENCE_HOURS,
            Self::Exponential { hours } => (age / hours).exp_m1(),
            Self::Settling { hours } => -(-age / hours).exp_m1(),
            Self::Stages { index, life_hours } => {
                let (heights, tenths) = (&STAGE_HEIGHTS[index], (age / life_hours).max(0.0) * TENTHS as f64);
                let k = (tenths as usize).min(TENTHS - 1);
                heights[k] + (heights[k + 1] - heights[k]) * (tenths - k as f64)
            }
            Self::Power { index } => ((age / REFERENCE_HOURS).max(0.0).ln() * EXPONENTS[index]).exp(),
        }
    }

    /// dF/dt at an age; at least that of one hour, where a falling rate begins without bound.
    pub(crate) fn derivative(self, age: f64) -> f64 {
        match self {
            Self::None => 0.0,
            Self::Onset { start } => f64::from(u8::from(age >= start)) / REFERENCE_HOURS,
            Self::Exponential { hours } => (age / hours).exp() / hours,
            Self::Settling { hours } => (-age / hours).exp() / hours,
            Self::Stages { index, life_hours } => {
                let tenths = (age / life_hours).max(0.0) * TENTHS as f64;
                let k = (tenths as usize).min(TENTHS - 1);
                (STAGE_HEIGHTS[index][k + 1] - STAGE_HEIGHTS[index][k]) * TENTHS as f64 / life_hours
            }
            Self::Power { index } => EXPONENTS[index] * self.value(age.max(1.0)) / age.max(1.0),
        }
    }

    /// The age at which F is reached.
    pub(crate) fn inverse(self, value: f64) -> f64 {
        match self {
            Self::None => f64::INFINITY,
            Self::Onset { start } => start + value * REFERENCE_HOURS,
            Self::Exponential { hours } => hours * value.ln_1p(),
            Self::Settling { .. } if value >= 1.0 => f64::INFINITY,
            Self::Settling { hours } => -hours * (-value).ln_1p(),
            Self::Stages { index, life_hours } => {
                let heights = &STAGE_HEIGHTS[index];
                let k = heights[1..TENTHS].partition_point(|reached| *reached < value);
                let past = (value - heights[k]) / (heights[k + 1] - heights[k]);
                (k as f64 + past) * life_hours / TENTHS as f64
            }
            Self::Power { index } => REFERENCE_HOURS * value.max(0.0).powf(EXPONENTS[index].recip()),
        }
    }

    /// Growth of the law in a life, hours; the life of an onset begins with its wear.
    pub(crate) fn growth_in(self, life_hours: f64) -> f64 {
        match self {
            Self::Onset { .. } => life_hours / REFERENCE_HOURS,
            _ => self.value(life_hours),
        }
    }

    /// The life in which the law grows by this, hours.
    pub(crate) fn life_of(self, growth: f64) -> f64 {
        match self {
            Self::Onset { .. } => growth * REFERENCE_HOURS,
            _ => self.inverse(growth),
        }
    }

    /// Class that is reported at an age.
    pub(crate) fn class(self, age: f64) -> WearClass {
        let rate_ratio = match self {
            Self::None => return WearClass::None,
            Self::Onset { .. } => return WearClass::Onset,
            Self::Exponential { .. } => f64::INFINITY,
            Self::Settling { .. } => 0.0,
            Self::Stages { life_hours, .. } => {
                self.derivative(age + life_hours / TENTHS as f64) / self.derivative(age)
            }
            Self::Power { index } => EXPONENTS[index],
        };
        match rate_ratio {
            ratio if ratio < SLOWING => WearClass::Slowing,
            ratio if ratio > ACCELERATING => WearClass::Accelerating,
            _ => WearClass::Linear,
        }
    }
}

impl Candidate {
    /// A law whose unit was first seen at an age, which stands for a cell of ages, hours, and for one of its own
    /// parameter.
    fn new(law: WearLaw, age: f64, age_cell: f64, law_cell: f64) -> Self {
        let is_known = age_cell <= 0.0;
        let ln_life = match law {
            WearLaw::Exponential { hours } => Some((hours, LN_LIFE_OF_EXPONENTIAL)),
            WearLaw::Stages { life_hours, .. } => Some((life_hours, LN_LIFE_OF_STAGES)),
            _ => None,
        };
        Self {
            law,
            age,
            ln_cell: law_cell.ln() + if is_known { 0.0 } else { age_cell.ln() },
            age_spread: if is_known { 0.0 } else { law.derivative(age) * age_cell / 12.0_f64.sqrt() },
            ln_life: ln_life.map(|(hours, (mean, sd))| (hours.ln() + mean, sd)),
        }
    }
}

/// The curves of the laws in `is_tried`, for a unit observed over `span_hours` of usage.
///
/// A unit of unknown age at its first record gets every age of the grid; onsets lie on a grid of starts within the observed
/// usage. The forecast handles later starts.
pub(crate) fn candidates(
    known_age: Option<f64>,
    span_hours: f64,
    starts: usize,
    is_tried: impl Fn(WearLaw) -> bool,
) -> Vec<Candidate> {
    static FRESH: LazyLock<Vec<Candidate>> = LazyLock::new(|| at_ages(&[(0.0, 0.0)]));
    static WORN: LazyLock<Vec<Candidate>> = LazyLock::new(|| {
        let width = |i: usize| AGES[(i + 1).min(AGES.len() - 1)] - AGES[i.saturating_sub(1)];
        let is_inner = |i: usize| i > 0 && i + 1 < AGES.len();
        let cell =
            |i: usize| if is_inner(i) { 0.5 * width(i) } else { width(i) * f64::from(u8::from(i > 0)) };
        at_ages(&AGES.iter().enumerate().map(|(i, age)| (*age, cell(i))).collect::<Vec<_>>())
    });
    let cell = span_hours / starts as f64;
    let onset = |i: usize| Candidate::new(WearLaw::Onset { start: (i as f64 + 0.5) * cell }, 0.0, 0.0, cell);
    let none = Candidate::new(WearLaw::None, 0.0, 0.0, 1.0);
    let mut candidates: Vec<Candidate> = std::iter::once(none).chain((0..starts).map(onset)).collect();
    let mut add = |of: &[Candidate]| candidates.extend(of.iter().filter(|candidate| is_tried(candidate.law)));
    match known_age {
        // Most known ages are those of units that were just reset.
        Some(0.0) => add(&FRESH),
        Some(age) => add(&at_ages(&[(age, 0.0)])),
        None => add(&WORN),
    }
    candidates
}

/// The laws whose parameters do not depend on what was seen, at some ages and their cells.
fn at_ages(ages: &[(f64, f64)]) -> Vec<Candidate> {
    let powers = (0..EXPONENTS.len()).map(|index| (WearLaw::Power { index }, 1.0));
    let rising = EXPONENTIAL.hours().map(|hours| (WearLaw::Exponential { hours }, EXPONENTIAL.ratio.ln()));
    let settling =
        SETTLING.hours().map(|hours| (WearLaw::Settling { hours }, f64::from(SETTLING.count).recip()));
    let simple = powers.chain(rising).chain(settling);
    let at = |(law, cell)| ages.iter().map(move |(age, age_cell)| Candidate::new(law, *age, *age_cell, cell));
    let mut candidates: Vec<Candidate> = simple.flat_map(at).collect();
    for index in 0..STAGES.len() {
        for life_hours in LIVES.hours() {
            let law = WearLaw::Stages { index, life_hours };
            let wider = STAGES_AGE_STRIDE as f64;
            let at = |(age, cell): &(f64, f64)| Candidate::new(law, *age, wider * cell, LIVES.ratio.ln());
            candidates.extend(ages.iter().step_by(STAGES_AGE_STRIDE).map(at));
        }
    }
    candidates
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// The derivative is that of the value, by central differences; the inverse leads back to the age.
        #[test]
        fn derivative_and_inverse_are_those_of_the_value(age in 50.0..3000.0_f64) {
            for Candidate { law, .. } in candidates(Some(0.0), 2000.0, 3, |_| true) {
                let step = 1e-4 * age;
                let (low, high) = (law.value(age - step), law.value(age + step));
                let slope = (high - low) / (2.0 * step);
                let is_bent = matches!(law, WearLaw::Stages { .. } | WearLaw::Onset { .. })
                    && (law.derivative(age - step) - law.derivative(age + step)).abs() > 1e-12;
                let found = law.derivative(age);
                prop_assert!(
                    is_bent || (found - slope).abs() <= 1e-6 * slope.abs() + 1e-12,
                    "{law:?}: {found}, not {slope}"
                );
                let value = law.value(age);
                // A value that differs from one by less than rounding has no age of its own.
                if value > 0.0 && slope * age > 1e-6 {
                    let back = law.inverse(value);
                    prop_assert!((back - age).abs() < 1e-6 * age, "{law:?}: {back}, not {age}");
                }
            }
        }
    }

    /// By hand: half of a life is 0.4 · 0.7071 + 0.6 · 0.0625 of the growth, and the life all of it.
    #[test]
    fn stages_grow_by_one_in_their_life() {
        for index in 0..STAGES.len() {
            let law = WearLaw::Stages { index, life_hours: 800.0 };
            assert!((law.value(800.0) - 1.0).abs() < 1e-12 && law.value(0.0).abs() < 1e-12);
        }
        let half = WearLaw::Stages { index: 0, life_hours: 800.0 }.value(400.0);
        assert!((half - 0.320_342_712_474_619).abs() < 1e-12, "{half}");
    }
}
