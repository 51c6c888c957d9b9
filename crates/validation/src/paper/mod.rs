//! The paper reproduced: its figures 2 to 7 and its claims, on simulated operational flights of known gap.

mod claims;
mod figures;
mod page;

pub use claims::Claims;
pub use figures::pictures;
pub use page::page;

use estimator::gap::{GapStatistic, mid_range};
use estimator::{ActuatorModel, Filter, KalmanState, NoiseModel};
use simulator::{Flight, Plant, Profile, Sensors, simulate};

use crate::methods::expected_noise;

/// True gap of the flights, m.
const GAP_M: f64 = 100e-6;

/// An operational flight of the nominal actuator: 120 s, 250 samples a second, loads to about ± 8 kN.
fn fly(plant: &Plant, sensors: &Sensors, seed: u64) -> Result<Flight, simulator::Error> {
    let profile = Profile { duration_s: 120.0, ..Profile::default() };
    simulate(&plant.with_gap_m(GAP_M), &profile, sensors, seed)
}

/// What is assumed of actuator and noise, each as a factor on what is true.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Assumed {
    /// Of the stiffness K.
    stiffness: f64,
    /// Of the damping f.
    damping: f64,
    /// Of the screw's mass m_s.
    mass: f64,
    /// Of W_d, with V_d as it is.
    process_noise: f64,
}

impl Default for Assumed {
    /// All is known.
    fn default() -> Self {
        Self { stiffness: 1.0, damping: 1.0, mass: 1.0, process_noise: 1.0 }
    }
}

/// The filter of the nominal actuator under assumptions, at a step, s.
fn filter(assumed: Assumed, sensors: &Sensors, step_s: f64) -> Result<Filter, estimator::Error> {
    let plant = Plant::default();
    let actuator = ActuatorModel::linear(
        plant.contact.stiffness_n_per_m * assumed.stiffness,
        plant.contact.damping_n_s_per_m * assumed.damping,
        plant.screw_mass_kg * assumed.mass,
    )?;
    let usual = Filter::new(&actuator, step_s, &expected_noise(sensors))?;
    let given =
        NoiseModel::PerStep { w_d: usual.noise().w_d * assumed.process_noise, v_d_m2: usual.noise().v_d_m2 };
    Filter::new(&actuator, step_s, &given)
}

/// Relative position δX of a flight, m.
fn relative_position_m(flight: &Flight) -> Vec<f64> {
    flight.screw_m.iter().zip(&flight.motor_m).map(|(screw, motor)| screw - motor).collect()
}

/// The state after each sample (24–28), from a given initial state or the filter's own.
fn states(
    filter: &Filter,
    flight: &Flight,
    start: Option<KalmanState>,
) -> Result<Vec<KalmanState>, estimator::Error> {
    let y_m = relative_position_m(flight);
    let mut state = start.unwrap_or_else(|| filter.initial_state(y_m[0], flight.load_n[0]));
    let mut all = Vec::with_capacity(y_m.len());
    for (k, y_m) in y_m.into_iter().enumerate() {
        if k > 0 {
            state = filter.predict(&state, flight.load_n[k - 1]);
        }
        state = filter.update(&state, y_m)?.posterior;
        all.push(state);
    }
    Ok(all)
}

/// S at each sample, m.
fn backlash_m(states: &[KalmanState]) -> Vec<f64> {
    states.iter().map(|state| state.x[2]).collect()
}

/// ΔS of a flight (29–31).
fn gap(filter: &Filter, flight: &Flight) -> Result<GapStatistic, estimator::Error> {
    mid_range(&backlash_m(&states(filter, flight, None)?))
}

/// Step of the flights, s.
const STEP_S: f64 = 0.004;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_states_are_those_of_the_stream() {
        let sensors = Sensors::default();
        let flight = simulate(
            &Plant::default().with_gap_m(GAP_M),
            &Profile { duration_s: 5.0, ..Profile::default() },
            &sensors,
            3,
        )
        .unwrap();
        let filter = filter(Assumed::default(), &sensors, STEP_S).unwrap();
        let mut stream = estimator::Stream::constant_time(&filter);
        let y_m = relative_position_m(&flight);
        for (k, state) in states(&filter, &flight, None).unwrap().iter().enumerate() {
            assert_eq!(stream.push(y_m[k], flight.load_n[k]).unwrap().x, state.x);
        }
    }
}
