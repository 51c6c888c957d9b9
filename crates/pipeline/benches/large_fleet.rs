//! Store of a simulated fleet, to test the report at any size: `large_fleet DIR UNITS FLIGHTS`.
//!
//! Writes `pipeline.toml`, the tables it names, and a store with a record for each unit and flight: four
//! units per tail, one flight of two hours a day, each unit with its own wear law and scatter. Some
//! units are steady, some step, some flights are rejected, some logs are in error. The first tail and the
//! names on it are an attack on pages that do not escape them. Equal arguments make equal records.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a fleet that cannot be made is none")]

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use jiff::{SignedDuration, Timestamp};
use records::{GapEstimate, GapRecord, Status};
use store::{LogOutcome, LogRecord, LogResult, RunRecord, Store};

#[path = "../tests/integration/fleet.rs"]
#[allow(dead_code, reason = "it holds what the tests need")]
mod fleet;

const POSITIONS: [&str; 4] = ["aileron_left", "aileron_right", "elevator_left", "elevator_right"];
const PARTS: [&str; 2] = ["EMA-27-1040", "EMA-27-1060"];
const HOURS: f64 = 2.0;
const COMMIT: usize = 4_000;
/// One log of this number has failed, and one record of the number below is refused.
const ERROR_EVERY: usize = 997;
const REFUSED_EVERY: usize = 19;

fn main() {
    let mut args = std::env::args().skip(1).filter(|a| a != "--bench");
    let mut argument = || args.next().expect("usage: large_fleet DIR UNITS FLIGHTS");
    let (dir, units, flights) =
        (argument(), argument().parse::<usize>().unwrap(), argument().parse::<usize>().unwrap());
    let dir = Path::new(&dir);
    fs::create_dir_all(dir).unwrap();
    fs::write(dir.join("pipeline.toml"), settings()).unwrap();
    fs::write(dir.join("installations.csv"), installations(units)).unwrap();
    fs::write(dir.join("inspections.csv"), inspections(units, flights)).unwrap();
    fill(&dir.join("results"), units.div_ceil(POSITIONS.len()), flights);
}

/// The small fleet's settings, with this fleet's tables.
fn settings() -> String {
    let inspected = "installations = \"installations.csv\"\ninspections = \"inspections.csv\"";
    include_str!("../../../tests/data/three-aircraft/pipeline.toml")
        .replace("sample-data/logs/", "logs/")
        .replace("installations = \"sample-data/installations.csv\"", inspected)
}

fn tail(tail: usize) -> String {
    if tail == 0 { "<script>alert(1)</script>".to_owned() } else { format!("N{tail:04}X") }
}

fn serial(tail: usize, place: usize) -> String {
    match (tail, place) {
        (0, 0) => "\"><img src=x onerror=alert(2)>".to_owned(),
        (0, 1) => "'); alert(3); ('".to_owned(),
        (0, 2) => "{{ 7 * 7 }}</title></table>&amp;".to_owned(),
        (0, _) => "../../🛩 \u{202e}drawkcab".to_owned(),
        _ => format!("S{:06}", tail * POSITIONS.len() + place),
    }
}

fn departure(flight: usize) -> Timestamp {
    let first: Timestamp = "2025-11-01T06:00:00Z".parse().unwrap();
    first + SignedDuration::from_hours(24 * flight as i64)
}

/// A number from 0 to 1 that belongs to a unit: `what` tells which of them.
fn chance(tail: usize, place: usize, what: u64) -> f64 {
    fleet::random((tail, place, what)).f64()
}

/// Hours of a unit before its first flight.
fn age_h(tail: usize, place: usize) -> f64 {
    3500.0 * chance(tail, place, 4)
}

/// Gap of a unit in one of its flights: most wear by a law of their own, and some have a step.
fn gap_um(tail: usize, place: usize, flight: usize, flights: usize) -> f64 {
    let chance = |what| chance(tail, place, what);
    let wears = chance(0) < 0.8;
    let um_per_1000_h = if wears { (2.0 * (chance(2) - 0.5)).exp() * 14.0 } else { 0.0 };
    let hours = age_h(tail, place) + HOURS * flight as f64;
    let worn = um_per_1000_h * (hours / 1000.0).powf(0.8 + 0.6 * chance(3));
    let has_stepped = chance(5) < 0.03 && flight >= (flights as f64 * chance(6)) as usize;
    let step = if has_stepped { -25.0 * chance(7) } else { 0.0 };
    (20.0 + 6.0 * chance(1) + worn + step).max(5.0)
}

fn record(tail_at: usize, place: usize, flight: usize, flights: usize) -> GapRecord {
    let gap_um = gap_um(tail_at, place, flight, flights) + 1.2 * fleet::scatter((tail_at, place, flight));
    let noise = |quantity: usize| fleet::scatter((tail_at, place, quantity, flight));
    let refused = (tail_at + 7 * place + flight).is_multiple_of(REFUSED_EVERY);
    let estimate = GapEstimate {
        gap_p05_m: Some((gap_um - 1.645) * 1e-6),
        gap_p95_m: Some((gap_um + 1.645) * 1e-6),
        gap_midrange_m: Some((gap_um + 0.4) * 1e-6),
        load_reversals: 120,
        samples: 11_000,
        samples_upper: 5_000,
        samples_lower: 5_200,
        load_p05_n: Some(-2_300.0),
        load_p95_n: Some(2_600.0),
        stiffness_n_per_m: Some(5e7 * (1.0 + 0.002 * noise(1))),
        stiffness_se_n_per_m: Some(1e5),
        friction_n: Some(150.0 + 15.0 * noise(2)),
        friction_se_n: Some(15.0),
        skew_s: Some(2e-5 * noise(3)),
        skew_se_s: Some(2e-5),
        load_zero_n: Some(20.0 * noise(4)),
        load_zero_se_n: Some(20.0),
        load_delay_s: Some(3e-4 * noise(5)),
        load_delay_se_s: Some(3e-4),
        nis: Some(1.0 + 0.1 * noise(6)),
        ..fleet::estimated(gap_um)
    };
    let estimate = if refused { GapEstimate::refused("no_load_reversal") } else { estimate };
    let [tail, serial] = [tail(tail_at), serial(tail_at, place)];
    let names = [&*tail, POSITIONS[place], PARTS[place / 2], &serial, &format!("{tail_at}-{flight:04}")];
    let mut record = fleet::record(names, departure(flight), HOURS, estimate);
    let hours = HOURS * (flight + 1) as f64;
    (record.flight.tail_hours_end, record.unit_hours) =
        (Some(1000.0 + hours), Some(age_h(tail_at, place) + hours));
    record.provenance.log_path = log(tail_at, flight);
    record
}

fn log(tail_at: usize, flight: usize) -> String {
    format!("logs/{}/{flight:04}.parquet", tail(tail_at))
}

fn result(tail_at: usize, flight: usize, flights: usize) -> LogResult {
    let bad = (tail_at * 31 + flight).is_multiple_of(ERROR_EVERY);
    let places = 0..POSITIONS.len();
    let records: Vec<GapRecord> = places.map(|place| record(tail_at, place, flight, flights)).collect();
    let refused = records.iter().filter(|r| r.estimate.status == Status::Refused).count() as i64;
    let mut result = fleet::result(records);
    result.account.estimated -= refused;
    result.account.refused = refused;
    if bad {
        result.records.clear();
        result.account = LogRecord {
            outcome: LogOutcome::Error,
            estimated: 0,
            refused: 0,
            error_code: Some("time_goes_back".to_owned()),
            error_detail: Some("column <b>t_ns</b>, row 1204311".to_owned()),
            ..result.account
        };
    }
    result
}

fn fill(store: &Path, tails: usize, flights: usize) {
    let mut writer = Store::create_or_open(store).unwrap().lock(None).unwrap();
    let mut night = Vec::new();
    for flight in 0..flights {
        night.extend((0..tails).map(|tail_at| result(tail_at, flight, flights)));
        if night.len() >= COMMIT || flight + 1 == flights {
            writer.commit(&std::mem::take(&mut night)).unwrap();
        }
    }
    let done = (tails * flights) as i64;
    let row = RunRecord {
        run_id: "made".to_owned(),
        started_utc: departure(flights),
        finished_utc: Some(departure(flights)),
        program_version: "made".to_owned(),
        config_path: "pipeline.toml".to_owned(),
        found: done,
        done,
        exit_code: Some(0),
        ..RunRecord::default()
    };
    writer.end_run(&row).unwrap();
}

fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('"', "\"\""))
}

fn installations(units: usize) -> String {
    let columns = "tail_number,position,part_number,serial_number,installed_utc,removed_utc";
    let mut table = format!("{columns},unit_hours_at_install,tail_hours_at_install\n");
    for tail_at in 0..units.div_ceil(POSITIONS.len()) {
        for (place, position) in POSITIONS.iter().enumerate() {
            let (name, serial) = (quoted(&tail(tail_at)), quoted(&serial(tail_at, place)));
            let part = PARTS[place / 2];
            let hours = age_h(tail_at, place);
            let _ = writeln!(table, "{name},{position},{part},{serial},2025-10-31T00:00:00Z,,{hours},1000");
        }
    }
    table
}

/// A check of one unit in eight, 3 µm above the gap, with a dial gauge's scatter.
fn inspections(units: usize, flights: usize) -> String {
    let mut table = "part_number,serial_number,date_utc,play_m,instrument,force_n\n".to_owned();
    let at = flights.saturating_sub(flights / 5 + 1);
    for k in (0..units).step_by(8) {
        let (tail_at, place) = (k / POSITIONS.len(), (k / 8) % POSITIONS.len());
        let gap_um = gap_um(tail_at, place, at, flights) + 3.0 + 4.0 * fleet::scatter((tail_at, place));
        let (part, serial) = (PARTS[place / 2], quoted(&serial(tail_at, place)));
        let date = departure(at);
        writeln!(table, "{part},{serial},{date},{:e},<i>dial gauge</i>,200", gap_um * 1e-6).unwrap();
    }
    table
}
