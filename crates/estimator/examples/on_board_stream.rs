//! Samples filtered as they arrive, as a controller does it at 1 kHz: no allocation, no loop over data.
//!
//! ```text
//! cargo run -p estimator --example on_board_stream
//! ```
//! `tests/on_board` is the same on a Cortex-M controller.

#![allow(clippy::print_stdout, reason = "an example prints")]

use estimator::{ActuatorModel, Error, Filter, NoiseModel, SensorNoise, Stream, StreamingGap};

/// Samples per second.
const RATE_HZ: f64 = 1000.0;
/// Width of a bin of the running gap, m.
const BIN_M: f64 = 2e-6;

/// What a controller keeps for an actuator.
struct Monitor {
    stream: Stream,
    gap: StreamingGap<256>,
}

impl Monitor {
    fn new() -> Result<Self, Error> {
        let actuator = ActuatorModel::linear(5e7, 2000.0, 8.0)?;
        let noise = NoiseModel::Sensors(SensorNoise {
            screw_rms_m: 3e-6,
            screw_resolution_m: 2e-6,
            motor_rms_m: 1e-6,
            motor_resolution_m: 3e-7,
            unknown_force_n: 200.0,
            bandwidth_hz: 10.0,
        });
        let filter = Filter::new(&actuator, RATE_HZ.recip(), &noise)?;
        Ok(Self { stream: Stream::constant_time(&filter), gap: StreamingGap::new(BIN_M)? })
    }

    /// One sample: positions at the screw axis, m, and the load, N. Returns S, m.
    fn step(&mut self, motor_m: f64, screw_m: f64, load_n: f64) -> Result<f64, Error> {
        let s_m = self.stream.push(screw_m - motor_m, load_n)?.s_m();
        self.gap.push(s_m);
        Ok(s_m)
    }
}

/// Ten seconds of a gap of 80 µm under a load of ± 8 kN at 0.5 Hz; the running gap, m.
fn fly() -> Result<f64, Error> {
    let mut monitor = Monitor::new()?;
    for k in 0..10_000 {
        let time_s = f64::from(k) / RATE_HZ;
        let load_n = 8e3 * (std::f64::consts::PI * time_s).sin();
        let motor_m = 0.01 * (0.3 * time_s).sin();
        let screw_m = motor_m + load_n / 5e7 + 40e-6 * load_n.signum();
        monitor.step(motor_m, screw_m, load_n)?;
    }
    Ok(monitor.gap.read()?.gap_m)
}

fn main() -> Result<(), Error> {
    println!("running gap: {:.1} µm", 1e6 * fly()?);
    Ok(())
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_running_gap_is_that_of_the_flight() {
        assert!(super::fly().is_ok_and(|gap_m| (gap_m - 80e-6).abs() < 4e-6));
    }
}
