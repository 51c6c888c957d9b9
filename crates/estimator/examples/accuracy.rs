//! How far from the truth, and how sure: simulated flights of known gap, estimated four ways.
//!
//! `cargo run --release -p estimator --example accuracy -- [FLIGHTS] [SCENARIO]`
//!
//! For each scenario: median and 95 % quantile of the error of every method, how often the 90 % interval
//! of contact regression holds the truth, what it refused and what it flagged. Errors are per cent of
//! the gap, or µm where gaps are drawn from zero upwards. `simulator` shares no equation with `estimator`.

#![allow(clippy::print_stdout, clippy::unwrap_used, reason = "a study prints, and stops where it fails")]

use std::collections::BTreeMap;
use std::ops::Range;

use estimator::contact::{self, Outcome, Prior};
use estimator::noise::Sensors as NoiseSensors;
use estimator::{Actuator, Filter, Noise, Samples, midrange};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use simulator::contact::Law as ContactLaw;
use simulator::friction::Law as FrictionLaw;
use simulator::{Flight, Plant, Profile, Sensors, simulate};

/// A flight to be flown, and what its estimator is told.
struct Case {
    plant: Plant,
    profile: Profile,
    sensors: Sensors,
    /// Stiffness assumed over the true one.
    assumed: f64,
}

type Change = fn(&mut Case, &mut ChaCha8Rng);

struct Scenario {
    name: &'static str,
    gap_m: f64,
    change: Change,
}

const fn scenario(name: &'static str, gap_m: f64, change: Change) -> Scenario {
    Scenario { name, gap_m, change }
}

const SCENARIOS: [Scenario; 22] = [
    scenario("nominal", 100e-6, |_, _| ()),
    scenario("stiffness +30 %", 100e-6, |c, _| c.assumed = 1.3),
    scenario("load cell +5 %", 100e-6, |c, _| c.sensors.load.gain_error = 0.05),
    scenario("friction x8", 100e-6, |c, _| c.plant = c.plant.with_friction_factor(8.0)),
    scenario("skew 5 ms", 100e-6, |c, _| c.sensors.screw.delay_s = 5e-3),
    scenario("load 5 ms late", 100e-6, |c, _| c.sensors.load.delay_s = 5e-3),
    scenario("spikes 2 mm", 100e-6, |c, _| {
        (c.sensors.screw.spikes_per_minute, c.sensors.screw.spike) = (1.0, 2e-3);
    }),
    scenario("dropouts 5 %", 100e-6, |c, _| c.sensors.screw.dropout_share = 0.05),
    scenario("freezes 2 s", 100e-6, |c, _| {
        (c.sensors.screw.freezes_per_minute, c.sensors.screw.freeze_s) = (1.0, 2.0);
    }),
    scenario("drift 50 um", 100e-6, |c, _| c.sensors.screw.drift = 50e-6),
    scenario("transducer 15 um", 100e-6, |c, _| c.sensors.screw.nonlinearity = 15e-6),
    scenario("mixture, 100 um", 100e-6, mixture),
    scenario("mixture, 30 um", 30e-6, mixture),
    scenario("mixture, no gap", 0.0, mixture),
    scenario("wide", 0.0, wide),
    scenario("wide, Stribeck", 0.0, |c, rng| {
        wide(c, rng);
        let ratio = rng.random_range(1.1..1.6);
        c.plant.friction_law = FrictionLaw::Stribeck { ratio, speed_m_per_s: rng.random_range(1e-3..1e-2) };
    }),
    scenario("wide, pre-sliding", 0.0, |c, rng| {
        wide(c, rng);
        c.plant.friction_law = FrictionLaw::Presliding { travel_m: rng.random_range(2e-6..20e-6) };
    }),
    scenario("soft to 20 um", 100e-6, |c, rng| {
        mixture(c, rng);
        c.plant.contact.law = ContactLaw::Soft { share: 0.4, depth_m: 20e-6 };
    }),
    scenario("soft to 100 um", 100e-6, |c, rng| {
        mixture(c, rng);
        c.plant.contact.law = ContactLaw::Soft { share: 0.4, depth_m: 100e-6 };
    }),
    scenario("part Hertz", 100e-6, |c, rng| {
        mixture(c, rng);
        c.plant.contact.law = ContactLaw::Hertz { share: 0.3, reference_m: 100e-6 };
    }),
    scenario("Hertz", 100e-6, |c, rng| {
        mixture(c, rng);
        c.plant.contact.law = ContactLaw::Hertz { share: 1.0, reference_m: 100e-6 };
    }),
    scenario("no reversal", 100e-6, |c, rng| {
        mixture(c, rng);
        c.profile.no_reversal = true;
    }),
];

/// Several small faults at once, as in service.
fn mixture(case: &mut Case, rng: &mut ChaCha8Rng) {
    case.assumed = rng.random_range(0.85..1.15);
    let sensors = &mut case.sensors;
    sensors.load.gain_error = rng.random_range(-0.02..0.02);
    sensors.screw.delay_s = rng.random_range(-1e-3..1e-3);
    sensors.screw.drift = rng.random_range(-20e-6..20e-6);
    sensors.screw.nonlinearity = rng.random_range(-15e-6..15e-6);
    case.plant = case.plant.with_friction_factor(rng.random_range(0.7..2.7));
}

/// Everything over wide ranges: plant, sensors, flight and what is assumed.
fn wide(case: &mut Case, rng: &mut ChaCha8Rng) {
    mixture(case, rng);
    let log_uniform =
        |rng: &mut ChaCha8Rng, range: Range<f64>| range.start * (range.end / range.start).powf(rng.random());
    case.plant.contact.gap_m = rng.random_range(0.0..300e-6);
    case.plant.contact.stiffness_n_per_m = log_uniform(rng, 3e7..1e8);
    case.assumed = rng.random_range(0.7..1.3);
    case.plant = Plant { contact: case.plant.contact, ..Plant::default() }
        .with_friction_factor(log_uniform(rng, 0.3..8.0));
    let sensors = &mut case.sensors;
    sensors.load.gain_error = rng.random_range(-0.05..0.05);
    sensors.load.delay_s = rng.random_range(-2e-3..2e-3);
    sensors.screw.noise_rms = log_uniform(rng, 1e-6..20e-6);
    sensors.screw.delay_s = rng.random_range(-5e-3..5e-3);
    case.profile = Profile {
        duration_s: log_uniform(rng, 30.0..3600.0),
        sample_rate_hz: log_uniform(rng, 50.0..1000.0),
        load_n: log_uniform(rng, 4e3..15e3),
        gust_share: rng.random_range(0.15..0.4),
        gust_hz: log_uniform(rng, 0.3..2.0),
        trim_share: rng.random_range(0.003..0.03),
        stick_share: rng.random_range(0.05..0.2),
        hinge_share: rng.random_range(0.1..0.4),
        no_reversal: false,
        ..case.profile
    };
}

/// What the methods say of one flight, m.
struct Answer {
    truth_m: f64,
    contact: Outcome,
    midrange_m: f64,
    lines_m: f64,
    spread_m: f64,
}

fn answer(scenario: &Scenario, index: u64) -> Answer {
    let mut rng = ChaCha8Rng::seed_from_u64(0x5eed ^ (index << 8));
    let mut case = Case {
        plant: Plant::default().with_gap_m(scenario.gap_m),
        profile: Profile { duration_s: 120.0, ..Profile::default() },
        sensors: Sensors::default(),
        assumed: 1.0,
    };
    case.plant.contact.offset_m = rng.random_range(-3e-4..3e-4);
    (scenario.change)(&mut case, &mut rng);
    let flight = simulate(&case.plant, &case.profile, &case.sensors, 1000 + index).unwrap();
    judge(&case, &flight)
}

fn judge(case: &Case, flight: &Flight) -> Answer {
    let dx_m: Vec<f64> = flight.screw_m.iter().zip(&flight.motor_m).map(|(s, m)| s - m).collect();
    let whole = 0..dx_m.len();
    let (motor_m, load_n, step_s) = (&flight.motor_m, &flight.load_n, case.profile.sample_rate_hz.recip());
    let segments = std::slice::from_ref(&whole);
    let samples = Samples { step_s, motor_m, dx_m: &dx_m, load_n, segments };
    let stiffness_n_per_m = case.plant.contact.stiffness_n_per_m * case.assumed;
    let prior = Prior { stiffness_n_per_m, reference_load_n: None };
    let actuator = Actuator::linear(stiffness_n_per_m, 2000.0, 8.0).unwrap();
    let noise = NoiseSensors {
        screw_rms_m: case.sensors.screw.noise_rms,
        screw_resolution_m: case.sensors.screw.resolution,
        motor_rms_m: case.sensors.motor.noise_rms,
        motor_resolution_m: case.sensors.motor.resolution,
        unknown_force_n: 200.0,
        bandwidth_hz: 10.0,
    };
    let filter = Filter::new(&actuator, step_s, &Noise::Sensors(noise)).unwrap();
    Answer {
        truth_m: flight.gap_m,
        contact: contact::estimate(&samples, &prior).unwrap(),
        midrange_m: midrange::estimate(&samples, &filter).map_or(f64::NAN, |found| found.gap.gap_m),
        lines_m: load_lines_m(&dx_m, load_n),
        spread_m: spread_m(&dx_m),
    }
}

/// A baseline: δX on F by least squares on each side of the load, beyond a tenth of its greatest; the
/// difference of the intercepts.
fn load_lines_m(dx_m: &[f64], load_n: &[f64]) -> f64 {
    let least_n = 0.1 * load_n.iter().fold(0.0_f64, |most, f| most.max(f.abs()));
    let intercept_m = |side: f64| {
        let (mut n, mut sf, mut sy, mut sff, mut sfy) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for (y, f) in dx_m.iter().zip(load_n).filter(|(y, f)| y.is_finite() && **f * side > least_n) {
            (n, sf, sy, sff, sfy) = (n + 1.0, sf + f, sy + y, sff + f * f, sfy + f * y);
        }
        (sy * sff - sf * sfy) / (n * sff - sf * sf)
    };
    intercept_m(1.0) - intercept_m(-1.0)
}

/// A baseline: the 99 % quantile of δX less the 1 % quantile.
fn spread_m(dx_m: &[f64]) -> f64 {
    let mut sorted: Vec<f64> = dx_m.iter().copied().filter(|y| y.is_finite()).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    sorted[(sorted.len() - 1) * 99 / 100] - sorted[(sorted.len() - 1) / 100]
}

fn answers(scenario: &Scenario, flights: u64) -> Vec<Answer> {
    let workers = std::thread::available_parallelism().map_or(1, usize::from) as u64;
    std::thread::scope(|scope| {
        let share = |worker: u64| {
            scope.spawn(move || {
                (worker..flights).step_by(workers as usize).map(|i| answer(scenario, i)).collect::<Vec<_>>()
            })
        };
        let running: Vec<_> = (0..workers).map(share).collect();
        running.into_iter().flat_map(|handle| handle.join().unwrap()).collect()
    })
}

/// Median and 95 % quantile of absolute errors.
fn quantiles(mut errors: Vec<f64>) -> String {
    errors.retain(|e| e.is_finite());
    if errors.is_empty() {
        return format!("{:>6} / {:<6}", "-", "-");
    }
    errors.sort_unstable_by(f64::total_cmp);
    let at = |share: f64| errors[((errors.len() - 1) as f64 * share).round() as usize];
    format!("{:>6.2} / {:<6.2}", at(0.5), at(0.95))
}

fn report(scenario: &Scenario, answers: &[Answer]) {
    let unit_m = if scenario.gap_m > 0.0 { 0.01 * scenario.gap_m } else { 1e-6 };
    let errors = |of: fn(&Answer) -> f64| {
        quantiles(answers.iter().map(|a| (of(a) - a.truth_m).abs() / unit_m).collect())
    };
    let contact_m = |a: &Answer| match &a.contact {
        Outcome::Estimated(gap) => gap.gap_m,
        Outcome::Refused(_) => f64::NAN,
    };
    let (mut held, mut estimated, mut codes) = (0.0, 0.0, BTreeMap::<&str, usize>::new());
    for answer in answers {
        match &answer.contact {
            Outcome::Estimated(gap) => {
                estimated += 1.0;
                let (low_m, high_m) = gap.gap_bounds_m;
                held += f64::from(u8::from((low_m..=high_m).contains(&answer.truth_m)));
                gap.flags.iter().for_each(|flag| *codes.entry(flag.code()).or_default() += 1);
            }
            Outcome::Refused(refusal) => *codes.entry(refusal.code()).or_default() += 1,
        }
    }
    let unit = if scenario.gap_m > 0.0 { "%" } else { "um" };
    println!(
        "{:18} {unit:>2} | {} | {} | {} | {} | {:>4.0} % | {codes:?}",
        scenario.name,
        errors(contact_m),
        errors(|a| a.midrange_m),
        errors(|a| a.lines_m),
        errors(|a| a.spread_m),
        100.0 * held / estimated,
    );
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let flights: u64 = arguments.next().map_or(100, |text| text.parse().unwrap());
    let wanted = arguments.next();
    println!("{flights} flights each; median / P95 of the absolute error; share of 90 % intervals that hold");
    println!(
        "{:21} | {:15} | {:15} | {:15} | {:15} | holds  | refusals and flags",
        "", "contact", "mid-range", "load lines", "P99 - P1"
    );
    for scenario in &SCENARIOS {
        if wanted.as_ref().is_none_or(|name| scenario.name.contains(name.as_str())) {
            report(scenario, &answers(scenario, flights));
        }
    }
}
