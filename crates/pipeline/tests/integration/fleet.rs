//! Configurations, installations, records and stores of planned fleets.

use std::collections::BTreeMap;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::Path;
use std::sync::Arc;

use ingest::Flights;
use jiff::{SignedDuration, Timestamp};
use job::Config;
use records::{GapEstimate, GapRecord, Installation, PartNumber, Position, SerialNumber, Status, TailNumber};
use store::{LogResult, Store};

pub(crate) use self::made_up::{record, result};

#[path = "../../../../tests/made_up.rs"]
mod made_up;

/// Configuration of the sample fleet, with a text replaced by another; relative paths begin in this crate's folder.
pub(crate) fn config_with(from: &str, to: &str) -> Config {
    let text = include_str!("../../../../tests/data/three-aircraft/pipeline.toml");
    assert!(text.contains(from), "{from} is not in the configuration");
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    Config::parse(&text.replace(from, to), Path::new("pipeline.toml"), folder).unwrap()
}

pub(crate) fn config() -> Config {
    config_with("[logs]", "[logs]")
}

pub(crate) fn with_flights(mut config: Config, table: &str) -> Config {
    let file = tempfile::NamedTempFile::with_suffix(".csv").unwrap();
    std::fs::write(file.path(), table).unwrap();
    let flights = Flights::read(file.path(), &BTreeMap::new(), &config.document.identity);
    config.flights = Arc::new(flights.unwrap());
    config
}

pub(crate) fn installation(
    [tail, position, part, serial]: [&str; 4],
    installed_utc: Timestamp,
    removed_utc: Option<Timestamp>,
) -> Installation {
    Installation {
        tail_number: TailNumber::new(tail).unwrap(),
        position: Position::new(position).unwrap(),
        part_number: PartNumber::new(part).unwrap(),
        serial_number: SerialNumber::new(serial).unwrap(),
        installed_utc,
        removed_utc,
        unit_hours_at_install: None,
        tail_hours_at_install: None,
        today: None,
    }
}

/// An estimate of a gap, µm, to 1 µm.
pub(crate) fn estimated(gap_um: f64) -> GapEstimate {
    GapEstimate {
        status: Status::Estimated,
        gap_m: Some(gap_um * 1e-6),
        gap_se_m: Some(1e-6),
        load_reversals: 100,
        ..GapEstimate::default()
    }
}

pub(crate) fn store(folder: &Path, results: &[LogResult]) -> Store {
    let store = Store::create_or_open(folder.join("results")).unwrap();
    store.lock(None).unwrap().commit(results).unwrap();
    store
}

/// Random numbers that depend on names alone.
pub(crate) fn random(names: impl Hash) -> fastrand::Rng {
    let mut seed = DefaultHasher::new();
    names.hash(&mut seed);
    fastrand::Rng::with_seed(seed.finish())
}

/// Scatter of mean zero and standard deviation one that depends on names alone: twelve uniform numbers less six.
pub(crate) fn scatter(names: impl Hash) -> f64 {
    let mut random = random(names);
    (0..12).map(|_| random.f64()).sum::<f64>() - 6.0
}

/// First departure of the nth day of a fleet that wears.
pub(crate) fn day(count: i32) -> Timestamp {
    "2024-01-01T06:00:00Z".parse::<Timestamp>().unwrap() + SignedDuration::from_hours(24) * count
}

/// A record of a unit that wears by a number of µm in 1,000 h from 20 µm on, flies some hours a day, and is read by the
/// hour meter of its tail.
pub(crate) fn worn(
    unit: i32,
    at: i32,
    position: &str,
    [um_per_1000_h, hours_a_day, flight_hours]: [f64; 3],
) -> GapRecord {
    let hours = hours_a_day * f64::from(at + 1);
    let gap_um = 20.0 + um_per_1000_h * hours / 1000.0 + scatter((unit, at));
    let [tail, serial, flight] = [format!("T{unit:02}"), format!("S{unit:02}"), format!("{unit}-{at}")];
    let names = [&tail, position, "EMA-27-1040", &serial, &flight];
    let mut record = record(names, day(at), flight_hours, estimated(gap_um));
    record.flight.tail_hours_end = Some(500.0 + hours);
    record
}
