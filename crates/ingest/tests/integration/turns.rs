//! Wrapped motor angles of simulated flights, whose recorder pauses or marks samples as invalid: the relative position
//! keeps the turn of the simulator.

use ingest::mapping::units::Unit;
use ingest::{ActuatorChannels, ChannelMapping, Geometry};
use simulator::{Flight, Plant, Profile, Sensors, simulate};

use crate::layouts::{LINEAR, channel, mapping, read_with, reals, written};

/// That of [`LINEAR`].
const LEAD_M: f64 = 0.005;
const RADIUS_M: f64 = 0.1;
const GEAR: f64 = 120.0;

/// How the recorder loses samples.
#[derive(Debug, Clone, Copy)]
enum Loss {
    RowsMissing,
    MotorMissing,
    MarkedInvalid,
}

/// The flight as an actuator that pushes or turns logs it, with its rows that are not lost, and as it is read back.
fn read(flight: &Flight, is_rotary: bool, loss: Option<(Loss, usize)>) -> (Vec<usize>, ActuatorChannels) {
    let rows = flight.time_s.len();
    let is_lost = |k: usize| loss.is_some_and(|(_, length)| k % (rows / 7) > rows / 7 - length);
    let kind = loss.map(|(kind, _)| kind);
    let kept: Vec<usize> =
        (0..rows).filter(|&k| !(matches!(kind, Some(Loss::RowsMissing)) && is_lost(k))).collect();
    let of = |value: &dyn Fn(usize) -> f64| reals(kept.iter().map(|&k| value(k)));
    let turns = |k: usize| {
        flight.motor_m[k] / if is_rotary { RADIUS_M / GEAR * std::f64::consts::TAU } else { LEAD_M }
    };
    let angle =
        |k: usize| if loss.is_some() { (turns(k) * 360.0).rem_euclid(360.0) } else { turns(k) * 360.0 };
    let motor = |k: usize| match kind {
        Some(Loss::MotorMissing) if is_lost(k) => f64::NAN,
        Some(Loss::MarkedInvalid) if is_lost(k) => 123.0,
        _ => angle(k),
    };
    let screw =
        |k: usize| if is_rotary { (flight.screw_m[k] / RADIUS_M).to_degrees() } else { flight.screw_m[k] };
    let load = |k: usize| flight.load_n[k] * if is_rotary { RADIUS_M } else { 1.0 };
    let columns = [
        ("t", of(&|k| flight.time_s[k])),
        ("m", of(&motor)),
        ("s", of(&screw)),
        ("f", of(&load)),
        ("ok", of(&|k| f64::from(u8::from(!is_lost(k))))),
    ];
    let (screw, load) =
        if is_rotary { (Unit::Degree, Unit::NewtonMetre) } else { (Unit::Metre, Unit::Newton) };
    let wrapped = ChannelMapping {
        wraps_at: loss.map(|_| 360.0),
        gear_ratio: if is_rotary { GEAR } else { 1.0 },
        valid_column: matches!(kind, Some(Loss::MarkedInvalid)).then(|| "ok".to_owned()),
        ..channel("m", Unit::Degree)
    };
    let mapping = mapping(wrapped, channel("s", screw), channel("f", load));
    let (_dir, file) = written(&columns);
    let geometry = if is_rotary { Geometry::Rotary { reference_radius_m: RADIUS_M } } else { LINEAR };
    (kept, read_with(&file, &mapping, geometry).unwrap())
}

#[test]
fn no_turn_is_lost_while_the_recorder_pauses() {
    // The screw is logged late by some samples, which the mapping does not say.
    for (rate_hz, stroke_m, late) in [(50.0, 0.03, 1), (100.0, 0.09, 0), (250.0, 0.03, 3)] {
        let profile = Profile { duration_s: 60.0, sample_rate_hz: rate_hz, stroke_m, ..Profile::default() };
        let mut flight = simulate(&Plant::default(), &profile, &Sensors::default(), 7).unwrap();
        flight.screw_m.rotate_right(late);
        flight.screw_m[..late].fill(f64::NAN);
        for is_rotary in [false, true] {
            let (_, truth) = read(&flight, is_rotary, None);
            for kind in [Loss::RowsMissing, Loss::MotorMissing, Loss::MarkedInvalid] {
                for length_s in [0.05, 0.4, 3.0] {
                    let length = (length_s * rate_hz) as usize + 1;
                    let case = format!("{rate_hz} Hz, rotary {is_rotary}, {kind:?} for {length_s} s");
                    let (kept, found) = read(&flight, is_rotary, Some((kind, length)));
                    assert!(
                        found.flags.iter().all(|flag| !flag.contains("turns")),
                        "{case}: {:?}",
                        found.flags
                    );
                    let known: Vec<usize> = (0..kept.len()).filter(|&k| !found.dx_m[k].is_nan()).collect();
                    assert!(known.len() + 8 * length > truth.dx_m.len(), "{case}: {} samples", known.len());
                    let offset_m = found.dx_m[known[0]] - truth.dx_m[kept[known[0]]];
                    let apart_m = |k: usize| (found.dx_m[k] - truth.dx_m[kept[k]] - offset_m).abs();
                    let worst_m = known.into_iter().map(apart_m).fold(0.0, f64::max);
                    assert!(worst_m < 1e-9, "{case}: {worst_m} m");
                }
            }
        }
    }
}
