//! Channels with clocks, rates, latencies and quality flags of their own, on the motor's clock.

use std::sync::Arc;

use arrow::array::{
    ArrayRef, BooleanArray, Float64Array, Int16Array, Int64Array, StringArray, Time32MillisecondArray,
    TimestampMillisecondArray, UInt16Array, UInt64Array,
};
use arrow::compute::cast;
use arrow::datatypes::{DataType, TimeUnit as ArrowUnit};
use ingest::mapping::Epoch;
use ingest::mapping::units::{TimeUnit, Unit};
use ingest::{ActuatorChannels, ChannelMapping, RawValue};

use crate::layouts::{self, channel, identity, only, plain, refusal};

const STEP_S: f64 = 0.01;
const ROWS: usize = 1000;

fn reals(of: impl Fn(f64) -> f64) -> ArrayRef {
    layouts::reals((0..ROWS).map(|k| of(k as f64 * STEP_S)))
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
fn a_known_latency_is_taken_away() {
    for (latency_s, instant_s) in [(0.005, 0.0), (0.020, 0.0), (0.0, 0.004), (0.013, 0.003)] {
        let late = reals(|t| screw(t - latency_s + instant_s));
        let mut m = plain();
        let screw_channel = ChannelMapping { latency_s, instant_s, ..channel("s", Unit::Metre) };
        m.channels.screw_position = Some(screw_channel);
        let (error_m, known) = worst(&only(&m, &with(columns(), "s", late)).unwrap());
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
    let (error_m, known) = worst(&only(&m, &columns).unwrap());
    assert!(error_m < 1e-7 && known > ROWS - 4, "{error_m} m, {known} samples");
}

#[test]
fn a_slower_position_is_joined_by_lines_and_a_slower_load_is_held() {
    for repeated in [false, true] {
        let mut m = plain();
        m.channels.screw_position = Some(ChannelMapping { rate_hz: Some(50.0), ..channel("s", Unit::Metre) });
        let at = |k: usize| if repeated { Some(k / 2 * 2) } else { k.is_multiple_of(2).then_some(k) };
        let slow = |of: fn(f64) -> f64| holed(move |k| at(k).map(|k| of(k as f64 * STEP_S)));
        let a = only(&m, &with(columns(), "s", slow(screw))).unwrap();
        let (error_m, known) = worst(&a);
        assert!(error_m < 1e-6 && known >= ROWS - 1, "repeated {repeated}: {error_m} m, {known} samples");
    }
    let load = holed(|k| k.is_multiple_of(10).then_some(k as f64));
    let a = only(&plain(), &with(columns(), "f", load)).unwrap();
    assert_eq!((a.load_n[25], a.segments.len(), a.segments[0].len()), (20.0, 1, ROWS));
}

#[test]
fn the_redundant_channel_that_lives_is_taken() {
    let dead = [
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
        let a = only(&m, &with(with(columns(), "s", first), "s2", Arc::clone(&second))).unwrap();
        assert!(worst(&a).0 < 1e-12 && a.flags == ["screw_alternative"], "{why}: {:?}", a.flags);
        let mut without = columns();
        without.retain(|(name, _)| *name != "s");
        let a = only(&m, &with(without, "s2", second)).unwrap();
        assert!(worst(&a).0 < 1e-12, "{why}");
    }
}

/// Marks that are words, numbers, truth values, or bits of a word of 16 or 64 bits: bit 2 says powered, bit 5 says failed,
/// and others are in use.
#[test]
fn a_sample_that_is_not_valid_is_missing() {
    let bad = |k: usize| (200..240).contains(&k);
    let word = |k: usize| match k {
        200..220 => 0b10_0100,
        220..240 => 0,
        _ => 0b0100,
    };
    let texts = (0..ROWS).map(|k| Some(if bad(k) { "FAILED" } else { "NORMAL " })).collect::<StringArray>();
    let truth: ArrayRef = Arc::new((0..ROWS).map(|k| Some(!bad(k))).collect::<BooleanArray>());
    let counts = (0..ROWS).map(|k| if bad(k) { 1 } else { 3 }).collect::<Int64Array>();
    let short = (0..ROWS).map(|k| (word(k) | 0b1000) as i16 | i16::MIN).collect::<Int16Array>();
    let long = (0..ROWS).map(|k| (word(k) | (k as u64) << 40) | 1 << 63).collect::<UInt64Array>();
    let read = |mark: ArrayRef, valid: ChannelMapping| {
        let mut m = plain();
        m.channels.motor_position = ChannelMapping { valid_column: Some("ok".into()), ..valid };
        only(&m, &with(columns(), "ok", mark)).map_err(|e| e.diagnostic())
    };
    let values = |valid_values: Vec<RawValue>| ChannelMapping { valid_values, ..channel("m", Unit::Metre) };
    let bits = ChannelMapping {
        valid_bits: Some(0b0100),
        invalid_bits: Some(0b10_0000),
        ..channel("m", Unit::Metre)
    };
    let marks: [(ArrayRef, ChannelMapping); 6] = [
        (Arc::clone(&truth), values(vec![RawValue::Number(1.0)])),
        (truth, values(vec![RawValue::Truth(true)])),
        (Arc::new(counts), values([3.0, 7.0].map(RawValue::Number).into())),
        (Arc::new(texts), values(vec![RawValue::Text("NORMAL".into())])),
        (Arc::new(short), bits.clone()),
        (Arc::new(long), bits.clone()),
    ];
    for (mark, valid) in marks {
        let a = read(mark, valid).unwrap();
        assert!((0..ROWS).all(|k| a.dx_m[k].is_nan() == bad(k)));
    }
    let real = read(reals(|_| 4.0), bits).unwrap_err();
    assert_eq!((real.code.as_str(), real.column.as_deref()), ("column_type", Some("ok")));
}

/// A clock, its unit and epoch, the zone of the log, and its first instant.
type Case = (ArrayRef, Option<TimeUnit>, Epoch, Option<&'static str>, Option<&'static str>);

/// Each kind of clock of 10 ms from 2025-11-19T04:13:00.25Z on, which is 1,763,525,580.25 s after 1970: the step is the
/// same, and an absolute clock gives its first instant. Istanbul is three hours ahead of UTC; 2026-11-19 is day 46345 of
/// spreadsheets (as LibreOffice has it).
#[test]
fn every_clock_gives_its_step_and_an_absolute_one_its_first_instant() {
    const FIRST_MS: i64 = 1_763_525_580_250;
    let whole = |first: i64, each: i64| -> ArrayRef {
        Arc::new((0..ROWS as i64).map(|k| first + each * k).collect::<Int64Array>())
    };
    let of_type = |array: ArrayRef, kind: DataType| cast(&array, &kind).unwrap();
    let stamps = |zone: Option<&str>| {
        let kind = DataType::Timestamp(ArrowUnit::Millisecond, zone.map(Into::into));
        of_type(whole(FIRST_MS, 10), kind)
    };
    let nanoseconds = DataType::Timestamp(ArrowUnit::Nanosecond, None);
    let instant = |k: i64| jiff::Timestamp::from_millisecond(FIRST_MS + 10 * k).unwrap().to_string();
    let text = (0..ROWS as i64).map(|k| Some(instant(k))).collect::<StringArray>();
    let of_day = (0..ROWS as i32).map(|k| (86_398_000 + 10 * k) % 86_400_000);
    let count = (0..ROWS).map(|k| ((65_400 + k) % 65_536) as u16);
    let (second, millisecond) = (Some(TimeUnit::Second), Some(TimeUnit::Millisecond));
    let (none, there) = (Epoch::None, Some("Europe/Istanbul"));
    let utc = Some("2025-11-19T04:13:00.25Z");
    let day_count = reals(|t| 46_345.25 + t / 86_400.0);
    let cases: [Case; 15] = [
        (reals(|t| 10.0 + t), second, none, there, None),
        (reals(|t| 7.0 + t / 60.0), Some(TimeUnit::Minute), none, there, None),
        (whole(FIRST_MS, 10), millisecond, none, there, None),
        (whole(FIRST_MS, 10), millisecond, Epoch::Unix, None, utc),
        (whole(1000 * FIRST_MS, 10_000), Some(TimeUnit::Microsecond), Epoch::Unix, None, utc),
        (whole(1_000_000 * FIRST_MS, 10_000_000), Some(TimeUnit::Nanosecond), none, there, None),
        (stamps(Some("UTC")), None, none, None, utc),
        (stamps(None), None, none, None, None),
        (stamps(None), None, none, there, Some("2025-11-19T01:13:00.25Z")),
        (of_type(stamps(None), nanoseconds), None, none, Some("UTC"), utc),
        (Arc::new(text), None, none, None, utc),
        (Arc::new(Time32MillisecondArray::from_iter_values(of_day)), None, none, there, None),
        // The type of a duration wins over the mapped unit.
        (of_type(whole(5000, 10), DataType::Duration(ArrowUnit::Millisecond)), second, none, there, None),
        (Arc::new(count.collect::<UInt16Array>()), Some(TimeUnit::Count), none, there, None),
        (day_count, Some(TimeUnit::Day), Epoch::Excel, Some("UTC"), Some("2026-11-19T06:00:00Z")),
    ];
    for (clock, unit, epoch, zone, start) in cases {
        let case = format!("{} {unit:?} {epoch:?} {zone:?}", clock.data_type());
        let mut m = plain();
        (m.clock.unit, m.clock.epoch) = (unit, epoch);
        if unit == Some(TimeUnit::Count) {
            (m.clock.rate_hz, m.clock.wraps_at) = (Some(100.0), Some(65_536.0));
        }
        m.identity.path = Some(r"(?<tail_number>N\w+)_".into());
        m.identity.time_zone = zone.map(str::to_owned);
        let columns = with(columns(), "t", clock);
        let a = only(&m, &columns).unwrap();
        // A double holds days since 1899 to a microsecond.
        let tolerance_s = if epoch == Epoch::Excel { 2e-6 } else { 1e-9 };
        assert!((a.step_s - 0.01).abs() < tolerance_s, "{case}: {} s", a.step_s);
        assert_eq!((a.segments.len(), a.dx_m.len()), (1, ROWS), "{case}");
        let instant = |text: &str| text.parse::<jiff::Timestamp>().unwrap().as_millisecond();
        let found = identity("N1_x.parquet", &m, &columns).ok();
        assert_eq!(found.as_deref().map(instant), start.map(instant), "{case}");
    }
}

/// A clock of local times belongs to one of instants by its zone, two hours ahead here, and to numbers by nothing.
#[test]
fn clocks_without_a_common_zero_are_refused() {
    let stamps = |first_ms: i64| {
        TimestampMillisecondArray::from_iter_values((0..ROWS as i64).map(|k| first_ms + 10 * k))
    };
    let local = with(columns(), "ts", Arc::new(stamps(1_763_525_580_000 + 2 * 3_600_000)));
    let mut m = plain();
    m.channels.screw_position =
        Some(ChannelMapping { time_column: Some("ts".into()), ..channel("s", Unit::Metre) });
    assert_eq!(refusal(&m, &local).code, "clocks_differ");
    let both = with(local, "t", Arc::new(stamps(1_763_525_580_000).with_timezone("UTC")));
    (m.clock.unit, m.identity.time_zone) = (None, None);
    assert_eq!(refusal(&m, &both).code, "clocks_differ");
    m.identity.time_zone = Some("Africa/Cairo".into());
    assert_eq!(worst(&only(&m, &both).unwrap()), (0.0, ROWS));
}

#[test]
fn the_relative_position_may_be_logged_itself() {
    let mut m = plain();
    m.channels.screw_position = None;
    m.channels.relative_position = Some(channel("d", Unit::Micrometre));
    let a = only(&m, &with(columns(), "d", reals(|t| 1e6 * (screw(t) - motor(t))))).unwrap();
    assert!(worst(&a).0 < 1e-12);
}
