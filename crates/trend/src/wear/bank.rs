//! The bank of wear laws: how far a gap has grown at an age, whatever its size.
//!
//! ```text
//! gap(u) = N + A · F(u + a)     N gap when new, A amplitude, a age at first sight, u usage since
//!
//! power        F(t) = (t/1000)^p            p = ½ … 3
//! exponential  F(t) = e^(t/τ) − 1
//! settling     F(t) = 1 − e^(−t/τ)
//! onset        F(t) = max(0, t − o)/1000    flat, then a line
//! bend         F(t) = (s t + (1 − s) max(0, t − o))/1000    one line, then another; s the ratio of rates
//! life curve   F(t) = G(t/T)    piecewise over the shares of a life T, see `life_curve`
//! none         F(t) = 0
//! ```
//! Ages are hours, or another usage converted to hours by the part number's mean. Each law is parametrised by its
//! *life*: the age T at which it has grown by a given span, so A = span/F(T).
//!
//! This file holds everything that is particular to a law: values, parameters, default share, reported class.

use std::fmt;
use std::ops::Range;
use std::sync::LazyLock;

use crate::wear::life_curve::{self, LifeCurve};

/// Age that a power law's amplitude refers to, hours, and its logarithm.
const REFERENCE_HOURS: f64 = 1000.0;
const LN_REFERENCE_HOURS: f64 = 6.907_755_278_982_137;

/// Exponents in eighths, so that a power is a product of square roots: 0.5 to 3.
const POWER_EIGHTHS: [u8; 14] = [4, 5, 6, 7, 8, 9, 10, 12, 14, 16, 18, 20, 22, 24];

/// Time constants of the exponential law, hours.
const TIME_CONSTANTS: [f64; 10] =
    [250.0, 350.0, 500.0, 700.0, 1000.0, 1400.0, 2000.0, 2800.0, 4000.0, 6000.0];

/// Time constants of wear that settles, hours.
const SETTLING: [f64; 4] = [900.0, 1600.0, 2800.0, 5000.0];

/// Rates before a bend over those after it: knees, and running in.
const BEND_RATIOS: [f64; 5] = [0.2, 0.45, 2.2, 5.0, 12.0];

/// Knees tried within what was seen, and every how many ages.
const KNEES: usize = 10;
const BEND_AGE_STRIDE: usize = 4;

/// The same for life curves.
const LIFE_CURVE_AGE_STRIDE: usize = 2;

/// Mean and standard deviation of ln(life / time constant): of the exponential law, and of a life curve.
const LN_LIFE_OF_EXPONENTIAL: (f64, f64) = (1.1, 0.5);
const LN_LIFE_OF_CURVE: (f64, f64) = (0.0, 0.2);

/// Rate ratio up to which a law is reported as slowing, and from which as accelerating: the exponent of a power, the
/// next tenth's rate over the present one of a life curve.
const SLOWING: f64 = 0.9;
const ACCELERATING: f64 = 1.2;

/// Ages at first sight, hours.
const AGES: [f64; 14] =
    [0.0, 75.0, 150.0, 250.0, 400.0, 600.0, 850.0, 1150.0, 1500.0, 2000.0, 2600.0, 3400.0, 4500.0, 6000.0];

/// Number of exponents, the last families.
const POWERS: usize = POWER_EIGHTHS.len();

/// Number of [`WearLaw::family`] values: every exponent is one, the other laws are one each.
pub(crate) const FAMILIES: usize = LIFE_CURVES.end + POWER_EIGHTHS.len();

/// The families of bends and of life curves.
const BENDS: Range<usize> = 4..4 + BEND_RATIOS.len();
const LIFE_CURVES: Range<usize> = BENDS.end..BENDS.end + life_curve::COUNT;

/// The family of wear that is proportional to usage.
const LINEAR: usize = FAMILIES - POWERS + 4;

/// A law's form.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum WearLaw {
    /// No wear.
    None,
    /// Flat until `start` hours after first sight, then a line.
    Onset { start: f64 },
    /// A line until an age of `knee`, then another; index into the ratios of their rates.
    Bend { knee: f64, index: usize },
    /// Index into the time constants.
    Exponential { index: usize },
    /// Index into the constants of settling.
    Settling { index: usize },
    /// Indices into the life curves and their lives.
    LifeCurve { shape: usize, life: usize },
    /// Index into the exponents.
    Power { index: usize },
}

/// A law and the age at which its unit was first seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Candidate {
    pub(crate) law: WearLaw,
    /// Age at first sight, hours, and its index in [`CandidateBank::ages`].
    pub(crate) age: f64,
    age_index: usize,
    /// Width of the grid cell of ages that the candidate represents.
    age_cell: f64,
    /// Logarithms of its age, of that cell, and of the cell of ln τ or the start.
    pub(crate) ln_age: f64,
    pub(crate) ln_age_cell: f64,
    pub(crate) ln_law_cell: f64,
    /// Standard deviation of the height at first sight within the cell of ages.
    pub(crate) age_spread: f64,
    /// ln of the time by which its law runs, where its life has to do with that.
    pub(crate) ln_time_constant_hours: Option<f64>,
    /// The sequence of which its basis values are a multiple, plus a line and a constant, if there is one.
    pub(crate) basis: Option<(usize, BasisCoefficients)>,
}

/// Class of wear laws that is reported.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
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

impl fmt::Display for WearClass {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::None => "none",
            Self::Onset => "onset",
            Self::Slowing => "slowing",
            Self::Linear => "linear",
            Self::Accelerating => "accelerating",
        })
    }
}

/// Share of each family in a fleet without data.
pub(crate) fn default_shares() -> [f64; FAMILIES] {
    let mut shares = [0.28 / POWERS as f64; FAMILIES];
    shares[LINEAR] += 0.09;
    shares[WearLaw::None.family()] = 0.17;
    shares[WearLaw::Onset { start: 0.0 }.family()] = 0.16;
    shares[WearLaw::Exponential { index: 0 }.family()] = 0.11;
    shares[WearLaw::Settling { index: 0 }.family()] = 0.05;
    shares[BENDS].fill(0.07 / BENDS.len() as f64);
    shares[LIFE_CURVES].fill(0.07 / LIFE_CURVES.len() as f64);
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
            Self::Bend { index, .. } => BENDS.start + index,
            Self::LifeCurve { shape, .. } => LIFE_CURVES.start + shape,
            Self::Power { index } => FAMILIES - POWERS + index,
        }
    }

    /// F at an age.
    pub(crate) fn value(self, age: f64) -> f64 {
        match self {
            Self::None => 0.0,
            Self::Onset { start } => two_lines(0.0, start, age),
            Self::Bend { knee, index } => two_lines(BEND_RATIOS[index], knee, age),
            Self::Exponential { index } => (age / TIME_CONSTANTS[index]).exp_m1(),
            Self::Settling { index } => -(-age / SETTLING[index]).exp_m1(),
            Self::LifeCurve { shape, life } => LifeCurve::new(shape, life).value(age),
            Self::Power { index } => {
                eighth_power(roots((age / REFERENCE_HOURS).max(0.0)), POWER_EIGHTHS[index])
            }
        }
    }

    /// dF/dt at an age; at least that of one hour, where a falling rate begins without bound.
    pub(crate) fn derivative(self, age: f64) -> f64 {
        match self {
            Self::None => 0.0,
            Self::Onset { start } => f64::from(u8::from(age >= start)) / REFERENCE_HOURS,
            Self::Bend { knee, index } => {
                (if age < knee { BEND_RATIOS[index] } else { 1.0 }) / REFERENCE_HOURS
            }
            Self::Exponential { index } => (age / TIME_CONSTANTS[index]).exp() / TIME_CONSTANTS[index],
            Self::Settling { index } => (-age / SETTLING[index]).exp() / SETTLING[index],
            Self::LifeCurve { shape, life } => LifeCurve::new(shape, life).derivative(age),
            Self::Power { index } => {
                let age = age.max(1.0);
                0.125 * f64::from(POWER_EIGHTHS[index]) * self.value(age) / age
            }
        }
    }

    /// ln of the life at whose end F is this.
    pub(crate) fn ln_life(self, value: f64) -> f64 {
        match self.exponent() {
            Some(p) => LN_REFERENCE_HOURS + value.ln() / p,
            None => self.inverse(value).ln(),
        }
    }

    /// The age at which F is reached.
    pub(crate) fn inverse(self, value: f64) -> f64 {
        match self {
            Self::None => f64::INFINITY,
            Self::Onset { start } => start + value * REFERENCE_HOURS,
            Self::Bend { knee, index } => {
                let (height_hours, before) = (value * REFERENCE_HOURS, BEND_RATIOS[index]);
                if height_hours < before * knee {
                    height_hours / before
                } else {
                    height_hours + (1.0 - before) * knee
                }
            }
            Self::Exponential { index } => TIME_CONSTANTS[index] * value.ln_1p(),
            Self::Settling { .. } if value >= 1.0 => f64::INFINITY,
            Self::Settling { index } => -SETTLING[index] * (-value).ln_1p(),
            Self::LifeCurve { shape, life } => LifeCurve::new(shape, life).inverse(value),
            Self::Power { index } => REFERENCE_HOURS * eighth_root(value.max(0.0), POWER_EIGHTHS[index]),
        }
    }

    /// The time by which a law runs, hours, for one whose life has to do with it.
    pub(crate) fn time_constant_hours(self) -> Option<f64> {
        match self {
            Self::Exponential { index } => Some(TIME_CONSTANTS[index]),
            Self::LifeCurve { life, .. } => Some(life_curve::LIVES[life]),
            _ => None,
        }
    }

    /// Mean and standard deviation of ln(life / time constant), for a law with a time constant.
    pub(crate) fn ln_life_over_time_constant(self) -> (f64, f64) {
        match self {
            Self::LifeCurve { .. } => LN_LIFE_OF_CURVE,
            _ => LN_LIFE_OF_EXPONENTIAL,
        }
    }

    /// Class that is reported at an age.
    pub(crate) fn class(self, age: f64) -> WearClass {
        let by_rate_ratio = |ratio: f64| match ratio {
            ratio if ratio < SLOWING => WearClass::Slowing,
            ratio if ratio > ACCELERATING => WearClass::Accelerating,
            _ => WearClass::Linear,
        };
        match self {
            Self::None => WearClass::None,
            Self::Onset { .. } => WearClass::Onset,
            Self::Exponential { .. } => WearClass::Accelerating,
            Self::Settling { .. } => WearClass::Slowing,
            Self::Bend { index, .. } => by_rate_ratio(BEND_RATIOS[index].recip()),
            Self::LifeCurve { shape, life } => by_rate_ratio(LifeCurve::new(shape, life).rate_ratio(age)),
            Self::Power { index } => by_rate_ratio(0.125 * f64::from(POWER_EIGHTHS[index])),
        }
    }

    /// How fast an amplitude falls with ln life where that is a power: d ln A/d ln T = −p.
    pub(crate) fn exponent(self) -> Option<f64> {
        match self {
            Self::Power { index } => Some(0.125 * f64::from(POWER_EIGHTHS[index])),
            Self::Onset { .. } => Some(1.0),
            _ => None,
        }
    }
}

/// F of a law that is a power at the end of a life of this logarithm.
pub(crate) fn power_of_ln_life(exponent: f64, ln_hours: f64) -> f64 {
    (exponent * (ln_hours - LN_REFERENCE_HOURS)).exp()
}

/// A line of slope `before` up to a knee, then one of slope 1, per reference age.
fn two_lines(before: f64, knee: f64, age: f64) -> f64 {
    (before * age + (1.0 - before) * (age - knee).max(0.0)) * (1.0 / REFERENCE_HOURS)
}

/// x, x^½, x^¼ and x^⅛.
fn roots(x: f64) -> [f64; 4] {
    let half = x.sqrt();
    let quarter = half.sqrt();
    [x, half, quarter, quarter.sqrt()]
}

/// x^(n/8) from the roots of x.
fn eighth_power([x, half, quarter, eighth]: [f64; 4], eighths: u8) -> f64 {
    let factor = |bit: u8, value: f64| if eighths & bit == 0 { 1.0 } else { value };
    let whole = match eighths >> 3 {
        0 => 1.0,
        1 => x,
        2 => x * x,
        _ => x * x * x,
    };
    whole * factor(4, half) * factor(2, quarter) * factor(1, eighth)
}

/// What is x to the n/8: x^(8/n), at once where that is no more than a root.
fn eighth_root(x: f64, eighths: u8) -> f64 {
    match eighths {
        4 => x * x,
        8 => x,
        16 => x.sqrt(),
        _ => x.powf(8.0 / f64::from(eighths)),
    }
}

/// The curves tried for a segment.
pub(crate) struct CandidateBank {
    pub(crate) candidates: Vec<Candidate>,
    ages: Vec<f64>,
    /// Usage between two knees.
    knee_cell: f64,
}

impl CandidateBank {
    /// The bank for a unit seen from `fresh` (new, or just reset) over `span_hours` of usage: of all its laws
    /// those that are to be tried.
    ///
    /// A unit that may have worn before gets every age of the grid; onsets lie on a grid of starts
    /// within the observed usage. Later starts are handled by the forecast.
    pub(crate) fn new(
        fresh: bool,
        known_age: Option<f64>,
        span_hours: f64,
        starts: usize,
        is_tried: impl Fn(WearLaw) -> bool,
    ) -> Self {
        /// What of it asks for no span, of new units and of others.
        static FRESH: LazyLock<StaticCandidates> = LazyLock::new(|| StaticCandidates::of(&[BIRTH]));
        static WORN: LazyLock<StaticCandidates> = LazyLock::new(|| StaticCandidates::of(&grid()));
        let of_known_age;
        let StaticCandidates { ages, first, last } = match known_age {
            Some(age) => {
                // A known age is one cell without width.
                of_known_age = StaticCandidates::of(&[Candidate { age, ln_age: age.ln(), ..BIRTH }]);
                &of_known_age
            }
            None if fresh => &FRESH,
            None => &WORN,
        };
        let at_birth = |law, ln_law_cell| Candidate { law, ln_law_cell, ..BIRTH };
        let cell = span_hours / starts as f64;
        let ln_cell = cell.ln();
        let onsets =
            (0..starts).map(|i| at_birth(WearLaw::Onset { start: (i as f64 + 0.5) * cell }, ln_cell));
        let knee_cell = span_hours / KNEES as f64;
        let is_tried = |candidate: &Candidate| is_tried(candidate.law);
        let bends_at_most = ages.len().div_ceil(BEND_AGE_STRIDE) * KNEES * BENDS.len();
        let mut candidates = Vec::with_capacity(1 + starts + first.len() + bends_at_most + last.len());
        candidates.push(at_birth(WearLaw::None, 0.0));
        candidates.extend(onsets);
        candidates.extend(first.iter().filter(|candidate| is_tried(candidate)));
        candidates.extend(bends(ages, knee_cell).filter(is_tried));
        candidates.extend(last.iter().filter(|candidate| is_tried(candidate)));
        Self { candidates, ages: ages.iter().map(|candidate| candidate.age).collect(), knee_cell }
    }
}

/// The curves that are the same whatever the usage that was seen.
struct StaticCandidates {
    ages: Vec<Candidate>,
    /// Those before the bends, and those after.
    first: Vec<Candidate>,
    last: Vec<Candidate>,
}

impl StaticCandidates {
    fn of(ages: &[Candidate]) -> Self {
        let step = (TIME_CONSTANTS[TIME_CONSTANTS.len() - 1] / TIME_CONSTANTS[0]).ln()
            / (TIME_CONSTANTS.len() - 1) as f64;
        let rising = |index| (WearLaw::Exponential { index }, step);
        let settling = |index| (WearLaw::Settling { index }, 1.0 / SETTLING.len() as f64);
        let powers = (0..POWERS).map(|index| (WearLaw::Power { index }, 1.0));
        let laws = (0..TIME_CONSTANTS.len()).map(rising).chain((0..SETTLING.len()).map(settling));
        let at_ages = |(law, law_cell): (WearLaw, f64)| {
            let ln_law_cell = law_cell.ln();
            ages.iter().map(move |age| Candidate { ln_law_cell, ..*age }.of(law))
        };
        Self {
            ages: ages.to_vec(),
            first: laws.chain(powers).flat_map(at_ages).collect(),
            last: life_curves(ages).collect(),
        }
    }
}

/// A curve that begins at birth; its law is set afterwards.
const BIRTH: Candidate = Candidate {
    law: WearLaw::None,
    age: 0.0,
    age_index: 0,
    age_cell: 0.0,
    ln_age: f64::NEG_INFINITY,
    ln_age_cell: f64::NEG_INFINITY,
    ln_law_cell: 0.0,
    age_spread: 0.0,
    ln_time_constant_hours: None,
    basis: None,
};

/// One line and then another, the knee within what was seen, at every few ages.
fn bends(ages: &[Candidate], cell: f64) -> impl Iterator<Item = Candidate> {
    let ln_law_cell = -(KNEES as f64).ln();
    let of_age = move |at: &Candidate| {
        let age = at.standing_for(BEND_AGE_STRIDE, ln_law_cell);
        let all = (0..KNEES).flat_map(|knee| (0..BEND_RATIOS.len()).map(move |index| (knee, index)));
        all.map(move |(knee, index)| {
            let bend = age.of(WearLaw::Bend { knee: age.age + (knee as f64 + 0.5) * cell, index });
            Candidate { basis: bend.basis.map(|(_, coefficients)| (knee, coefficients)), ..bend }
        })
    };
    ages.iter().step_by(BEND_AGE_STRIDE).flat_map(of_age)
}

/// Every life curve over every life, at every other age.
fn life_curves(ages: &[Candidate]) -> impl Iterator<Item = Candidate> {
    let all = || {
        (0..life_curve::COUNT).flat_map(|shape| (0..life_curve::LIVES.len()).map(move |life| (shape, life)))
    };
    let at = move |at: &Candidate| {
        let age = at.standing_for(LIFE_CURVE_AGE_STRIDE, life_curve::LN_LIFE_CELL.ln());
        all().map(move |(shape, life)| age.of(WearLaw::LifeCurve { shape, life }))
    };
    ages.iter().step_by(LIFE_CURVE_AGE_STRIDE).flat_map(at)
}

/// Ages at first sight and the widths of their cells.
fn grid() -> Vec<Candidate> {
    let width = |i: usize| match i {
        0 => 0.0,
        i if i + 1 == AGES.len() => AGES[i] - AGES[i - 1],
        i => 0.5 * (AGES[i + 1] - AGES[i - 1]),
    };
    let at = |(age_index, &age): (usize, &f64)| {
        let age_cell = width(age_index);
        Candidate { age, age_index, age_cell, ln_age: age.ln(), ln_age_cell: age_cell.ln(), ..BIRTH }
    };
    AGES.iter().enumerate().map(at).collect()
}

/// Heights of curves at the same usages, made of what many curves share.
///
/// ```text
/// exponential  e^((u + a)/τ) − 1 = e^(a/τ) · e^(u/τ) − 1
/// settling     1 − e^(−(u + a)/τ) = 1 − e^(−a/τ) · e^(−u/τ)
/// bend         s (u + a) + (1 − s) max(0, u − k)     k the knee, counted from first sight
/// ```
/// So each of these is a multiple of one of a few sequences, its *basis*, plus a line and a constant.
pub(crate) struct BasisMatrix {
    usages: Vec<f64>,
    roots: Vec<Vec<[f64; 4]>>,
    knee_cell: f64,
}

/// Number of parts.
pub(crate) const BASES: usize = KNEES + TIME_CONSTANTS.len() + SETTLING.len();

/// A curve's heights as multiples of its part, of the line of usage over the reference age, and of one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct BasisCoefficients {
    pub(crate) basis: f64,
    pub(crate) line: f64,
    pub(crate) one: f64,
}

impl Candidate {
    /// The same for as many of the grid's ages.
    fn standing_for(&self, ages: usize, ln_law_cell: f64) -> Self {
        let ages = ages as f64;
        Self {
            age_cell: ages * self.age_cell,
            ln_age_cell: ages.ln() + self.ln_age_cell,
            ln_law_cell,
            ..*self
        }
    }

    /// The same with a law.
    fn of(self, law: WearLaw) -> Self {
        let age_spread = if self.age_cell > 0.0 {
            law.derivative(self.age) * self.age_cell / 12.0_f64.sqrt()
        } else {
            0.0
        };
        Self {
            law,
            age_spread,
            ln_time_constant_hours: law.time_constant_hours().map(f64::ln),
            basis: law.basis(self.age),
            ..self
        }
    }
}

impl WearLaw {
    /// The part that its heights are a multiple of, from an age on; of a bend the first of the knees.
    fn basis(self, age: f64) -> Option<(usize, BasisCoefficients)> {
        match self {
            Self::Bend { index, .. } => {
                let before = BEND_RATIOS[index];
                let coefficients = BasisCoefficients {
                    basis: 1.0 - before,
                    line: before,
                    one: before * age / REFERENCE_HOURS,
                };
                Some((0, coefficients))
            }
            Self::Exponential { index } => {
                let coefficients =
                    BasisCoefficients { basis: (age / TIME_CONSTANTS[index]).exp(), line: 0.0, one: -1.0 };
                Some((KNEES + index, coefficients))
            }
            Self::Settling { index } => {
                let coefficients =
                    BasisCoefficients { basis: -(-age / SETTLING[index]).exp(), line: 0.0, one: 1.0 };
                Some((KNEES + TIME_CONSTANTS.len() + index, coefficients))
            }
            Self::None | Self::Onset { .. } | Self::LifeCurve { .. } | Self::Power { .. } => None,
        }
    }
}

impl BasisMatrix {
    /// For usages counted from the segment's begin.
    pub(crate) fn new(bank: &CandidateBank, usages: Vec<f64>) -> Self {
        let of_age = |age: &f64| usages.iter().map(|u| roots((u + age).max(0.0) / REFERENCE_HOURS)).collect();
        let roots = bank.ages.iter().map(of_age).collect();
        Self { usages, roots, knee_cell: bank.knee_cell }
    }

    /// The line of usage over the reference age.
    pub(crate) fn line(&self) -> impl Iterator<Item = f64> {
        self.usages.iter().map(|u| u / REFERENCE_HOURS)
    }

    /// Writes a part into one lane of some that are filled together.
    pub(crate) fn fill_basis<const N: usize>(&self, basis: usize, lane: usize, lanes: &mut [[f64; N]]) {
        let places = lanes.iter_mut().map(|lanes| &mut lanes[lane]).zip(&self.usages);
        let exponential = |tau: f64, (place, u): (&mut f64, &f64)| *place = (u / tau).exp();
        if basis < KNEES {
            let knee = (basis as f64 + 0.5) * self.knee_cell;
            places.for_each(|(place, u)| *place = two_lines(0.0, knee, *u));
        } else if let Some(tau) = TIME_CONSTANTS.get(basis - KNEES) {
            places.for_each(|at| exponential(*tau, at));
        } else {
            let tau = SETTLING[basis - KNEES - TIME_CONSTANTS.len()];
            places.for_each(|at| exponential(-tau, at));
        }
    }

    /// Writes the heights of a curve that has no part into one lane.
    pub(crate) fn fill<const N: usize>(&self, candidate: &Candidate, lane: usize, lanes: &mut [[f64; N]]) {
        let places = lanes.iter_mut().map(|lanes| &mut lanes[lane]);
        match candidate.law {
            WearLaw::Power { index } => {
                let eighths = POWER_EIGHTHS[index];
                for (place, r) in places.zip(&self.roots[candidate.age_index]) {
                    *place = eighth_power(*r, eighths);
                }
            }
            law => {
                for (place, u) in places.zip(&self.usages) {
                    *place = law.value(u + candidate.age);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// A law of each kind, away from its knee.
    fn laws(age: f64) -> Vec<WearLaw> {
        let of_powers = (0..POWERS).map(|index| WearLaw::Power { index });
        let bends = (0..BENDS.len())
            .flat_map(|index| [0.5, 2.0].map(|times| WearLaw::Bend { knee: times * age, index }));
        let exponential = (0..TIME_CONSTANTS.len()).map(|index| WearLaw::Exponential { index });
        let settling = (0..SETTLING.len()).map(|index| WearLaw::Settling { index });
        let onsets = [0.5, 2.0].map(|times| WearLaw::Onset { start: times * age });
        let others = [WearLaw::None].into_iter().chain(onsets);
        of_powers.chain(bends).chain(exponential).chain(settling).chain(others).collect()
    }

    proptest! {
        /// The derivative is that of the value, by central differences; the inverse leads back to the age.
        #[test]
        fn derivative_and_inverse_are_those_of_the_value(age in 50.0..3000.0_f64) {
            for law in laws(age) {
                let step = 1e-4 * age;
                let (low, high) = (law.value(age - step), law.value(age + step));
                let slope = (high - low) / (2.0 * step);
                let found = law.derivative(age);
                prop_assert!((found - slope).abs() <= 1e-6 * slope.abs() + 1e-12, "{law:?}: {found}, not {slope}");
                let value = law.value(age);
                // A value that differs from one by less than rounding has no age of its own.
                if value > 0.0 && slope * age > 1e-6 {
                    let back = law.inverse(value);
                    prop_assert!((back - age).abs() < 1e-6 * age, "{law:?}: {back}, not {age}");
                }
            }
        }
    }
}
