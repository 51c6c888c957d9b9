//! Small logs by five writers in every layout (`tests/data/writers/make.py`): all hold the same flight.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use ingest::mapping::units::Unit;
use ingest::mapping::{IdentityField, IdentityMapping};
use ingest::{ActuatorChannels, ChannelMapping, GroupMapping, Layout, Log, LogFiles, Mapping};
use records::Position;

use crate::layouts::{self, LINEAR, channel, opened, own_identity, plain, read};

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/writers").join(name)
}

fn mapping(before: &str) -> Mapping {
    let named = |what: &str, unit| channel(&format!("{before}{what}"), unit);
    let screw = named("screw_mm", Unit::Millimetre);
    let mut mapping =
        layouts::mapping(named("motor_deg", Unit::Degree), screw, named("load_n", Unit::Newton));
    mapping.clock.column = Some("time_s".into());
    let values = [(IdentityField::TailNumber, "N1"), (IdentityField::DepartureUtc, "2026-11-19T04:13:00Z")];
    let values = values.map(|(field, text)| (field, text.to_owned())).into();
    mapping.identity = IdentityMapping { values, ..IdentityMapping::default() };
    mapping
}

pub(crate) fn wide() -> Mapping {
    mapping("{position}_")
}

fn actuators(files: &LogFiles, mapping: &Mapping) -> Vec<ActuatorChannels> {
    let log = Log::open(files, &Arc::new(mapping.clone())).unwrap();
    let own = own_identity(&log).unwrap().position;
    let found = log.actuators(&mapping.channels, own.as_ref()).unwrap();
    found.iter().map(|at| log.read_actuator(at, &mapping.channels, LINEAR).unwrap()).collect()
}

/// The samples that `make.py` wrote, from its formulas.
fn assert_is_the_flight(found: &[ActuatorChannels], name: &str, rounding: f64, load_every: i32) {
    let names: Vec<&str> = found.iter().map(|a| a.position.as_str()).collect();
    assert_eq!(names, ["left", "right"], "{name}");
    for (a, actuator) in found.iter().enumerate() {
        assert_eq!(actuator.dx_m.len(), 400, "{name}");
        assert!((actuator.step_s - 0.01).abs() < 1e-9, "{name}: {} s", actuator.step_s);
        assert_eq!(actuator.segments, [std::ops::Range { start: 0, end: 400 }], "{name}");
        for k in 0..400 {
            let t = f64::from(k) / 100.0;
            let motor_m = (720.0 * (0.5 * t).sin() + 90.0 * a as f64) / 360.0 * 0.005;
            let at = k as usize;
            // A line between the load's own samples; the last one is held.
            let own_n = |k: i32| 1000.0 * (0.7 * f64::from(k) / 100.0).cos() + a as f64;
            let (since, every) = (k % load_every, load_every);
            let (before_n, after_n) = (own_n(k - since), own_n((k - since + every).min(400 - every)));
            let load_n = before_n + (after_n - before_n) * f64::from(since) / f64::from(every);
            assert!((actuator.motor_m[at] - motor_m).abs() < 1e-9 + rounding, "{name}: motor at {k}");
            let dx_m = 5e-5 * t.cos();
            assert!((actuator.dx_m[at] - dx_m).abs() < 1e-9 + 2.0 * rounding, "{name}: dx at {k}");
            let rough = if name.contains("half") { 0.6 } else { 1e-3 };
            assert!((actuator.load_n[at] - load_n).abs() < rough, "{name}: load at {k}");
        }
    }
}

#[test]
fn every_writer_and_compression_gives_the_same_flight() {
    let mut found = 0;
    for entry in std::fs::read_dir(file("")).unwrap() {
        let name = entry.unwrap().file_name().to_string_lossy().into_owned();
        let by = ["pyarrow", "polars", "pandas", "duckdb", "spark"].iter().any(|w| name.starts_with(w));
        if by && !name.contains("types") {
            assert_is_the_flight(&actuators(&LogFiles::one(file(&name)), &wide()), &name, 0.0, 1);
            found += 1;
        }
    }
    assert_eq!(found, 19, "files by pyarrow, polars, pandas, duckdb and spark");
}

/// Counts, decimals and dictionaries; a row for each actuator, channel, or both; structs, lists, and lists of structs.
#[test]
fn every_layout_gives_the_same_flight() {
    let mut types = wide();
    let screw = types.channels.screw_position.take().unwrap();
    types.channels.screw_position = Some(ChannelMapping { scale: 0.001, offset: -20.0, ..screw });
    let by_position = Layout { position_column: Some("actuator".into()), ..Layout::default() };
    let [name_column, value_column] = ["parameter", "value"].map(|column| Some(column.to_owned()));
    let by_channel = Layout { name_column, value_column, position_column: None };
    let by_both = Layout { position_column: Some("actuator".into()), ..by_channel.clone() };
    let mut records = Mapping { layout: by_position.clone(), ..mapping("samples.") };
    records.clock.column = Some("samples.t".into());
    for (name, m, rounding) in [
        ("pyarrow_types", types, 6e-7),
        ("layout_by_position", Mapping { layout: by_position, ..mapping("") }, 0.0),
        ("layout_by_channel", Mapping { layout: by_channel, ..wide() }, 0.0),
        ("layout_by_channel_and_position", Mapping { layout: by_both, ..mapping("") }, 0.0),
        ("layout_structs", mapping("{position}."), 0.0),
        ("layout_lists", wide(), 0.0),
        ("layout_records", records, 0.0),
    ] {
        let log = LogFiles::one(file(&format!("{name}.parquet")));
        assert_is_the_flight(&actuators(&log, &m), name, rounding, 1);
    }
}

#[test]
fn hive_folders_say_which_flight_and_actuator_a_file_is() {
    let mut m = mapping("");
    m.identity = IdentityMapping {
        folders: [
            (IdentityField::TailNumber, "tail".into()),
            (IdentityField::DepartureUtc, "off".into()),
            (IdentityField::Position, "actuator".into()),
        ]
        .into(),
        ..IdentityMapping::default()
    };
    let mut found = Vec::new();
    for position in ["left", "right"] {
        let path =
            file(&format!("hive/tail=N1/off=2026-11-19T04%3A13%3A00Z/actuator={position}/part-0.parquet"));
        let identity = own_identity(&opened(&path, &m)).unwrap();
        assert_eq!(identity.flight.departure_utc.to_string(), "2026-11-19T04:13:00Z");
        assert_eq!(identity.position, Some(Position::new(position).unwrap()));
        found.extend(actuators(&LogFiles::one(path), &m));
    }
    assert_is_the_flight(&found, "hive", 0.0, 1);
}

#[test]
fn loads_in_a_file_of_their_own_at_their_own_rate_move_in_lines() {
    let mut m = wide();
    m.groups = [("loads".to_owned(), GroupMapping::default())].into();
    m.channels.load.group = Some("loads".into());
    let files = LogFiles {
        main: vec![file("group_positions.parquet")],
        groups: [("loads".to_owned(), vec![file("group_loads.parquet")])].into(),
    };
    assert_is_the_flight(&actuators(&files, &m), "groups", 0.0, 2);
    let log = opened(&file("group_positions.parquet"), &m);
    let error = log.actuators(&m.channels, None).unwrap_err();
    assert_eq!(error.diagnostic().code, "group_missing");
}

/// Files that pyarrow 26.0.1 wrote with an encrypted footer, with an encrypted column under a plain footer, and one
/// whose footer names encoding 10, which is ALP in the format's list of encodings.
#[test]
fn encrypted_files_and_new_encodings_are_named() {
    let diagnostic = |name: &str| read(&file("..").join(name), &plain()).unwrap_err().diagnostic();
    assert_eq!(diagnostic("encrypted_footer.parquet").code, "encrypted");
    let column = diagnostic("encrypted_column.parquet");
    assert_eq!(column.code, "encrypted");
    assert!(column.message.contains("`m`"), "{column}");
    let alp = diagnostic("alp.parquet");
    assert_eq!(alp.code, "encoding_unsupported");
    assert!(alp.message.contains("ALP"), "{alp}");
}
