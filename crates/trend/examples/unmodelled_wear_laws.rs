//! Fleets with wear laws outside the bank: accuracy and coverage of their assessments.
//!
//! `unmodelled_wear_laws [SERIALS] [SEED]` makes nine fleets, assesses each unit three times, and scores the forecast
//! of the remaining hours. Wear deviates from its law (Wiener, not gamma), stated errors are wrong by a factor of up to
//! 1.6, gaps vary with the season by up to 2 µm, tails add a bias, and a tenth of the units is replaced
//! without a record.
#![allow(clippy::print_stdout, clippy::unwrap_used, reason = "a developer's tool, which may fail loudly")]

mod random;

use std::collections::BTreeMap;

use random::Random;
use trend::{FleetPrior, Observation, Series, Settings, UsageDefaults, WearStatus, assess};

const LIMIT_UM: f64 = 100.0;
const DAY_US: f64 = 86_400e6;
const LOG_DAYS: f64 = 1300.0;
const HORIZON_HOURS: f64 = 20_000.0;

/// Wear as a share of the growth to the limit, at a share of the life.
#[derive(Debug, Clone, Copy)]
enum Foreign {
    RunIn { early: f64, tau: f64 },
    Saturating { k: f64 },
    Logistic { k: f64 },
    Bathtub { early: f64 },
    Hyperbolic { q: f64 },
    Knees { rates: [f64; 3], at: [f64; 2] },
    Gompertz { b: f64, c: f64 },
    Bursts { count: f64, share: f64 },
    Logarithm { k: f64 },
    Line,
    Nothing,
}

impl Foreign {
    fn grown(self, x: f64) -> f64 {
        match self {
            Self::RunIn { early, tau } => {
                early * (1.0 - (-x / tau).exp()) / (1.0 - (-1.0 / tau).exp()) + (1.0 - early) * x
            }
            Self::Saturating { k } => (1.0 - (-k * x).exp()) / (1.0 - (-k).exp()),
            Self::Logistic { k } => {
                let l = |x: f64| 1.0 / (1.0 + (-k * (x - 0.5)).exp());
                (l(x) - l(0.0)) / (l(1.0) - l(0.0))
            }
            Self::Bathtub { early } => early * x.sqrt() + (1.0 - early) * x.powi(4),
            Self::Hyperbolic { q } => (1.0 / (1.0 - q * x.min(1.05)) - 1.0) / (1.0 / (1.0 - q) - 1.0),
            Self::Knees { rates, at } => {
                let to = |x: f64| {
                    rates[0] * x.min(at[0])
                        + rates[1] * (x.clamp(at[0], at[1]) - at[0])
                        + rates[2] * (x.max(at[1]) - at[1])
                };
                to(x) / to(1.0)
            }
            Self::Gompertz { b, c } => {
                let g = |x: f64| (-b * (-c * x).exp()).exp();
                (g(x) - g(0.0)) / (g(1.0) - g(0.0))
            }
            Self::Bursts { count, share } => {
                let turn = std::f64::consts::TAU * count;
                let g = |x: f64| x - share * (turn * x).sin() / turn;
                g(x) / g(1.0)
            }
            Self::Logarithm { k } => (k * x).ln_1p() / k.ln_1p(),
            Self::Line => x,
            Self::Nothing => 0.0,
        }
    }

    fn draw(fleet: usize, random: &mut Random) -> Self {
        let own = random.uniform();
        match fleet {
            _ if own < 0.15 => Self::Nothing,
            _ if own < 0.3 => Self::Line,
            0 => Self::RunIn { early: random.between(0.15, 0.4), tau: random.between(0.04, 0.15) },
            1 => Self::Saturating { k: random.between(0.8, 2.0) },
            2 => Self::Logistic { k: random.between(4.0, 8.0) },
            3 => Self::Bathtub { early: random.between(0.2, 0.5) },
            4 => Self::Hyperbolic { q: random.between(0.6, 0.9) },
            6 => Self::Gompertz { b: random.between(3.0, 6.0), c: random.between(3.0, 6.0) },
            7 => Self::Bursts { count: random.between(1.5, 4.0), share: random.between(0.5, 0.9) },
            8 => Self::Logarithm { k: random.between(3.0, 20.0) },
            _ => {
                let first = random.between(0.15, 0.45);
                Self::Knees {
                    rates: [random.between(0.3, 2.0), random.between(0.3, 2.0), random.between(0.3, 2.0)],
                    at: [first, first + random.between(0.15, 0.4)],
                }
            }
        }
    }
}

const FLEETS: [&str; 9] = [
    "run-in",
    "saturating",
    "logistic",
    "bathtub",
    "hyperbolic",
    "two knees",
    "Gompertz",
    "bursts",
    "logarithm",
];

/// A date at which a unit is assessed, and the outcome.
struct Question {
    as_of_us: i64,
    left_hours: f64,
    used_share: f64,
    grown_um: f64,
}

struct Unit {
    series: Series,
    questions: Vec<Question>,
    wears: bool,
}

struct Habits {
    swing_um: f64,
    stated: f64,
    noise_um: f64,
}

fn unit(fleet: usize, random: &mut Random, habits: &Habits) -> Unit {
    let law = Foreign::draw(fleet, random);
    let life_hours = 2800.0 * (0.35 * random.normal()).exp();
    let mut new_um = 20.0 + 3.0 * random.normal();
    let mut age = if random.uniform() < 0.3 { random.between(0.0, 0.6) * life_hours } else { 0.0 };
    let mut walk_um = 0.0;
    let replaced_at = if random.uniform() < 0.1 { random.between(0.3, 0.8) } else { 2.0 };
    let (mut day, mut hours, mut flight) = (random.between(0.0, 0.6 * LOG_DAYS), 0.0, 0);
    let (swing_um, stated) =
        (habits.swing_um * random.uniform(), if random.uniform() < 0.66 { habits.stated } else { 1.0 });
    let mut bias_um = 1.5 * random.normal();
    let (mut rows, mut days) = (Vec::new(), Vec::new());
    let (mut begun_um, mut installation, mut replaced) = (new_um, 0, false);
    let mut met = None;
    while hours < HORIZON_HOURS + 2000.0 {
        let flown = random.between(0.8, 2.6);
        let before = law.grown(age / life_hours);
        (age, hours, day, flight) = (age + flown, hours + flown, day + random.between(0.3, 1.1), flight + 1);
        let grown = (LIMIT_UM - 20.0) * (law.grown(age / life_hours) - before);
        walk_um += (0.25 * grown).sqrt() * random.normal();
        let mut gap_um = new_um + (LIMIT_UM - 20.0) * law.grown(age / life_hours) + walk_um;
        if flight == 1 {
            begun_um = gap_um;
        }
        if !replaced && age / life_hours > replaced_at && day < LOG_DAYS {
            (replaced, age, walk_um, new_um) = (true, 0.0, 0.0, 20.0 + 3.0 * random.normal());
            (gap_um, begun_um) = (new_um, new_um);
            days.clear();
        }
        if gap_um >= LIMIT_UM {
            met = Some(hours);
            break;
        }
        if day > LOG_DAYS {
            continue;
        }
        if random.uniform() < 0.002 {
            (installation, bias_um) = (installation + 1, 1.5 * random.normal());
        }
        let se_um = habits.noise_um * random.between(0.7, 1.4);
        let season_um = swing_um * (std::f64::consts::TAU * day / 365.25).cos();
        let outlier_um = if random.uniform() < 0.02 { se_um * random.between(-20.0, 20.0) } else { 0.0 };
        let departure_us = (day * DAY_US) as i64;
        let seen = random.uniform() < 0.92;
        if seen {
            rows.push(Observation {
                departure_us,
                installation,
                flight_hours: Some(flown),
                tail_hours_end: Some(5000.0 + hours),
                load_reversals: Some((flown * random.between(60.0, 100.0)) as u64),
                gap_m: Some((gap_um + bias_um + season_um + outlier_um + se_um * random.normal()) * 1e-6),
                gap_se_m: Some(se_um * stated * 1e-6),
            });
            days.push((departure_us, hours, age, gap_um - begun_um));
        }
    }
    let ask = |share: f64| {
        let &(as_of_us, then_hours, age, grown_um) =
            days.get((share * days.len() as f64) as usize).filter(|_| days.len() > 60)?;
        let left_hours = met.map_or(f64::INFINITY, |met: f64| met - then_hours);
        Some(Question { as_of_us, left_hours, used_share: age / (age + left_hours), grown_um })
    };
    let questions = [0.3, 0.55, 0.8].into_iter().filter_map(ask).collect();
    let wears = !matches!(law, Foreign::Nothing);
    Unit { series: Series::new(rows, &UsageDefaults::default()).unwrap(), questions, wears }
}

/// What a fleet's answers were worth.
#[derive(Default)]
struct Score {
    errors: Vec<f64>,
    mid_errors: Vec<f64>,
    widths: Vec<f64>,
    late: f64,
    early: f64,
    steady: f64,
    false_trends: f64,
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

fn judge(units: &[Unit]) -> Score {
    let settings = Settings::for_limit(LIMIT_UM * 1e-6);
    let month_us = (60.0 * DAY_US) as i64;
    let mut priors: BTreeMap<i64, FleetPrior> = BTreeMap::new();
    let mut score = Score::default();
    for unit in units {
        for question in &unit.questions {
            let month = question.as_of_us.div_euclid(month_us) * month_us;
            let learn = || FleetPrior::learn(units.iter().map(|u| &u.series), month, LIMIT_UM * 1e-6, None);
            let prior = priors.entry(month).or_insert_with(learn);
            let assessment = assess(&unit.series, question.as_of_us, &settings, Some(prior), None).unwrap();
            if !unit.wears {
                score.steady += 1.0;
                score.false_trends += f64::from(u8::from(assessment.wear == WearStatus::Wearing));
            }
            let left = question.left_hours;
            if !(left.is_finite() && left > 10.0 && question.grown_um >= 4.0) {
                continue;
            }
            let Some(crossing) = assessment.crossing else { continue };
            let hours = |h: Option<f64>| h.unwrap_or(HORIZON_HOURS);
            let (low, likely, high) =
                (hours(crossing.p05_hours), hours(crossing.p50_hours), hours(crossing.p95_hours));
            let error = (likely / left - 1.0).abs();
            score.errors.push(error);
            if (0.65..0.85).contains(&question.used_share) {
                score.mid_errors.push(error);
            }
            score.widths.push((high - low) / left);
            score.late += f64::from(u8::from(left < low));
            score.early += f64::from(u8::from(left > high));
        }
    }
    score
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let serials: usize = arguments.next().map_or(150, |n| n.parse().unwrap());
    let seed: u64 = arguments.next().map_or(1, |n| n.parse().unwrap());
    println!(
        "fleet       asked  error  error 65-85%  held  too late  too early  width  within 20 %  false trend"
    );
    for (fleet, name) in FLEETS.iter().enumerate() {
        let mut random = Random::new(seed * 100 + fleet as u64);
        let habits = Habits {
            swing_um: random.between(0.0, 2.0),
            stated: random.between(0.65, 1.6),
            noise_um: random.between(1.0, 3.0),
        };
        let units: Vec<Unit> = (0..serials).map(|_| unit(fleet, &mut random, &habits)).collect();
        let mut score = judge(&units);
        let asked = score.errors.len() as f64;
        let within = score.errors.iter().filter(|e| **e <= 0.2).count() as f64 / asked;
        println!(
            "{name:10} {asked:6}  {:5.3}  {:12.3}  {:4.3}  {:8.3}  {:9.3}  {:5.2}  {within:11.3}  {:11.3}",
            median(&mut score.errors),
            median(&mut score.mid_errors),
            1.0 - (score.late + score.early) / asked,
            score.late / asked,
            score.early / asked,
            median(&mut score.widths),
            score.false_trends / score.steady,
        );
    }
}
