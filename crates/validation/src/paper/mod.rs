//! The paper reproduced: its figures 2 to 7 and its claims, on simulated operational flights of known gap.

mod claims;
mod figures;
mod page;
#[cfg(test)]
mod tests;

pub(crate) use claims::Claims;
pub(crate) use figures::pictures;
pub(crate) use page::page;

use estimator::{ActuatorModel, Filter, KalmanState, NoiseModel};
use simulator::{Contact, Flight, Plant, Profile, Sensors, simulate};

use crate::methods::expected_noise;

/// True gap of the flights, m.
const GAP_M: f64 = 100e-6;

/// An operational flight of the nominal actuator: 120 s, 250 samples a second, loads to about ± 8 kN.
fn fly(plant: &Plant, sensors: &Sensors, seed: u64) -> Result<Flight, simulator::Error> {
    let profile = Profile { duration_s: 120.0, ..Profile::default() };
    simulate(&plant.with_gap_m(GAP_M), &profile, sensors, seed)
}

/// The filter of an actuator as it is assumed, with W_d times a factor and V_d as it is.
fn filter(assumed: &Plant, w_d_factor: f64, sensors: &Sensors) -> Result<Filter, estimator::Error> {
    let Contact { stiffness_n_per_m, damping_n_s_per_m, .. } = assumed.contact;
    let actuator = ActuatorModel::linear(stiffness_n_per_m, damping_n_s_per_m, assumed.screw_mass_kg)?;
    let usual = Filter::new(&actuator, STEP_S, &expected_noise(sensors))?;
    let (w_d, v_d_m2) = (usual.noise().w_d * w_d_factor, usual.noise().v_d_m2);
    Filter::new(&actuator, STEP_S, &NoiseModel::PerStep { w_d, v_d_m2 })
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

/// Step of the flights, s.
const STEP_S: f64 = 0.004;
