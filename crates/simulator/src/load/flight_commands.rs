//! Commands and loads of a flight on a fixed grid: motor command, airload and hinge stiffness.
//!
//! The grid is independent of the integrator's step, so a finer step meets the same flight.

use std::f64::consts::TAU;

use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::load::flight_profile::Profile;
use crate::seeded_streams::seeded_rng;

const GRID_S: f64 = 0.005;
/// Quiet time before the log begins, in which motor and screw find their places, seconds.
pub(crate) const LEAD_IN_S: f64 = 2.0;
/// Corner of the trim motion's spectrum, Hz.
const TRIM_HZ: f64 = 0.4;
/// The manoeuvre load is drawn evenly within ± this share of `load_n`; with gusts of 0.3 rms, one
/// cruise sample in twenty then exceeds `load_n`.
const MANOEUVRE_SHARE: f64 = 0.8;

/// A phase of flight: its share of the log, dynamic pressure at both ends over the greatest, and the
/// deployment it asks for over the stroke.
struct Phase {
    share: f64,
    pressure: (f64, f64),
    deployed: f64,
}

const PREFLIGHT: usize = 0;
const PHASES: [Phase; 6] = [
    Phase { share: 0.06, pressure: (0.02, 0.02), deployed: 0.0 },
    Phase { share: 0.08, pressure: (0.02, 0.6), deployed: 0.15 },
    Phase { share: 0.16, pressure: (0.6, 0.9), deployed: 0.0 },
    Phase { share: 0.38, pressure: (0.9, 1.0), deployed: -0.03 },
    Phase { share: 0.20, pressure: (1.0, 0.6), deployed: 0.2 },
    Phase { share: 0.12, pressure: (0.6, 0.15), deployed: 0.35 },
];

#[derive(Debug, Clone, Copy)]
pub(crate) struct CommandSample {
    /// Commanded motor position, at the screw, metres.
    pub(crate) command_m: f64,
    /// Load at zero deflection, N.
    pub(crate) air_n: f64,
    /// Load that each metre of deflection takes off, N/m.
    pub(crate) hinge_n_per_m: f64,
}

/// The commands and loads of a whole flight, from the lead-in to a grid step past the last sample.
pub(crate) struct CommandProfile {
    samples: Vec<CommandSample>,
}

impl CommandProfile {
    /// Lays out a flight; the same profile and seed give the same commands.
    pub(crate) fn generate(profile: &Profile, seed: u64) -> Self {
        let points = ((profile.duration_s + 2.0 * LEAD_IN_S) / GRID_S).ceil() as usize + 2;
        let draw = |name: &str| seeded_rng(seed, &["course", name]);
        let deployment = path(&deployments(profile.duration_s), points);
        let stick = path(&stick_moves(profile, &mut draw("stick")), points);
        let trim = coloured(TRIM_HZ, points, &mut draw("trim"));
        let manoeuvre = path(&manoeuvres(profile.duration_s, &mut draw("manoeuvre")), points);
        let gust: Vec<f64> = match profile.gust_form.noise(profile.gust_hz, GRID_S, draw("gust")) {
            Some(mut noise) => (0..points).map(|_| noise.next()).collect(),
            None => coloured(profile.gust_hz, points, &mut draw("gust")),
        };
        let side = profile
            .reversals
            .map(|count| path(&sides(profile.duration_s, count, &mut draw("sides")), points));
        let mut asked: Vec<f64> =
            (0..points).map(|k| deployment[k] + stick[k] + profile.trim_share * trim[k]).collect();
        rest(&mut asked, profile, &mut draw("rest"));
        let sample = |k: usize| {
            let pressure = pressure(time_s(k) / profile.duration_s);
            let air = match &side {
                Some(side) => -side[k] * one_sided(profile, pressure, manoeuvre[k], gust[k]),
                None if profile.no_reversal => one_sided(profile, pressure, manoeuvre[k], gust[k]),
                None => pressure * (MANOEUVRE_SHARE * manoeuvre[k] + profile.gust_share * gust[k]),
            };
            CommandSample {
                command_m: profile.stroke_m * asked[k].clamp(-1.0, 1.0),
                air_n: profile.load_n * air,
                hinge_n_per_m: pressure * profile.hinge_share * profile.load_n / profile.stroke_m,
            }
        };
        Self { samples: (0..points).map(sample).collect() }
    }

    /// The commands between its grid points, by straight lines.
    pub(crate) fn at(&self, time_s: f64) -> CommandSample {
        let place = ((time_s + LEAD_IN_S) / GRID_S).clamp(0.0, (self.samples.len() - 2) as f64);
        let (index, part) = (place as usize, place.fract());
        let (a, b) = (&self.samples[index], &self.samples[index + 1]);
        let mix = |a: f64, b: f64| a + part * (b - a);
        CommandSample {
            command_m: mix(a.command_m, b.command_m),
            air_n: mix(a.air_n, b.air_n),
            hinge_n_per_m: mix(a.hinge_n_per_m, b.hinge_n_per_m),
        }
    }
}

fn time_s(index: usize) -> f64 {
    index as f64 * GRID_S - LEAD_IN_S
}

/// Load at zero deflection over `load_n` of a surface that is sucked one way, even on the ground: the
/// mean outweighs manoeuvre, gust and full deflection together.
fn one_sided(profile: &Profile, pressure: f64, manoeuvre: f64, gust: f64) -> f64 {
    let swing = 0.15 * manoeuvre + 0.1 * (profile.gust_share * gust).tanh();
    -(0.35 + 0.65 * pressure) * (0.75 + swing)
}

/// A factor that holds for each phase, changing linearly between the middles of neighbouring phases.
pub(crate) fn phase_factor(progress: f64, factors: &[f64; PHASES.len()]) -> f64 {
    let (mut start, mut middle, mut factor) = (0.0, f64::NEG_INFINITY, factors[0]);
    for (phase, next) in PHASES.iter().zip(factors) {
        let next_middle = start + 0.5 * phase.share;
        if progress < next_middle {
            let part = if middle.is_finite() { (progress - middle) / (next_middle - middle) } else { 1.0 };
            return factor + part * (next - factor);
        }
        (start, middle, factor) = (start + phase.share, next_middle, *next);
    }
    factor
}

/// Which side the load is on: a change of side at each of so many random times, well inside the log.
fn sides(duration_s: f64, count: u32, rng: &mut ChaCha8Rng) -> Vec<MotionPrimitive> {
    let mut target = if rng.random() { 1.0 } else { -1.0 };
    let mut moves = vec![MotionPrimitive { start_s: -LEAD_IN_S, lasts_s: 1e-3, target }];
    for k in 0..count {
        // One in each of `count` equal windows.
        let place = (f64::from(k) + rng.random_range(0.1..0.9)) / f64::from(count);
        let lasts_s = rng.random_range(0.6..1.6);
        target = -target;
        moves.push(MotionPrimitive { start_s: duration_s * (0.1 + 0.8 * place) - lasts_s, lasts_s, target });
    }
    moves
}

/// Time in which the command returns from a rest to the commanded path, seconds.
const RETURN_S: f64 = 1.0;

/// Holds the command still for rests of random length, spread over the flight after the preflight checks.
fn rest(asked: &mut [f64], profile: &Profile, rng: &mut ChaCha8Rng) {
    if profile.rest_share == 0.0 {
        return;
    }
    let index = |at_s: f64| (((at_s + LEAD_IN_S) / GRID_S).round() as usize).min(asked.len() - 1);
    let mut start_s = PHASES[PREFLIGHT].share * profile.duration_s;
    let mut rests = Vec::new();
    while start_s < profile.duration_s {
        let lasts_s = profile.rest_s * rng.random_range(0.5..1.5);
        let busy_s = lasts_s * (1.0 / profile.rest_share - 1.0);
        start_s += busy_s * rng.random_range(0.5..1.0);
        rests.push((index(start_s), index(start_s + lasts_s)));
        start_s += lasts_s + 0.25 * busy_s;
    }
    let back = (RETURN_S / GRID_S) as usize;
    for (from, to) in rests {
        let held = asked[from];
        asked[from..to].fill(held);
        for (k, value) in asked[to..].iter_mut().take(back).enumerate() {
            *value = held + eased(k as f64 / back as f64) * (*value - held);
        }
    }
}

/// Least jerk from 0 to 1.
fn eased(part: f64) -> f64 {
    part.powi(3) * (10.0 + part * (6.0 * part - 15.0))
}

/// Dynamic pressure over its greatest, at a share of the log.
fn pressure(progress: f64) -> f64 {
    let mut start = 0.0;
    for phase in &PHASES {
        if progress < start + phase.share {
            let part = ((progress - start) / phase.share).max(0.0);
            return phase.pressure.0 + part * (phase.pressure.1 - phase.pressure.0);
        }
        start += phase.share;
    }
    PHASES[PHASES.len() - 1].pressure.1
}

/// A smooth move to a target, over the stroke or the load it belongs to.
struct MotionPrimitive {
    start_s: f64,
    lasts_s: f64,
    target: f64,
}

/// Full-travel checks before the flight, then each phase's deployment at its start, and back at the end.
fn deployments(duration_s: f64) -> Vec<MotionPrimitive> {
    let checks_s = PHASES[PREFLIGHT].share * duration_s;
    let check = |(k, target): (usize, f64)| MotionPrimitive {
        start_s: checks_s * (0.1 + 0.3 * k as f64),
        lasts_s: 0.25 * checks_s,
        target,
    };
    let mut moves: Vec<MotionPrimitive> = [0.8, -0.8, 0.0].into_iter().enumerate().map(check).collect();
    let mut start_s = checks_s;
    for phase in &PHASES[PREFLIGHT + 1..] {
        let length_s = phase.share * duration_s;
        moves.push(MotionPrimitive { start_s, lasts_s: (0.4 * length_s).min(3.0), target: phase.deployed });
        start_s += length_s;
    }
    let home_s = 0.03 * duration_s;
    moves.push(MotionPrimitive { start_s: duration_s - home_s, lasts_s: home_s.min(3.0), target: 0.0 });
    moves
}

/// The pilot's moves: every two to six seconds from take-off to landing.
fn stick_moves(profile: &Profile, rng: &mut ChaCha8Rng) -> Vec<MotionPrimitive> {
    let mut start_s = PHASES[PREFLIGHT].share * profile.duration_s;
    let mut moves = Vec::new();
    while start_s < profile.duration_s {
        let size: f64 = StandardNormal.sample(rng);
        let target = (profile.stick_share * size).clamp(-0.5, 0.5);
        moves.push(MotionPrimitive { start_s, lasts_s: rng.random_range(0.5..1.5), target });
        start_s += rng.random_range(2.0..6.0);
    }
    moves
}

/// Turns and pulls: a new level of load every two to six seconds, on alternating sides more often than not.
fn manoeuvres(duration_s: f64, rng: &mut ChaCha8Rng) -> Vec<MotionPrimitive> {
    let mut start_s = -LEAD_IN_S;
    let mut side = 1.0;
    let mut moves = Vec::new();
    while start_s < duration_s {
        if rng.random_bool(0.7) {
            side = -side;
        }
        let (lasts_s, target) = (rng.random_range(0.6..1.6), side * rng.random_range(0.0..1.0));
        moves.push(MotionPrimitive { start_s, lasts_s, target });
        start_s += rng.random_range(2.0..6.0);
    }
    moves
}

/// The moves one after the other, each of least jerk; one that begins too early waits for its turn.
fn path(moves: &[MotionPrimitive], points: usize) -> Vec<f64> {
    let mut queue = moves.iter();
    let mut next = queue.next();
    let (mut from, mut start_s, mut lasts_s, mut target) = (0.0, f64::NEG_INFINITY, 0.0, 0.0);
    let mut values = Vec::with_capacity(points);
    for now_s in (0..points).map(time_s) {
        if let Some(waiting) = next.filter(|m| now_s >= m.start_s && now_s >= start_s + lasts_s) {
            (from, start_s, lasts_s, target) = (target, now_s, waiting.lasts_s, waiting.target);
            next = queue.next();
        }
        let part = if now_s >= start_s + lasts_s { 1.0 } else { (now_s - start_s) / lasts_s };
        values.push(from + (target - from) * eased(part));
    }
    values
}

/// Noise of unit variance through two equal low-passes.
///
/// With pole a, the second filter leaves `(1 + a²)/(1 + a)²` of the first one's variance.
fn coloured(corner_hz: f64, points: usize, rng: &mut ChaCha8Rng) -> Vec<f64> {
    let a = (-TAU * corner_hz * GRID_S).exp();
    let drive = (1.0 - a * a).sqrt();
    let scale = (1.0 + a) / (1.0 + a * a).sqrt();
    let mut first: f64 = StandardNormal.sample(rng);
    let mut second = 0.0;
    let mut values = Vec::with_capacity(points);
    for _ in 0..points {
        let white: f64 = StandardNormal.sample(rng);
        first = a * first + drive * white;
        second = a * second + (1.0 - a) * first;
        values.push(scale * second);
    }
    values
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "these values are exact")]
mod tests {
    use super::*;

    #[test]
    fn phases_fill_the_flight() {
        let whole: f64 = PHASES.iter().map(|phase| phase.share).sum();
        assert!((whole - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_factor_holds_in_the_middle_of_its_phase() {
        let factors = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        assert_eq!(phase_factor(-0.1, &factors), 1.0);
        assert!((phase_factor(0.10, &factors) - 2.0).abs() < 1e-9);
        assert!((phase_factor(0.49, &factors) - 4.0).abs() < 1e-9);
        // Middles of climb and cruise are 0.22 and 0.49.
        assert!((phase_factor(0.355, &factors) - 3.5).abs() < 1e-9);
        assert_eq!(phase_factor(1.0, &factors), 6.0);
    }

    fn short(change: impl Fn(&mut Profile)) -> CommandProfile {
        let mut profile = Profile { duration_s: 300.0, hinge_share: 0.0, ..Profile::default() };
        change(&mut profile);
        CommandProfile::generate(&profile, 3)
    }

    #[test]
    fn a_load_with_few_reversals_changes_side_as_often_as_asked() {
        for count in [1, 2, 5] {
            let commands = short(|p| p.reversals = Some(count));
            let pairs = commands.samples.windows(2);
            let changes = pairs.filter(|pair| (pair[0].air_n > 0.0) != (pair[1].air_n > 0.0)).count();
            assert_eq!(changes, count as usize);
        }
    }

    #[test]
    fn the_command_rests_for_about_the_share_asked() {
        let commands = short(|p| (p.rest_share, p.rest_s) = (0.6, 12.0));
        let still = commands.samples.windows(2).filter(|pair| pair[0].command_m == pair[1].command_m);
        let share = still.count() as f64 * GRID_S / (0.94 * 300.0);
        assert!((share - 0.6).abs() < 0.12, "{share}");
        let jump = commands.samples.windows(2).map(|pair| (pair[1].command_m - pair[0].command_m).abs());
        assert!(jump.fold(0.0, f64::max) < 5e-4, "the command never jumps");
    }

    #[test]
    fn coloured_noise_has_unit_variance() {
        let values = coloured(2.0, 400_000, &mut seeded_rng(7, &["variance"]));
        let power = values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64;
        assert!((power - 1.0).abs() < 0.05, "{power}");
    }

    #[test]
    fn a_move_starts_and_ends_at_rest_and_is_halfway_at_half_time() {
        let values = path(&[MotionPrimitive { start_s: 0.0, lasts_s: 1.0, target: 2.0 }], 800);
        let at = |seconds: f64| values[((seconds + LEAD_IN_S) / GRID_S).round() as usize];
        assert_eq!((at(-0.5), at(1.5)), (0.0, 2.0));
        assert!((at(0.5) - 1.0).abs() < 1e-9);
        assert!(at(0.02) < 1e-3 * 2.0 && at(0.98) > 0.999 * 2.0);
    }
}
