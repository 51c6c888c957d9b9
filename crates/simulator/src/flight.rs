//! One actuator, one flight: the plant flown along a course and read through its sensors.

use crate::course::{Course, LEAD_IN_S};
use crate::drive::Loop;
use crate::error::Error;
use crate::plant::Plant;
use crate::profile::Profile;
use crate::random::stream;
use crate::sensor::Sensors;
use crate::two_mass::{Forces, State, advance};

/// The integrator's step, seconds.
const STEP_S: f64 = 1e-4;

/// What an estimator should do with a log.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Expected {
    /// The gap can be seen.
    Estimate,
    /// It cannot: the load keeps one sign.
    Refuse,
}

impl Expected {
    /// The word used in truth tables.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Estimate => "estimate",
            Self::Refuse => "refuse",
        }
    }
}

/// A log as recorded, and the truth behind it.
#[derive(Debug, Clone, PartialEq)]
pub struct Flight {
    /// The recorder's stamps, seconds from the start of the log.
    pub time_s: Vec<f64>,
    /// Motor position as logged, metres at the screw; NaN where missing.
    pub motor_m: Vec<f64>,
    /// Screw position as logged, metres.
    pub screw_m: Vec<f64>,
    /// Load as logged, N, positive along +X.
    pub load_n: Vec<f64>,
    /// The true gap, metres.
    pub gap_m: f64,
    /// The true stiffness of a flank, N/m.
    pub stiffness_n_per_m: f64,
    /// τ in `screw_logged(t) = X_screw(t − τ)` against the motor channel, seconds.
    pub skew_s: f64,
    /// Whether the gap can be seen at all.
    pub expected: Expected,
}

/// Flies one actuator and records it. The same arguments give the same bits.
///
/// Course, clock and each channel draw from streams of their own: two calls that differ in the plant
/// or in one sensor alone meet the same flight and the same noise elsewhere.
///
/// # Errors
/// [`Error::Value`] for a parameter outside its range.
pub fn simulate(plant: &Plant, profile: &Profile, sensors: &Sensors, seed: u64) -> Result<Flight, Error> {
    plant.check()?;
    profile.check()?;
    sensors.check()?;
    let [motor, screw, load] = fly(plant, profile, sensors, &Course::lay(profile, seed));
    let rate_hz = profile.sample_rate_hz;
    let noise = |name: &str| stream(seed, &["sensor", name]);
    let stroke_m = profile.stroke_m;
    Ok(Flight {
        time_s: sensors.stamps(profile.samples(), rate_hz, seed),
        motor_m: sensors.motor.read(motor, rate_hz, stroke_m, &mut noise("motor")),
        screw_m: sensors.screw.read(screw, rate_hz, stroke_m, &mut noise("screw")),
        load_n: sensors.load.read(load, rate_hz, stroke_m, &mut noise("load")),
        gap_m: plant.contact.gap_m,
        stiffness_n_per_m: plant.contact.stiffness_n_per_m,
        skew_s: sensors.skew_s(),
        expected: if profile.no_reversal { Expected::Refuse } else { Expected::Estimate },
    })
}

/// Motor position, screw position and load at each channel's own sample instants.
fn fly(plant: &Plant, profile: &Profile, sensors: &Sensors, course: &Course) -> [Vec<f64>; 3] {
    let mut probes = [sensors.motor.delay_s, sensors.screw.delay_s, sensors.load.delay_s]
        .map(|delay_s| Probe::new(delay_s, profile));
    let mut motor = Loop::new(plant.drive, plant.motor_mass_kg + plant.screw_mass_kg);
    let mut state = State { screw_m: plant.contact.offset_m, ..State::default() };
    let mut reading = [state.motor_m, state.screw_m, load_n(course, -LEAD_IN_S, state.screw_m)];
    let mut steps = 0_u64;
    while probes.iter().any(|probe| !probe.full()) {
        let now_s = steps as f64 * STEP_S - LEAD_IN_S;
        steps += 1;
        let middle_m = state.screw_m + 0.5 * STEP_S * state.screw_m_per_s;
        let forces = Forces {
            drive_n: motor.force_n(course.at(now_s).command_m, state.motor_m, state.motor_m_per_s, STEP_S),
            load_n: load_n(course, now_s + 0.5 * STEP_S, middle_m),
        };
        state = advance(plant, &state, forces, STEP_S);
        let next = [state.motor_m, state.screw_m, load_n(course, now_s + STEP_S, state.screw_m)];
        for ((probe, before), after) in probes.iter_mut().zip(reading).zip(next) {
            probe.pass(now_s, before, after);
        }
        reading = next;
    }
    probes.map(|probe| probe.samples)
}

/// The aerodynamic load at a deflection, N.
fn load_n(course: &Course, time_s: f64, deflection_m: f64) -> f64 {
    let here = course.at(time_s);
    here.air_n - here.hinge_n_per_m * deflection_m
}

/// Samples one quantity at even instants minus a delay, by straight lines between steps.
struct Probe {
    samples: Vec<f64>,
    wanted: usize,
    rate_hz: f64,
    delay_s: f64,
}

impl Probe {
    fn new(delay_s: f64, profile: &Profile) -> Self {
        let wanted = profile.samples();
        Self { samples: Vec::with_capacity(wanted), wanted, rate_hz: profile.sample_rate_hz, delay_s }
    }

    fn full(&self) -> bool {
        self.samples.len() == self.wanted
    }

    fn pass(&mut self, from_s: f64, before: f64, after: f64) {
        while !self.full() {
            let part = (self.samples.len() as f64 / self.rate_hz - self.delay_s - from_s) / STEP_S;
            if part > 1.0 {
                return;
            }
            self.samples.push(before + part * (after - before));
        }
    }
}
