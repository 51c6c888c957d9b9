//! The methods compared: contact regression, the paper's statistic and two baselines.

use estimator::SensorNoise;
use estimator::contact::{self, ContactOutcome, PartPrior};
use estimator::{ActuatorModel, Filter, NoiseModel, Samples, midrange};

use crate::scenarios::{Case, Class};

/// The results of every method for one flight, m; NaN where a method gave no number.
#[derive(Debug, Clone)]
pub struct MethodResults {
    /// The true gap, extrapolated from the stiff part of the flanks.
    pub truth_m: f64,
    /// Contact regression, with its bounds.
    pub contact: Option<(f64, f64, f64)>,
    /// Its refusal or flags.
    pub codes: Vec<&'static str>,
    /// By method: see [`METHODS`].
    pub by_method_m: [f64; METHODS.len()],
}

/// The methods compared, ours first.
pub const METHODS: [&str; 4] = ["contact regression", "paper (29–31)", "load lines", "P99 − P1 of δX"];

/// The friction that a fleet expects, N.
const UNKNOWN_FORCE_N: f64 = 200.0;

/// Flies a flight of a class and applies every method.
///
/// # Errors
/// The simulator's or the estimator's error as text, after the name of the class.
pub fn estimate_flight(class: &Class, index: u64) -> Result<MethodResults, String> {
    let flown = class.fly(index).map_err(|e| format!("{} {index}: {e}", class.name))?;
    let flight = &flown.flight;
    let dx_m: Vec<f64> = flight.screw_m.iter().zip(&flight.motor_m).map(|(s, m)| s - m).collect();
    let whole = 0..dx_m.len();
    let samples = Samples {
        step_s: flown.case.profile.sample_rate_hz.recip(),
        motor_m: &flight.motor_m,
        dx_m: &dx_m,
        load_n: &flight.load_n,
        segments: std::slice::from_ref(&whole),
    };
    let truth_m = flown.extrapolated_gap_m;
    apply_methods(&flown.case, truth_m, &samples).map_err(|e| format!("{} {index}: {e}", class.name))
}

fn apply_methods(
    case: &Case,
    truth_m: f64,
    samples: &Samples<'_>,
) -> Result<MethodResults, estimator::Error> {
    let stiffness_n_per_m = case.assumed_stiffness_n_per_m();
    let prior =
        PartPrior { stiffness_n_per_m, reference_load_n: None, unknown_force_n: Some(UNKNOWN_FORCE_N) };
    let outcome = contact::estimate(samples, &prior)?;
    let filter = filter(case, samples.step_s, stiffness_n_per_m)?;
    let midrange_m = midrange::estimate(samples, &filter).map_or(f64::NAN, |found| found.gap.gap_m);
    let (contact, codes) = match &outcome {
        ContactOutcome::Estimated(gap) => (
            Some((gap.gap_m, gap.gap_bounds_m.0, gap.gap_bounds_m.1)),
            gap.flags.iter().map(|flag| flag.code()).collect(),
        ),
        ContactOutcome::Refused(refusal) => (None, vec![refusal.code()]),
    };
    let ours_m = contact.map_or(f64::NAN, |(gap_m, ..)| gap_m);
    let lines_m = load_lines_m(samples.dx_m, samples.load_n);
    let spread_m = spread_m(samples.dx_m);
    Ok(MethodResults { truth_m, contact, codes, by_method_m: [ours_m, midrange_m, lines_m, spread_m] })
}

fn filter(case: &Case, step_s: f64, stiffness_n_per_m: f64) -> Result<Filter, estimator::Error> {
    let noise = SensorNoise {
        screw_rms_m: case.sensors.screw.noise_rms,
        screw_resolution_m: case.sensors.screw.resolution,
        motor_rms_m: case.sensors.motor.noise_rms,
        motor_resolution_m: case.sensors.motor.resolution,
        unknown_force_n: UNKNOWN_FORCE_N,
        bandwidth_hz: 10.0,
    };
    Filter::new(&ActuatorModel::linear(stiffness_n_per_m, 2000.0, 8.0)?, step_s, &NoiseModel::Sensors(noise))
}

/// A baseline: δX on F by least squares on each side of the load, beyond a tenth of its greatest; the
/// difference of the intercepts.
pub fn load_lines_m(dx_m: &[f64], load_n: &[f64]) -> f64 {
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
pub fn spread_m(dx_m: &[f64]) -> f64 {
    let mut sorted: Vec<f64> = dx_m.iter().copied().filter(|y| y.is_finite()).collect();
    if sorted.is_empty() {
        return f64::NAN;
    }
    sorted.sort_unstable_by(f64::total_cmp);
    sorted[(sorted.len() - 1) * 99 / 100] - sorted[(sorted.len() - 1) / 100]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn load_lines_read_the_gap_off_two_straight_flanks() {
        let load_n: Vec<f64> = (-50..=50).map(|k| 100.0 * f64::from(k)).collect();
        let dx_m: Vec<f64> = load_n.iter().map(|f| f / 5e7 + 40e-6 * f.signum()).collect();
        assert!((load_lines_m(&dx_m, &load_n) - 80e-6).abs() < 1e-12);
    }

    #[test]
    fn the_spread_passes_over_missing_samples() {
        let mut dx_m: Vec<f64> = (0..=100).map(f64::from).collect();
        dx_m.push(f64::NAN);
        assert!((spread_m(&dx_m) - 98.0).abs() < 1e-12 && spread_m(&[f64::NAN]).is_nan());
    }
}
