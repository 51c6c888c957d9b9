//! An actuator's channels from the raw ones: quality, frozen samples, relative position, held load.

use std::ops::Range;

use records::Position;

use crate::channel::quality::{self, Quality};
use crate::channel::stats::span;
use crate::channel::turns::restore_turns;
use crate::log::channel_reader::Channel;
use crate::log::selection::SampleSelection;
use crate::log::types::ActuatorChannels;
use crate::mapping::{Channels, Role};
use crate::time::clock::TimeBase;
use crate::time::slow_channel::join_samples;
use crate::time::zero_order_hold::zero_order_hold;

/// Looks at the channels that were read on one clock, leaves out what a frozen one claims, and makes δX.
pub(crate) fn assemble(
    position: Position,
    [mut motor, mut screw, load]: [Channel; 3],
    channels: &Channels,
    SampleSelection { segments, excluded }: SampleSelection,
    base: &TimeBase,
    temperature_c: Option<f64>,
) -> ActuatorChannels {
    let (is_relative, output_locked) = (channels.is_relative(), channels.output.is_locked());
    let read = Role::NEEDED.iter().zip([&motor, &screw, &load]);
    let alternatives = read.filter(|(_, channel)| channel.is_alternative);
    let mut flags: Vec<String> =
        alternatives.map(|(role, _)| format!("{}_alternative", role.as_str())).collect();
    if !is_relative {
        flags.extend(restored(Role::Motor, &mut motor, &screw, &load, &segments));
        flags.extend(restored(Role::Screw, &mut screw, &motor, &load, &segments));
    }
    let quality = [&motor, &screw, &load]
        .map(|read| Quality::of(&read.values, &segments, read.seen, base.step_s, excluded));
    let columns = [motor.column, screw.column, load.column];
    let (mut motor_m, mut dx_m, mut load_n) = (motor.values, screw.values, load.values);
    flags.extend(quality::quality_flags(&quality, base.step_s));
    if !is_relative && !output_locked {
        let longest = quality[0].longest_run.max(quality[1].longest_run);
        flags.extend(quality::drop_frozen_samples(&mut motor_m, &mut dx_m, longest, base.step_s));
    }
    if !is_relative {
        join_samples(&mut dx_m, &segments);
    }
    join_samples(&mut motor_m, &segments);
    let (travel_m, missing) = relative(&motor_m, &mut dx_m, is_relative);
    flags.extend(quality::coarse_resolution(&quality, travel_m));
    flags.extend(quality::load_frozen(&load_n, &motor_m, quality[2].longest_run, base.step_s));
    let is_whole = quality[2].missing_share == 0.0;
    let segments = if is_whole {
        segments.into_iter().filter(|segment| !segment.is_empty()).collect()
    } else {
        zero_order_hold(&mut load_n, &segments, base.step_s)
    };
    join_samples(&mut load_n, &segments);
    ActuatorChannels {
        position,
        step_s: base.step_s,
        missing_share: (missing - excluded) as f64 / (dx_m.len() - excluded).max(1) as f64,
        excluded,
        output_locked,
        motor_m,
        dx_m,
        load_n,
        segments,
        breaks: base.breaks.clone(),
        temperature_c,
        columns,
        quality,
        flags,
        repairs: base.repairs,
    }
}

/// Restores the turns of a wrapped position by the other one; returns a flag where some samples stay unclear.
fn restored(
    role: Role,
    own: &mut Channel,
    other: &Channel,
    load: &Channel,
    segments: &[Range<usize>],
) -> Option<String> {
    let turn_m = own.turn_m?;
    let mut other_m = other.values.clone();
    join_samples(&mut other_m, segments);
    let unclear = restore_turns(&mut own.values, turn_m, &other_m, &load.values, segments);
    (unclear > 0).then(|| format!("{}_turns_unclear", role.as_str()))
}

/// Makes δX of the screw's position, or leaves it where it is one already; NaN where the motor's is missing. Returns its
/// travel, m, and how many samples are missing.
fn relative(motor_m: &[f64], screw_m: &mut [f64], is_relative: bool) -> (f64, usize) {
    const BATCH: usize = 4096;
    let (mut low_m, mut high_m, mut missing) = (f64::INFINITY, f64::NEG_INFINITY, 0);
    for (screw_m, motor_m) in screw_m.chunks_mut(BATCH).zip(motor_m.chunks(BATCH)) {
        let pairs = screw_m.iter_mut().zip(motor_m);
        if is_relative {
            pairs.filter(|(_, motor)| motor.is_nan()).for_each(|(dx, _)| *dx = f64::NAN);
        } else {
            pairs.for_each(|(screw, motor)| *screw -= motor);
        }
        let (low, high) = span(screw_m);
        (low_m, high_m) = (low_m.min(low), high_m.max(high));
        missing += screw_m.iter().filter(|dx| dx.is_nan()).count();
    }
    (high_m - low_m, missing)
}

/// Mean of the values that are not missing.
pub(crate) fn mean(values: &[f64]) -> Option<f64> {
    let (sum, count) = values.iter().filter(|v| !v.is_nan()).fold((0.0, 0_u64), |(s, n), v| (s + v, n + 1));
    (count > 0).then(|| sum / count as f64)
}
