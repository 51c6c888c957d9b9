//! The gap of a flight in a CSV file: the paper's statistic and the contact regression.
//!
//! ```text
//! cargo run -p estimator --example batch_from_csv -- flight.csv
//! ```
//! The file has a header and the columns time [s], motor position [m], screw position [m], load [N]; positions are at
//! the screw axis, and an empty cell is a missing sample. Rows are evenly spaced.

#![allow(clippy::print_stdout, reason = "an example prints")]

use std::error::Error;

use estimator::contact::{self, ContactOutcome, PartPrior};
use estimator::{ActuatorModel, Filter, NoiseModel, Samples, SensorNoise, midrange};

/// Stiffness of the part, N/m.
const STIFFNESS_N_PER_M: f64 = 5e7;

/// ΔS of the paper, m, and the contact regression of a flight.
fn gaps(text: &str) -> Result<(f64, ContactOutcome), Box<dyn Error>> {
    let [mut time_s, mut motor_m, mut dx_m, mut load_n] = [const { Vec::<f64>::new() }; 4];
    for (number, line) in text.lines().enumerate().skip(1) {
        let cell = |cell: &str| if cell.trim().is_empty() { Ok(f64::NAN) } else { cell.trim().parse() };
        let row: Result<Vec<f64>, _> = line.split(',').map(cell).collect();
        let [time, motor, screw, load] = row.map_err(|error| format!("line {}: {error}", number + 1))?[..]
        else {
            return Err(format!("line {}: four cells are needed", number + 1).into());
        };
        time_s.push(time);
        motor_m.push(motor);
        dx_m.push(screw - motor);
        load_n.push(load);
    }
    let (Some(first), Some(last)) = (time_s.first(), time_s.last()) else {
        return Err("the file has no rows".into());
    };
    let step_s = (last - first) / (time_s.len() - 1).max(1) as f64;
    let whole = 0..dx_m.len();
    let segments = std::slice::from_ref(&whole);
    let samples = Samples { step_s, motor_m: &motor_m, dx_m: &dx_m, load_n: &load_n, segments };
    let actuator = ActuatorModel::linear(STIFFNESS_N_PER_M, 2000.0, 8.0)?;
    let noise = NoiseModel::Sensors(SensorNoise {
        screw_rms_m: 3e-6,
        screw_resolution_m: 2e-6,
        motor_rms_m: 1e-6,
        motor_resolution_m: 3e-7,
        unknown_force_n: 200.0,
        bandwidth_hz: 10.0,
    });
    let published = midrange::estimate(&samples, &Filter::new(&actuator, step_s, &noise)?)?;
    Ok((published.gap.gap_m, contact::estimate(&samples, &PartPrior::of_stiffness(STIFFNESS_N_PER_M))?))
}

fn main() -> Result<(), Box<dyn Error>> {
    let file = std::env::args().nth(1).ok_or("name a CSV file")?;
    let (published_m, contact) = gaps(&std::fs::read_to_string(file)?)?;
    println!("mid-range of the paper: {:.1} µm", 1e6 * published_m);
    match contact {
        Ok(gap) => {
            println!("contact regression: {:.1} ± {:.1} µm", 1e6 * gap.gap_m, 1e6 * gap.gap_se_m);
        }
        Err(why) => println!("contact regression: {}; {}", why.code(), why.remedy()),
    }
    Ok(())
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]
mod tests {
    use std::fmt::Write as _;

    use simulator::{Plant, Profile, Sensors, simulate};

    use super::*;

    #[test]
    fn a_simulated_flight_of_100_um_is_read_back_from_csv() {
        let plant = Plant::default().with_gap_m(100e-6);
        let profile = Profile { duration_s: 60.0, ..Profile::default() };
        let flight = simulate(&plant, &profile, &Sensors::default(), 5).unwrap();
        let mut text = "time_s,motor_m,screw_m,load_n\n".to_owned();
        for k in 0..flight.time_s.len() {
            let cells = [flight.time_s[k], flight.motor_m[k], flight.screw_m[k], flight.load_n[k]];
            writeln!(text, "{}", cells.map(|cell| format!("{cell:e}")).join(",")).unwrap();
        }
        let (published_m, outcome) = gaps(&text).unwrap();
        let gap = outcome.unwrap();
        assert!((published_m - 100e-6).abs() < 4e-6, "{published_m}");
        assert!((gap.gap_m - 100e-6).abs() < 4.0 * gap.gap_se_m && gap.gap_se_m < 2e-6, "{gap:?}");
    }

    #[test]
    fn a_row_that_is_not_numbers_is_named() {
        let error = gaps("t,m,s,f\n0,1,2,3\n0.1,x,2,3\n").err().unwrap();
        assert!(error.to_string().starts_with("line 3"), "{error}");
    }
}
