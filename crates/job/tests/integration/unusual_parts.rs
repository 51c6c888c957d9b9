//! Logs and parts at the edge of what can be estimated: slow logs, and outputs that cannot move.

use ingest::log::in_memory::ChannelArrays;
use job::estimate::{estimate, filter};
use job::{Config, flight_log};
use records::{PartNumber, Position};

use crate::fixtures::{flights, open};

fn config_text() -> String {
    std::fs::read_to_string(flights().join("pipeline.toml")).unwrap()
}

fn parse(text: &str) -> Config {
    Config::parse(text, &flights().join("pipeline.toml"), &flights()).unwrap()
}

/// One sample a second: the flight is rejected for its rate, before any noise model is made.
#[test]
fn a_slow_log_is_rejected_for_its_rate() {
    let config = parse(&config_text());
    let part = flight_log::part_of(&config, &PartNumber::new("A").unwrap()).unwrap();
    let time_s: Vec<f64> = (0..600).map(f64::from).collect();
    let wave = |amplitude: f64, phase: f64| -> Vec<f64> {
        time_s.iter().map(|t| amplitude * (0.05 * t + phase).sin()).collect()
    };
    let (motor_m, screw_m, load_n) = (wave(0.03, 0.0), wave(0.03, 1e-3), wave(8e3, 0.5));
    let arrays = ChannelArrays { time_s: &time_s, motor_m: &motor_m, screw_m: &screw_m, load_n: &load_n };
    let channels = arrays.to_channels(Position::new("rudder").unwrap()).unwrap();
    let found = estimate(&channels, part, &config.document.estimate).unwrap();
    assert_eq!(found.reason.as_deref(), Some("rate_too_low"));
    assert_eq!(filter(&channels, part).unwrap_err().code, "rate_too_low");
}

/// The configuration has no screw channel: δX is minus the motor position, and a screw position that is always zero does
/// not reject the flight.
#[test]
fn the_logs_of_a_locked_output_need_no_screw_position() {
    let screw = "[channel.screw_position]\ncolumn = \"screw_position_m\"\nunit = \"m\"\n";
    let text = config_text();
    assert!(text.contains(screw));
    let without = text.replace(screw, "");
    let broken = Config::parse(&without, &flights().join("pipeline.toml"), &flights()).unwrap_err();
    assert_eq!(broken[0].code, "key_missing");
    let config = parse(&without.replace("[part.A]\n", "[part.A]\noutput = \"locked\"\n"));
    let opened = open("A_nominal", &config).unwrap();
    let part = flight_log::part_of(&config, &PartNumber::new("A").unwrap()).unwrap();
    assert!(part.settings.output.is_locked());
    let at = opened.actuators().next().unwrap();
    let channels = opened.channels(at, part).unwrap();
    let is_minus_motor = |(dx, motor): (&f64, &f64)| dx.to_bits() == (0.0 - motor).to_bits();
    assert!(channels.output_locked && channels.dx_m.iter().zip(&channels.motor_m).all(is_minus_motor));
    let found = estimate(&channels, part, &config.document.estimate).unwrap();
    assert_ne!(found.reason.as_deref(), Some("channel_zero"));
    assert!(
        open("B_worn_stiffness_assumed_15pc_high", &config).is_err(),
        "part B moves, and its screw is not mapped"
    );
}
