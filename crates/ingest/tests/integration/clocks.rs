//! Channels with clocks, rates, latencies and quality flags of their own, on the motor's clock.

use std::sync::Arc;

use arrow::array::{
    ArrayRef, BooleanArray, DurationMicrosecondArray, Float64Array, Int16Array, Int64Array, StringArray,
    Time32MillisecondArray, UInt16Array, UInt64Array,
};
use ingest::mapping::Epoch;
use ingest::mapping::units::{TimeUnit, Unit};
use ingest::{ActuatorChannels, ChannelMapping, Error, Geometry, Mapping, RawValue};

use crate::layouts::{self, channel, opened, place, plain, write};

const STEP_S: f64 = 0.01;
const ROWS: usize = 1000;

fn reals(of: impl Fn(f64) -> f64) -> ArrayRef {
    Arc::new((0..ROWS).map(|k| of(k as f64 * STEP_S)).collect::<Float64Array>())
}

fn holed(of: impl Fn(usize) -> Option<f64>) -> ArrayRef {
    Arc::new((0..ROWS).map(of).collect::<Float64Array>())
}

/// A slow motion, m: over one step a straight line is right to 1e-9.
fn motor(t: f64) -> f64 {
    0.03 * (0.4 * t).sin()
}

fn screw(t: f64) -> f64 {
    motor(t) + 5e-5 * (1.3 * t).cos()
}

fn columns() -> Vec<(&'static str, ArrayRef)> {
    vec![("t", reals(|t| t)), ("m", reals(motor)), ("s", reals(screw)), ("f", reals(|t| 1e3 * t.cos()))]
}

fn read(mapping: &Mapping, columns: &[(&str, ArrayRef)]) -> Result<ActuatorChannels, Error> {
    let (_dir, file) = place("N1_20261119T041300Z.parquet");
    write(&file, columns);
    layouts::read(&file, mapping, Geometry::Linear { lead_m_per_rev: None })
}

fn with(
    mut columns: Vec<(&'static str, ArrayRef)>,
    name: &'static str,
    array: ArrayRef,
) -> Vec<(&'static str, ArrayRef)> {
    columns.retain(|(other, _)| *other != name);
    columns.push((name, array));
    columns
}

/// The largest distance of δX from what it was, over samples that have one; and how many do.
fn worst(a: &ActuatorChannels) -> (f64, usize) {
    let dx = |k: usize| (a.dx_m[k] - (screw(k as f64 * STEP_S) - motor(k as f64 * STEP_S))).abs();
    let known: Vec<usize> = (0..a.dx_m.len()).filter(|&k| !a.dx_m[k].is_nan()).collect();
    (known.iter().map(|&k| dx(k)).fold(0.0, f64::max), known.len())
}

#[test]
fn even_channels_pass_untouched() {
    let a = read(&plain(), &columns()).unwrap();
    let bits = (0..ROWS).all(|k| a.motor_m[k].to_bits() == motor(k as f64 * STEP_S).to_bits());
    assert!(bits && a.flags.is_empty(), "{:?}", a.flags);
}

#[test]
fn a_known_latency_is_taken_away() {
    for (latency_s, instant_s) in [(0.005, 0.0), (0.020, 0.0), (0.0, 0.004), (0.013, 0.003)] {
        let late = reals(|t| screw(t - latency_s + instant_s));
        let mut m = plain();
        m.channels.screw_position =
            Some(ChannelMapping { latency_s, instant_s, ..channel("s", Unit::Metre) });
        let (error_m, known) = worst(&read(&m, &with(columns(), "s", late)).unwrap());
        assert!(
            error_m < 1e-7 && known >= ROWS - 4,
            "{latency_s} s, {instant_s} s: {error_m} m, {known} samples"
        );
    }
}

#[test]
fn a_channel_with_its_own_time_column_is_brought_to_the_motors_instants() {
    let mut m = plain();
    m.channels.screw_position =
        Some(ChannelMapping { time_column: Some("ts".into()), ..channel("s", Unit::Metre) });
    let own = |t: f64| 1.003 * t + 0.0042;
    let columns = with(with(columns(), "s", reals(|t| screw(own(t)))), "ts", reals(own));
    let (error_m, known) = worst(&read(&m, &columns).unwrap());
    assert!(error_m < 1e-7 && known > ROWS - 4, "{error_m} m, {known} samples");
}

#[test]
fn a_slower_position_is_joined_by_lines_and_a_slower_load_is_held() {
    for repeated in [false, true] {
        let mut m = plain();
        m.channels.screw_position = Some(ChannelMapping { rate_hz: Some(50.0), ..channel("s", Unit::Metre) });
        let at = |k: usize| if repeated { Some(k / 2 * 2) } else { k.is_multiple_of(2).then_some(k) };
        let slow = |of: fn(f64) -> f64| holed(move |k| at(k).map(|k| of(k as f64 * STEP_S)));
        let a = read(&m, &with(columns(), "s", slow(screw))).unwrap();
        let (error_m, known) = worst(&a);
        assert!(error_m < 1e-6 && known >= ROWS - 1, "repeated {repeated}: {error_m} m, {known} samples");
    }
    let load = holed(|k| k.is_multiple_of(10).then_some(k as f64));
    let a = read(&plain(), &with(columns(), "f", load)).unwrap();
    assert_eq!((a.load_n[25], a.segments.len(), a.segments[0].len()), (20.0, 1, ROWS));
}

#[test]
fn a_hole_is_never_bridged() {
    let mut m = plain();
    m.channels.screw_position = Some(ChannelMapping { latency_s: 0.005, ..channel("s", Unit::Metre) });
    let late = holed(|k| (!(300..320).contains(&k)).then(|| screw(k as f64 * STEP_S - 0.005)));
    let a = read(&m, &with(columns(), "s", late)).unwrap();
    assert!(a.dx_m[300..318].iter().all(|dx| dx.is_nan()), "{:?}", &a.dx_m[298..322]);
    assert!(worst(&a).0 < 1e-7);
}

#[test]
fn the_redundant_channel_that_lives_is_taken() {
    let dead: [(&str, ArrayRef); 3] = [
        ("nan", holed(|_| None)),
        ("stuck", reals(|_| 0.0)),
        ("half", holed(|k| (k > 600).then_some(k as f64))),
    ];
    for (why, first) in dead {
        let mut m = plain();
        m.channels.screw_position = Some(ChannelMapping {
            alternatives: vec![ChannelMapping { sign: -1, ..channel("s2", Unit::Millimetre) }],
            ..channel("s", Unit::Metre)
        });
        let second = reals(|t| -1e3 * screw(t));
        let a = read(&m, &with(with(columns(), "s", first), "s2", Arc::clone(&second))).unwrap();
        assert!(worst(&a).0 < 1e-12 && a.flags == ["screw_alternative"], "{why}: {:?}", a.flags);
        let mut without = columns();
        without.retain(|(name, _)| *name != "s");
        let a = read(&m, &with(without, "s2", second)).unwrap();
        assert!(worst(&a).0 < 1e-12, "{why}");
    }
}

#[test]
fn a_sample_that_is_not_valid_is_missing() {
    let bad = |k: usize| (200..240).contains(&k);
    let words = |k: usize| Some(if bad(k) { "FAILED" } else { "NORMAL " });
    let truth: ArrayRef = Arc::new((0..ROWS).map(|k| Some(!bad(k))).collect::<BooleanArray>());
    let marks: [(ArrayRef, Vec<RawValue>); 4] = [
        (Arc::clone(&truth), vec![1.0.into()]),
        (truth, vec![RawValue::Truth(true)]),
        (
            Arc::new((0..ROWS).map(|k| if bad(k) { 1 } else { 3 }).collect::<Int64Array>()),
            vec![3.0.into(), 7.0.into()],
        ),
        (Arc::new((0..ROWS).map(words).collect::<StringArray>()), vec![RawValue::Text("NORMAL".into())]),
    ];
    for (mark, valid_values) in marks {
        let mut m = plain();
        m.channels.motor_position =
            ChannelMapping { valid_column: Some("ok".into()), valid_values, ..channel("m", Unit::Metre) };
        let a = read(&m, &with(columns(), "ok", mark)).unwrap();
        let missing: Vec<usize> = (0..ROWS).filter(|&k| a.dx_m[k].is_nan()).collect();
        assert_eq!(missing, (200..240).collect::<Vec<_>>());
    }
}

/// A status word of 16 or 64 bits: bit 2 says powered, bit 5 says failed, and others are in use.
#[test]
fn bits_of_a_status_word_mark_valid_samples() {
    let bad = |k: usize| (200..240).contains(&k);
    let word = |k: usize| {
        if !bad(k) {
            0b0100
        } else if k < 220 {
            0b10_0100
        } else {
            0
        }
    };
    let short = (0..ROWS).map(|k| (word(k) | 0b1000) as i16 | i16::MIN).collect::<Int16Array>();
    let long = (0..ROWS).map(|k| (word(k) | (k as u64) << 40) | 1 << 63).collect::<UInt64Array>();
    let mut m = plain();
    m.channels.motor_position = ChannelMapping {
        valid_column: Some("ok".into()),
        valid_bits: Some(0b0100),
        invalid_bits: Some(0b10_0000),
        ..channel("m", Unit::Metre)
    };
    for words in [Arc::new(short) as ArrayRef, Arc::new(long)] {
        let a = read(&m, &with(columns(), "ok", words)).unwrap();
        let missing: Vec<usize> = (0..ROWS).filter(|&k| a.dx_m[k].is_nan()).collect();
        assert_eq!(missing, (200..240).collect::<Vec<_>>());
    }
    let real = read(&m, &with(columns(), "ok", reals(|_| 4.0))).unwrap_err().diagnostic();
    assert_eq!((real.code.as_str(), real.column.as_deref()), ("column_type", Some("ok")));
}

#[test]
fn a_counter_that_wraps_is_a_clock() {
    let count = Arc::new((0..ROWS).map(|k| ((65_400 + k) % 65_536) as u16).collect::<UInt16Array>());
    let mut m = plain();
    m.clock.unit = Some(TimeUnit::Count);
    (m.clock.rate_hz, m.clock.wraps_at) = (Some(100.0), Some(65_536.0));
    let a = read(&m, &with(columns(), "t", count)).unwrap();
    assert_eq!((a.step_s, a.segments.len(), a.dx_m.len()), (0.01, 1, ROWS));
}

/// The second half of a flight over midnight, in 10 ms: a time of day, a duration, and the same in minutes.
#[test]
fn times_of_day_and_durations_have_a_unit_of_their_own() {
    let day_ms = 86_400_000;
    let of_day = |k: usize| ((day_ms - 2000 + 10 * k as i64) % day_ms) as i32;
    let of_day: ArrayRef = Arc::new(Time32MillisecondArray::from_iter_values((0..ROWS).map(of_day)));
    let duration: ArrayRef = Arc::new(DurationMicrosecondArray::from_iter_values(
        (0..ROWS as i64).map(|k| 5_000_000 + 10_000 * k),
    ));
    let minutes = reals(|t| 7.0 + t / 60.0);
    for (clock, unit) in [(of_day, None), (duration, None), (minutes, Some(TimeUnit::Minute))] {
        let mut m = plain();
        m.clock.unit = unit;
        let a = read(&m, &with(columns(), "t", clock)).unwrap();
        assert!((a.step_s - 0.01).abs() < 1e-9 && a.segments.len() == 1, "{} s", a.step_s);
        assert_eq!(a.dx_m.len(), ROWS);
    }
}

#[test]
fn numbers_since_1970_and_text_are_instants() {
    let seconds = |k: usize| 1_763_525_580_250 + 10 * k as i64;
    let unix: ArrayRef = Arc::new((0..ROWS).map(seconds).collect::<Int64Array>());
    let text: ArrayRef = Arc::new(
        (0..ROWS)
            .map(|k| Some(jiff::Timestamp::from_millisecond(seconds(k)).unwrap().to_string()))
            .collect::<StringArray>(),
    );
    for (clock, unit, epoch) in [(unix, Some(TimeUnit::Millisecond), Epoch::Unix), (text, None, Epoch::None)]
    {
        let mut m = plain();
        (m.clock.unit, m.clock.epoch) = (unit, epoch);
        let (_dir, file) = place("x.parquet");
        let columns = with(columns(), "t", clock);
        write(&file, &columns);
        let log = opened(&file, &m);
        assert_eq!(log.start_utc().unwrap().unwrap().to_string(), "2025-11-19T04:13:00.25Z");
        assert!((read(&m, &columns).unwrap().step_s - 0.01).abs() < 1e-9);
    }
}

#[test]
fn clocks_without_a_common_zero_are_refused() {
    let instants: ArrayRef = Arc::new(
        (0..ROWS as i64)
            .map(|k| Some(1_763_525_580_250 + 10 * k))
            .collect::<arrow::array::TimestampMillisecondArray>(),
    );
    let mut m = plain();
    m.channels.screw_position =
        Some(ChannelMapping { time_column: Some("ts".into()), ..channel("s", Unit::Metre) });
    let error = read(&m, &with(columns(), "ts", instants)).unwrap_err();
    assert_eq!(error.diagnostic().code, "clocks_differ");
}

#[test]
fn the_relative_position_may_be_logged_itself() {
    let mut m = plain();
    m.channels.screw_position = None;
    m.channels.relative_position = Some(channel("d", Unit::Micrometre));
    let a = read(&m, &with(columns(), "d", reals(|t| 1e6 * (screw(t) - motor(t))))).unwrap();
    assert!(worst(&a).0 < 1e-12);
}
