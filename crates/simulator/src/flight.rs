//! Simulation of one actuator over one flight, read through its sensors.

use crate::error::Error;
use crate::load::flight_commands::{CommandProfile, LEAD_IN_S};
use crate::load::flight_profile::Profile;
use crate::load::vibration::VibrationSource;
use crate::plant::actuator_plant::Plant;
use crate::plant::motor_controller::PositionLoop;
use crate::plant::two_mass::{Forces, State, advance};
use crate::ranges;
use crate::sensors::channel_sampler::ChannelSampler;
use crate::sensors::sensor::Sensors;

/// The integrator's step, seconds.
const STEP_S: f64 = 1e-4;

/// A log as recorded, and the true gap.
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
    /// The true gap, metres: its mean over the time of the log.
    pub gap_m: f64,
}

/// Simulates one actuator over one flight and records it. Equal arguments give bitwise identical logs.
///
/// Commands, clock and each channel draw from random streams of their own: two calls that differ only in the plant
/// or in one sensor have the same commands, and the same noise in all other channels.
///
/// # Errors
/// [`Error::Value`] for a parameter outside its range.
pub fn simulate(plant: &Plant, profile: &Profile, sensors: &Sensors, seed: u64) -> Result<Flight, Error> {
    check(plant, profile, sensors)?;
    let ([motor, screw, load], gap_m) = fly(plant, profile, sensors, seed);
    let rate_hz = profile.sample_rate_hz;
    Ok(Flight {
        time_s: sensors.clock.stamps(profile.samples(), rate_hz, seed),
        motor_m: sensors.motor.read_log(motor, profile, seed, "motor"),
        screw_m: sensors.screw.read_log(screw, profile, seed, "screw"),
        load_n: sensors.load.read_log(load, profile, seed, "load"),
        gap_m,
    })
}

/// Checks every parameter of a flight against its range.
///
/// # Errors
/// [`Error::Value`] for a parameter outside its range.
pub fn check(plant: &Plant, profile: &Profile, sensors: &Sensors) -> Result<(), Error> {
    ranges::check("", plant)?;
    ranges::check("profile", profile)?;
    ranges::check("sensors", sensors)
}

/// Steps between two updates of the plant's slowly varying parameters: 10 ms.
const SLOW_STEPS: u64 = 100;

/// Motor position, screw position and load at each channel's own sample instants, and the mean gap.
fn fly(plant: &Plant, profile: &Profile, sensors: &Sensors, seed: u64) -> ([Vec<f64>; 3], f64) {
    let commands = CommandProfile::generate(profile, seed);
    let mut buffet = VibrationSource::new(&profile.buffet, profile.load_n, STEP_S, seed, "load");
    let mut shake = VibrationSource::new(&profile.motor_vibration, 1.0, STEP_S, seed, "motor");
    let mut motor = PositionLoop::new(plant.drive, plant.motor_mass_kg + plant.screw_mass_kg);
    let mut state = State { screw_m: plant.contact.offset_m, ..State::default() };
    let (mut buffet_n, mut shake_m) = (buffet.next(), shake.next());
    let mut reading =
        [state.motor_m + shake_m, state.screw_m, load_n(&commands, -LEAD_IN_S, state.screw_m) + buffet_n];
    let channels = [&sensors.motor, &sensors.screw, &sensors.load];
    let mut samplers: [ChannelSampler; 3] =
        std::array::from_fn(|k| ChannelSampler::new(channels[k], profile, STEP_S, reading[k]));
    let (is_varying, mut now) = (plant.is_varying(), plant.at(-LEAD_IN_S, profile.duration_s));
    let (mut steps, mut gaps_m) = (0_u64, 0.0);
    while samplers.iter().any(|sampler| !sampler.is_full()) {
        let now_s = steps as f64 * STEP_S - LEAD_IN_S;
        if is_varying && steps.is_multiple_of(SLOW_STEPS) {
            now = plant.at(now_s, profile.duration_s);
        }
        let gap_m = now.contact.gap_at_m(state.screw_m);
        gaps_m += gap_m;
        steps += 1;
        let (next_buffet_n, next_shake_m) = (buffet.next(), shake.next());
        let middle_m = state.screw_m + 0.5 * STEP_S * state.screw_m_per_s;
        let middle_buffet_n = 0.5 * (buffet_n + next_buffet_n);
        let forces = Forces {
            drive_n: motor.force_n(commands.at(now_s).command_m, state.motor_m, state.motor_m_per_s, STEP_S),
            load_n: load_n(&commands, now_s + 0.5 * STEP_S, middle_m) + middle_buffet_n,
            shake_m,
            shake_m_per_s: (next_shake_m - shake_m) / STEP_S,
        };
        state = advance(&now.with_gap_m(gap_m), &state, forces, STEP_S);
        (buffet_n, shake_m) = (next_buffet_n, next_shake_m);
        let air_n = load_n(&commands, now_s + STEP_S, state.screw_m);
        let next = [state.motor_m + shake_m, state.screw_m, air_n + buffet_n];
        for ((sampler, before), after) in samplers.iter_mut().zip(reading).zip(next) {
            sampler.pass(now_s, before, after);
        }
        reading = next;
    }
    let mean_m = if plant.contact.worn_m > 0.0 { gaps_m / steps as f64 } else { plant.contact.gap_m };
    (samplers.map(ChannelSampler::into_samples), mean_m)
}

/// The aerodynamic load at a deflection, N.
fn load_n(commands: &CommandProfile, time_s: f64, deflection_m: f64) -> f64 {
    let here = commands.at(time_s);
    here.air_n - here.hinge_n_per_m * deflection_m
}
