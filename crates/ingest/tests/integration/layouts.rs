//! Logs as fleets write them: several actuators or one, every unit, every kind of clock.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow::array::{
    ArrayRef, Float64Array, Int16Array, Int32Array, ListArray, RecordBatch, StringArray, StructArray,
    Time32MillisecondArray, TimestampMillisecondArray, UInt32Array,
};
use arrow::compute::take;
use arrow::datatypes::{DataType, Field, Float64Type, Schema};
use ingest::log::identity::IdentityFields;
use ingest::mapping::units::{TimeUnit, Unit};
use ingest::mapping::{Epoch, IdentityField, IdentityMapping};
use ingest::parquet::writer::{Column, write_parquet};
use ingest::{
    ActuatorChannels, ChannelMapping, Channels, ClockMapping, Error, Geometry, Identity, Log, LogFiles,
    Mapping,
};
use parquet::arrow::ArrowWriter;
use parquet::file::properties::WriterProperties;
use records::{Diagnostic, Position};

/// Writes columns with the plain writer of the Arrow library.
pub(crate) fn write(file: &Path, columns: &[(&str, ArrayRef)]) {
    let columns = columns.iter().map(|(name, array)| (name, Arc::clone(array), true));
    let batch = RecordBatch::try_from_iter_with_nullable(columns).unwrap();
    write_batch(file, &batch, WriterProperties::default());
}

pub(crate) fn write_batch(file: &Path, batch: &RecordBatch, properties: WriterProperties) {
    let file = File::create(file).unwrap();
    let mut writer = ArrowWriter::try_new(file, batch.schema(), Some(properties)).unwrap();
    writer.write(batch).unwrap();
    writer.close().unwrap();
}

pub(crate) fn channel(column: &str, unit: Unit) -> ChannelMapping {
    ChannelMapping { column: column.into(), unit, ..ChannelMapping::default() }
}

pub(crate) fn mapping(motor: ChannelMapping, screw: ChannelMapping, load: ChannelMapping) -> Mapping {
    Mapping {
        identity: IdentityMapping {
            path: Some(r"(?<tail_number>N\w+)_(?<departure_utc>\d{8}T\d{6}Z)".into()),
            departure_format: Some("%Y%m%dT%H%M%SZ".into()),
            time_zone: Some("UTC".into()),
            ..IdentityMapping::default()
        },
        clock: ClockMapping {
            column: Some("t".into()),
            unit: Some(TimeUnit::Second),
            ..ClockMapping::default()
        },
        channels: Channels {
            motor_position: motor,
            screw_position: Some(screw),
            load,
            ..Channels::default()
        },
        ..Mapping::default()
    }
}

/// Motor, screw and load in the columns `m`, `s` and `f`.
pub(crate) fn plain() -> Mapping {
    prefixed("")
}

/// The same columns with a prefix.
pub(crate) fn prefixed(prefix: &str) -> Mapping {
    let named = |name: &str, unit| channel(&format!("{prefix}{name}"), unit);
    mapping(named("m", Unit::Metre), named("s", Unit::Metre), named("f", Unit::Newton))
}

/// A file in a folder of its own, which goes with it.
pub(crate) fn place(name: &str) -> (tempfile::TempDir, PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join(name);
    (dir, file)
}

/// A log of these columns, whose path names tail and departure.
pub(crate) fn written(columns: &[(&str, ArrayRef)]) -> (tempfile::TempDir, PathBuf) {
    let (dir, file) = place("N1_20261119T041300Z.parquet");
    write(&file, columns);
    (dir, file)
}

pub(crate) fn opened(file: &Path, mapping: &Mapping) -> Log {
    Log::open(&LogFiles::one(file), &Arc::new(mapping.clone())).unwrap()
}

/// Opens a log and reads its only actuator, with a lead of 5 mm.
pub(crate) fn read(file: &Path, mapping: &Mapping) -> Result<ActuatorChannels, Error> {
    read_with(file, mapping, LINEAR)
}

/// The same with another geometry.
pub(crate) fn read_with(
    file: &Path,
    mapping: &Mapping,
    geometry: Geometry,
) -> Result<ActuatorChannels, Error> {
    let log = Log::open(&LogFiles::one(file), &Arc::new(mapping.clone()))?;
    let at = log.actuators(&mapping.channels, Some(&Position::new("a").unwrap()))?;
    log.read_actuator(&at[0], &mapping.channels, geometry)
}

pub(crate) const LINEAR: Geometry = Geometry::Linear { lead_m_per_rev: Some(0.005) };

/// Writes, opens and reads the only actuator of a log.
pub(crate) fn only(mapping: &Mapping, columns: &[(&str, ArrayRef)]) -> Result<ActuatorChannels, Error> {
    let (_dir, file) = written(columns);
    read(&file, mapping)
}

/// Why a log of these columns is refused.
pub(crate) fn refusal(mapping: &Mapping, columns: &[(&str, ArrayRef)]) -> Diagnostic {
    only(mapping, columns).unwrap_err().diagnostic()
}

pub(crate) fn reals(values: impl IntoIterator<Item = f64>) -> ArrayRef {
    Arc::new(values.into_iter().map(Some).collect::<Float64Array>())
}

/// What the log itself says of its flight.
pub(crate) fn own_identity(log: &Log) -> Result<Identity, Diagnostic> {
    log.identity(|_, _| IdentityFields::new()).map_err(|e| e.diagnostic())
}

fn near(found: &[f64], wanted: &[f64]) {
    assert_eq!(found.len(), wanted.len());
    for (f, w) in found.iter().zip(wanted) {
        assert!((f - w).abs() <= 1e-12 * w.abs().max(1e-6), "{found:?} is not {wanted:?}");
    }
}

/// One millimetre, 5 mm lead: 72° or 0.2 turns of the motor; 1 lbf is 4.448… N.
#[test]
fn every_unit_reaches_the_same_metres_and_newtons() {
    let t = reals([0.0, 0.1]);
    let positions = [
        (Unit::Metre, 1e-3),
        (Unit::Millimetre, 1.0),
        (Unit::Micrometre, 1e3),
        (Unit::Centimetre, 0.1),
        (Unit::Inch, 1.0 / 25.4),
        (Unit::Mil, 1e3 / 25.4),
        (Unit::Degree, 72.0),
        (Unit::Radian, 0.4 * std::f64::consts::PI),
        (Unit::Milliradian, 400.0 * std::f64::consts::PI),
        (Unit::Revolution, 0.2),
    ];
    let loads = [
        (Unit::Newton, 1000.0),
        (Unit::Kilonewton, 1.0),
        (Unit::Decanewton, 100.0),
        (Unit::PoundForce, 224.808_943_099_710_5),
        (Unit::KilopoundForce, 0.224_808_943_099_710_5),
        (Unit::NewtonMetre, 5.0 / (2.0 * std::f64::consts::PI)),
        (Unit::KilonewtonMetre, 5e-3 / (2.0 * std::f64::consts::PI)),
        (Unit::PoundForceInch, 7.043199713697552),
        (Unit::PoundForceFoot, 7.043199713697552 / 12.0),
    ];
    for (unit, millimetre) in positions {
        for (load_unit, kilonewton) in loads {
            let m = mapping(channel("m", unit), channel("s", Unit::Metre), channel("f", load_unit));
            let (motor, load) = (reals([millimetre, 2.0 * millimetre]), reals([kilonewton, -kilonewton]));
            let columns = [("t", t.clone()), ("m", motor), ("s", reals([1e-3, 2e-3])), ("f", load)];
            let a = only(&m, &columns).unwrap();
            near(&a.motor_m, &[1e-3, 2e-3]);
            a.dx_m.iter().for_each(|dx| assert!(dx.abs() < 1e-15, "{} leaves {dx} m", unit.as_str()));
            let off_n = a.load_n.iter().zip([1e3, -1e3]).map(|(f, w)| (f - w).abs());
            off_n.for_each(|off| assert!(off < 1e-8, "{} is off by {off} N", load_unit.as_str()));
        }
    }
}

#[test]
fn signs_counts_sentinels_and_gears_are_taken_as_mapped() {
    let motor = ChannelMapping {
        sign: -1,
        scale: 0.5,
        offset: 1.0,
        gear_ratio: 2.0,
        ..channel("m", Unit::Revolution)
    };
    let screw = ChannelMapping { missing: vec![-9999.0], ..channel("s", Unit::Millimetre) };
    let m = mapping(motor, screw, channel("f", Unit::Newton));
    let columns: [(&str, ArrayRef); 4] = [
        ("t", reals([0.0, 0.1])),
        ("m", Arc::new(Int16Array::from(vec![2, 6]))),
        ("s", reals([1.0, -9999.0])),
        ("f", reals([0.0, 1.0])),
    ];
    let a = only(&m, &columns).unwrap();
    // −(2·0.5 + 1) turns over a gear of 2 and a lead of 5 mm.
    near(&a.motor_m, &[-0.005, -0.010]);
    near(&a.dx_m[..1], &[0.006]);
    assert!(a.dx_m[1].is_nan());
}

#[test]
fn metadata_wins_over_columns_and_columns_over_the_path() {
    let (_dir, file) = place("N1_20261119T041300Z.parquet");
    let text = |t: &str| Column::Text(vec![t.to_owned(); 2]);
    let columns = [("t", Column::Real(vec![0.0, 1.0])), ("tail", text("N2")), ("flight", text("0413"))];
    // As pandas writes the attributes of a table.
    let metadata = [("PANDAS_ATTRS", r#"{"reg": "N3"}"#), ("fh", "1.5")];
    let metadata = metadata.map(|(key, value)| (key.into(), value.into()));
    write_parquet(&file, &columns.map(|(name, values)| (name.into(), values)), &metadata).unwrap();
    let mut m = plain();
    m.identity.columns = BTreeMap::from([
        (IdentityField::TailNumber, "tail".into()),
        (IdentityField::FlightId, "flight".into()),
    ]);
    let found = |m: &Mapping| own_identity(&opened(&file, m)).unwrap();
    assert_eq!(found(&m).flight.tail_number.as_str(), "N2");
    m.identity.metadata = BTreeMap::from([
        (IdentityField::TailNumber, "PANDAS_ATTRS.reg".into()),
        (IdentityField::FlightHours, "fh".into()),
    ]);
    let offered = ingest::infer::propose(&file).unwrap().metadata;
    assert_eq!(offered[&IdentityField::TailNumber], "PANDAS_ATTRS.reg");
    let identity = found(&m);
    assert_eq!((identity.flight.tail_number.as_str(), identity.flight.flight_id.as_str()), ("N3", "0413"));
    assert_eq!(identity.flight.flight_hours, Some(1.5));
}

#[test]
fn texts_of_numbers_are_read_and_other_texts_are_refused_by_name() {
    let read = |motor: [&str; 3]| {
        let text = |texts: [&str; 3]| Arc::new(StringArray::from(texts.to_vec())) as ArrayRef;
        let (t, m) = (text(["0.0", "0.1", "0.2"]), text(motor));
        let columns = [("t", t), ("m", m), ("s", reals([0.0, 1.0, 2.0])), ("f", reals([0.0, 1.0, 2.0]))];
        only(&plain(), &columns).map_err(|e| e.diagnostic())
    };
    let found = read(["0.5", " ", "-1e-2"]).unwrap();
    assert_eq!((found.motor_m[0], found.motor_m[2], found.motor_m[1].is_nan()), (0.5, -0.01, true));
    assert!((found.step_s - 0.1).abs() < 1e-12, "{} s", found.step_s);
    let refused = read(["0.5", "1,5", "2"]).unwrap_err();
    assert_eq!((refused.code.as_str(), refused.column.as_deref()), ("column_type", Some("m")));
    assert!(refused.message.contains("`1,5`"), "{refused}");
}

/// Two flights of a minute and more, five hours apart, in a file that names no flight: their mean would be no gap of
/// either. A pause of 50 minutes, and a few rows whose clock was wrong, are of one flight.
#[test]
fn two_flights_in_one_log_are_refused_with_both_spans() {
    let m = plain();
    let read = |m: &Mapping, first: usize, pause_s: f64| {
        let t = reals((0..3000).map(|k| 0.1 * k as f64 + if k < first { 0.0 } else { pause_s }));
        let x = reals((0..3000).map(|k| (f64::from(k) * 0.01).sin()));
        let columns = [("t", t), ("m", x.clone()), ("s", x.clone()), ("f", x.clone()), ("leg", x)];
        only(m, &columns).map_err(|e| e.diagnostic())
    };
    let refused = read(&m, 1000, 18_000.0).unwrap_err();
    assert_eq!((refused.code.as_str(), refused.row), ("several_flights", Some(1000)));
    let found = refused.found.unwrap();
    assert_eq!(found, "samples from 0 to 100 s and from 18100 to 18300 s after the first one");
    assert!(refused.hint.unwrap().contains("`clock.max_gap_s`"));
    assert_eq!(read(&m, 1000, 3000.0).unwrap().segments.len(), 2);
    assert_eq!(read(&m, 2990, 18_000.0).unwrap().segments.len(), 2);
    let mut longer = m.clone();
    longer.clock.max_gap_s = Some(20_000.0);
    assert_eq!(read(&longer, 1000, 18_000.0).unwrap().segments.len(), 2);
    let mut named = m;
    named.identity.columns.insert(IdentityField::FlightId, "leg".into());
    assert_eq!(read(&named, 1000, 18_000.0).unwrap().segments.len(), 2);
}

/// As pyarrow writes `pa.field("m", pa.int32(), metadata={"unit": "mm", "scale": "0.01", "offset": "-5"})`: 700 counts are
/// 2 mm.
#[test]
fn scale_offset_and_unit_of_the_arrow_field_are_taken_unless_the_mapping_has_others() {
    let noted =
        [("unit", "mm"), ("scale", "0.01"), ("offset", "-5")].map(|(k, v)| (k.to_owned(), v.to_owned()));
    let counts: ArrayRef = Arc::new(Int32Array::from(vec![700, 800]));
    let fields = [
        Field::new("t", DataType::Float64, true),
        Field::new("m", DataType::Int32, true).with_metadata(noted.into()),
        Field::new("s", DataType::Float64, true),
    ];
    let (_dir, file) = place("N1_20261119T041300Z.parquet");
    let arrays = vec![reals([0.0, 0.1]), counts, reals([1.0, 2.0])];
    let batch = RecordBatch::try_new(Arc::new(Schema::new(fields.to_vec())), arrays).unwrap();
    write_batch(&file, &batch, WriterProperties::default());
    let read = |motor: ChannelMapping| {
        let m = mapping(motor, channel("s", Unit::Metre), channel("s", Unit::Newton));
        read(&file, &m).map_err(|e| e.diagnostic())
    };
    near(&read(channel("m", Unit::Millimetre)).unwrap().motor_m, &[2e-3, 3e-3]);
    let same = ChannelMapping { scale: 0.01, offset: -5.0, ..channel("m", Unit::Millimetre) };
    near(&read(same).unwrap().motor_m, &[2e-3, 3e-3]);
    let own = ChannelMapping { ignore_metadata: true, scale: 0.1, ..channel("m", Unit::Micrometre) };
    near(&read(own).unwrap().motor_m, &[70e-6, 80e-6]);
    for (other, key) in [
        (channel("m", Unit::Micrometre), "`unit` = mm"),
        (ChannelMapping { scale: 0.1, ..channel("m", Unit::Millimetre) }, "`scale` = 0.01"),
    ] {
        let refused = read(other).unwrap_err();
        assert_eq!((refused.code.as_str(), refused.column.as_deref()), ("metadata_contradicts", Some("m")));
        assert!(refused.found.unwrap().starts_with(key) && refused.hint.unwrap().contains("ignore_metadata"));
    }
}

/// The departure of a log of this name, from what the log itself says.
pub(crate) fn identity(name: &str, m: &Mapping, columns: &[(&str, ArrayRef)]) -> Result<String, Diagnostic> {
    let (_dir, file) = place(name);
    write(&file, columns);
    own_identity(&opened(&file, m)).map(|identity| identity.flight.departure_utc.to_string())
}

/// Istanbul is three hours ahead of UTC. The log begins at 23:59:50, and goes on after midnight.
#[test]
fn a_date_in_the_path_is_joined_with_a_clock_of_the_day_or_refused() {
    let mut m = plain();
    m.identity.path = Some(r"(?<tail_number>N\w+)_(?<departure_date>\d{8})".into());
    m.identity.departure_format = Some("%Y%m%d".into());
    m.identity.time_zone = Some("Europe/Istanbul".into());
    let of = |m: &Mapping, t: ArrayRef| identity("N1_20261119.parquet", m, &[("t", t)]);
    let seconds = reals((0..200).map(|k| (86_390.0 + 0.1 * f64::from(k)).rem_euclid(86_400.0)));
    let refused = of(&m, Arc::clone(&seconds)).unwrap_err();
    assert!(refused.code == "identity_invalid" && refused.message.contains("clock.epoch"), "{refused}");
    m.clock.epoch = Epoch::Midnight;
    assert_eq!(of(&m, seconds).unwrap(), "2026-11-19T20:59:50Z");
    let packed = reals((0..200).map(|k| 210_130.0 + 0.1 * f64::from(k)));
    let refused = of(&m, packed).unwrap_err();
    assert!(refused.message.contains("HHMMSS"), "{refused}");
    m.clock.unit = None;
    let texts = (0..200).map(|k| Some(format!("23:59:{:05.2}", 50.0 + 0.05 * f64::from(k))));
    assert_eq!(of(&m, Arc::new(texts.collect::<StringArray>())).unwrap(), "2026-11-19T20:59:50Z");
    let of_day = Time32MillisecondArray::from_iter_values((0..200).map(|k| 86_390_000 + 50 * k));
    assert_eq!(of(&m, Arc::new(of_day)).unwrap(), "2026-11-19T20:59:50Z");
    // An absolute clock gives the time, unless it is of another day.
    let instant = |day: i64| -> ArrayRef {
        let stamps = (0..200).map(|k| 1_794_000_000_000 + 86_400_000 * day + 50 * k);
        Arc::new(TimestampMillisecondArray::from_iter_values(stamps).with_timezone("UTC"))
    };
    assert_eq!(identity("N1_20261106.parquet", &m, &[("t", instant(0))]).unwrap(), "2026-11-06T21:20:00Z");
    let other = identity("N1_20261106.parquet", &m, &[("t", instant(3))]).unwrap_err();
    assert!(other.message.contains("another day"), "{other}");
    // A date alone in the flights table, of a log without one.
    m.identity.path = Some(r"(?<tail_number>N\w+)_".into());
    let of_table = |departure: &str, columns: &[(&str, ArrayRef)]| {
        let row = || IdentityFields::from([(IdentityField::DepartureUtc, departure.to_owned())]);
        let (_dir, file) = place("N1_x.parquet");
        write(&file, columns);
        let found = opened(&file, &m).identity(|_, _| row()).map_err(|e| e.diagnostic().message);
        found.map(|identity| identity.flight.departure_utc.to_string())
    };
    assert_eq!(of_table("2026-11-06", &[("t", instant(0))]).unwrap(), "2026-11-06T21:20:00Z");
    assert!(of_table("2026-11-06", &[("t", instant(3))]).unwrap_err().contains("another day"));
    assert!(of_table("2026-11-06", &[("other", instant(0))]).unwrap_err().contains("the flights table"));
    // A recorder that is not set yet stamps its first rows years before.
    let unset = (0..200).map(|k| if k < 3 { 1_577_836_800_000 } else { 1_794_000_000_000 + 50 * (k - 3) });
    let unset: ArrayRef = Arc::new(TimestampMillisecondArray::from_iter_values(unset).with_timezone("UTC"));
    assert_eq!(identity("N1_x.parquet", &m, &[("t", unset)]).unwrap(), "2026-11-06T21:20:00Z");
    // An instant of the table, whatever form the departures of the logs have.
    let at = "2026-11-06T05:00:00Z";
    assert_eq!(of_table(at, &[("t", instant(0))]).unwrap(), at);
}

/// Two hours before the landing by the hours that the log states, or 20 s before it by its clock.
#[test]
fn a_landing_stands_for_the_departure() {
    let mut m = plain();
    m.identity.path = Some(r"(?<tail_number>N\w+)_(?<landing_utc>\d{8}T\d{6}Z)".into());
    let columns = [("t", reals((0..201).map(|k| 50.0 + 0.1 * f64::from(k))))];
    let of = |m: &Mapping| identity("N1_20261119T041300Z.parquet", m, &columns).unwrap();
    assert_eq!(of(&m), "2026-11-19T04:12:40Z");
    m.identity.values.insert(IdentityField::FlightHours, "2.0".into());
    assert_eq!(of(&m), "2026-11-19T02:13:00Z");
}

/// `höhe` with a composed and a decomposed ö: a file of one system, and a configuration of another. `FLT_NO` begins as
/// `{position}_FORCE_LBF` does, and is not meant.
#[test]
fn accents_of_names_are_composed_and_the_closest_column_shares_the_end_of_the_pattern() {
    let mut m = mapping(
        channel("{position}_h\u{f6}he", Unit::Metre),
        channel("{position}_s", Unit::Metre),
        channel("f", Unit::Newton),
    );
    let names =
        ["t", "au\u{df}eno\u{308}_ho\u{308}he", "au\u{df}en\u{f6}_s", "f", "FLT_NO", "AIL_L_LOAD_LBF"];
    let (_dir, file) = written(&names.map(|name| (name, reals([1.0, 2.0]))));
    let log = opened(&file, &m);
    let found = log.actuators(&m.channels, None).unwrap();
    assert_eq!((found.len(), found[0].position.as_str()), (1, "au\u{df}en\u{f6}"));
    let a = log.read_actuator(&found[0], &m.channels, LINEAR).unwrap();
    assert_eq!(a.motor_m, [1.0, 2.0]);
    m.channels.motor_position.column = "{position}_FORCE_LBF".into();
    let hint = log.actuators(&m.channels, None).unwrap_err().diagnostic().hint.unwrap();
    assert!(hint.contains("`AIL_L_LOAD_LBF`"), "{hint}");
}

/// `SYSTEM.CHANNEL` is an ordinary name in flight logs, not a path into a nest. Of two columns of one name neither is taken,
/// and of a struct in place of a number the fields are named.
#[test]
fn a_name_with_a_dot_is_read_and_one_of_two_columns_or_of_a_struct_is_refused() {
    let columns = |names: &[&'static str]| -> Vec<(&'static str, ArrayRef)> {
        names.iter().map(|name| (*name, reals([1.0, 2.0]))).collect()
    };
    let dotted = only(&prefixed("ail."), &columns(&["t", "ail.m", "ail.s", "ail.f"])).unwrap();
    assert_eq!(dotted.motor_m, [1.0, 2.0]);
    assert!(only(&plain(), &columns(&["t", "m", "s", "f", "spare", "spare"])).is_ok());
    for column in ["t", "s"] {
        let found = refusal(&plain(), &columns(&["t", "m", "s", "f", column]));
        assert_eq!((found.code.as_str(), found.column.as_deref()), ("duplicate_column", Some(column)));
    }
    let field = |name| (Arc::new(Field::new(name, DataType::Float64, true)), reals([1.0, 2.0]));
    let record: ArrayRef = Arc::new(StructArray::from(["deg", "raw"].map(field).to_vec()));
    let found = refusal(&plain(), &[columns(&["t", "s", "f"]), vec![("m", record)]].concat());
    assert_eq!((found.code.as_str(), found.column.as_deref()), ("column_type", Some("m")));
    assert!(found.to_string().contains("`deg`, `raw`"), "{found}");
}

/// Rows of 0.1 s with ten positions and five loads each: both begin at the stamp of their row.
#[test]
fn lists_of_different_rates_lie_between_the_stamps_of_their_rows() {
    let lists = |each: usize, of: &dyn Fn(f64) -> f64| -> ArrayRef {
        let row = |row: usize| {
            Some((0..each).map(|k| Some(of(0.1 * (row as f64 + k as f64 / each as f64)))).collect::<Vec<_>>())
        };
        Arc::new(ListArray::from_iter_primitive::<Float64Type, _, _>((0..50).map(row)))
    };
    let columns = [
        ("t", reals((0..50).map(|row| 0.1 * f64::from(row)))),
        ("m", lists(10, &|t| t)),
        ("s", lists(10, &|t| t + 1e-3)),
        ("f", lists(5, &|t| 100.0 * t)),
    ];
    let mut m = plain();
    let a = only(&m, &columns).unwrap();
    assert_eq!((a.dx_m.len(), a.segments.len()), (500, 1));
    // The load of 50 Hz is held over the next sample of 100 Hz.
    let held = |k: usize| 100.0 * 0.02 * (k / 2) as f64;
    let worst = (0..500).map(|k| (a.load_n[k] - held(k)).abs()).fold(0.0, f64::max);
    assert!(worst < 1e-9, "{worst} N");
    // Every second row is of another actuator.
    let turns = UInt32Array::from_iter_values((0..100).map(|row| row / 2));
    let twice = |(name, array): &(&'static str, ArrayRef)| (*name, take(array, &turns, None).unwrap());
    let places: StringArray = (0..100).map(|row| Some(["left", "right"][row % 2])).collect();
    let by_row: Vec<_> = columns.iter().map(twice).chain([("at", Arc::new(places) as ArrayRef)]).collect();
    let mut own = plain();
    own.layout.position_column = Some("at".into());
    let (_dir, file) = written(&by_row);
    let log = opened(&file, &own);
    for at in log.actuators(&own.channels, None).unwrap() {
        let b = log.read_actuator(&at, &own.channels, LINEAR).unwrap();
        assert_eq!((b.dx_m, b.load_n, b.repairs.repeated), (a.dx_m.clone(), a.load_n.clone(), 0));
    }
    (m.clock.column, m.clock.rate_hz) = (None, Some(100.0));
    let refused = refusal(&m, &columns);
    assert_eq!((refused.code.as_str(), refused.column.as_deref()), ("list_lengths", Some("f")));
}

/// Three flights of two tails in one file, whose rows are samples of one channel each, one row after the other or flight by
/// flight: each is read as in a file of its own, with its own positions. Flight k has δX = k mm.
#[test]
fn each_flight_of_a_file_is_a_log_of_its_own() {
    let flights = [("N1", "7", 1.0, "left"), ("N1", "A/8#", 2.0, "left"), ("N2", "7", 3.0, "right")];
    let mut mapping = prefixed("{position}_");
    mapping.layout.name_column = Some("name".into());
    mapping.layout.value_column = Some("value".into());
    let columns = [(IdentityField::TailNumber, "tail"), (IdentityField::FlightId, "leg")];
    mapping.identity = IdentityMapping {
        columns: columns.map(|(field, name)| (field, name.to_owned())).into(),
        values: [(IdentityField::DepartureUtc, "2026-11-19T04:13:00Z".to_owned())].into(),
        by_row: true,
        ..IdentityMapping::default()
    };
    for is_sorted in [false, true] {
        let mut rows: Vec<(usize, usize)> =
            (0..600).flat_map(|k| (0..3).map(move |flight| (flight, k))).collect();
        if is_sorted {
            rows.sort_by_key(|row| row.0);
        }
        let texts = |of: &dyn Fn(usize, usize) -> String| -> ArrayRef {
            Arc::new(rows.iter().map(|&(flight, k)| Some(of(flight, k))).collect::<StringArray>())
        };
        let value = |&(flight, k): &(usize, usize)| {
            let motor_m = 1e-2 * (0.1 * (k / 3) as f64).sin();
            if k % 3 == 1 { motor_m + 1e-3 * flights[flight].2 } else { motor_m }
        };
        let columns = [
            ("tail", texts(&|flight, _| flights[flight].0.to_owned())),
            ("leg", texts(&|flight, _| flights[flight].1.to_owned())),
            ("t", reals(rows.iter().map(|row| 0.1 * (row.1 / 3) as f64))),
            ("name", texts(&|flight, k| format!("{}_{}", flights[flight].3, ["m", "s", "f"][k % 3]))),
            ("value", reals(rows.iter().map(value))),
        ];
        let (_dir, file) = place("day.parquet");
        // Of sorted rows, statistics tell the flight of each row group.
        let groups = WriterProperties::builder().set_max_row_group_row_count(Some(600)).build();
        write_batch(&file, &RecordBatch::try_from_iter(columns).unwrap(), groups);
        let paths = ingest::log::flight_rows::flights_in(&file, &mapping.identity).unwrap();
        let texts: Vec<&str> = paths.iter().map(|p| p.to_str().unwrap().split_once('#').unwrap().1).collect();
        assert_eq!(texts, ["N1/7", "N1/A%2F8%23", "N2/7"]);
        let mut digests = std::collections::BTreeSet::new();
        for (path, (tail, leg, dx_mm, position)) in paths.iter().zip(flights) {
            let log = opened(path, &mapping);
            let identity = own_identity(&log).unwrap();
            assert_eq!(
                (identity.flight.tail_number.as_str(), identity.flight.flight_id.as_str()),
                (tail, leg)
            );
            let found = log.actuators(&mapping.channels, None).unwrap();
            assert_eq!((found.len(), found[0].position.as_str()), (1, position));
            log.announce(&[(&mapping.channels, &found[0])]);
            let a = log.read_actuator(&found[0], &mapping.channels, LINEAR).unwrap();
            assert_eq!((a.dx_m.len(), a.segments.len()), (200, 1), "{texts:?}");
            assert!(a.dx_m.iter().all(|dx_m| (dx_m - 1e-3 * dx_mm).abs() < 1e-12), "{is_sorted} {path:?}");
            digests.insert(log.digest(&[(&mapping.channels, &found[0])]).unwrap());
        }
        assert_eq!(digests.len(), 3);
        let whole = own_identity(&opened(&file, &mapping)).unwrap_err();
        assert!(whole.hint.unwrap().contains("identity.by_row"));
    }
}
