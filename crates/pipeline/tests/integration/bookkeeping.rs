//! Random sequences of logs, corrected tables, withdrawals and kills end where one ordered run over the last tables does:
//! what is stored then is what that run makes of each log.

use std::collections::BTreeMap;
use std::path::Path;

use jiff::{SignedDuration, Timestamp};
use job::Config;
use pipeline::fleet::bookkeeping::dates_ahead::dates_ahead;
use pipeline::fleet::bookkeeping::join::Bookkeeping;
use records::{
    Alias, GapEstimate, GapRecord, Installation, Installations, Position, RunRecord, SerialNumber, Status,
    TailNumber,
};
use store::{LogResult, Query, Store, Writer};

use crate::fleet;
use crate::gate::is_gate;

const FLIGHTS: i64 = 6;
const POSITIONS: [&str; 2] = ["aileron_left", "aileron_right"];
const VERSIONS: u64 = 6;

fn departure(flight: i64) -> Timestamp {
    "2026-03-01T06:00:00Z".parse::<Timestamp>().unwrap() + SignedDuration::from_hours(24 * flight)
}

/// The tables of a version: each has a unit in every position at every time, so that every record has its place.
fn tables(version: u64) -> (Config, Installations) {
    let change = departure(version as i64) - SignedDuration::from_hours(1);
    let part = if version == 4 { "EMA-27-1060" } else { "EMA-27-1040" };
    let unit = |position: &str, serial: &str, from: Timestamp, to: Option<Timestamp>| Installation {
        unit_hours_at_install: Some(100.0 * version as f64),
        tail_hours_at_install: Some(1_000.0),
        ..fleet::installation(["N1", position, part, serial], from, to)
    };
    let begin = departure(-1);
    let rows = match version % 3 {
        0 => vec![unit(POSITIONS[0], "A", begin, None), unit(POSITIONS[1], "B", begin, None)],
        1 => vec![
            unit(POSITIONS[0], "A", begin, Some(change)),
            unit(POSITIONS[0], "C", change, None),
            unit(POSITIONS[1], "B", begin, None),
        ],
        _ => vec![
            unit(POSITIONS[0], "A", begin, Some(change)),
            unit(POSITIONS[1], "B", begin, Some(change)),
            unit(POSITIONS[0], "B", change, None),
            unit(POSITIONS[1], "A", change, None),
        ],
    };
    let alias = Alias {
        former_part_number: None,
        former_serial_number: SerialNumber::new("B").unwrap(),
        part_number: None,
        serial_number: SerialNumber::new("B-new").unwrap(),
    };
    let installations = Installations::new(rows).unwrap();
    let aliases = if version == 5 { vec![alias] } else { Vec::new() };
    let row = |flight: i64| {
        let hours = 1.0 + 0.25 * version as f64;
        format!("N1,FP1,{},{hours},{}\n", departure(flight), 1_000.0 + hours * (flight + 1) as f64)
    };
    let rows: String = (0..FLIGHTS).map(row).collect();
    let head = "tail_number,flight_id,departure_utc,flight_hours,tail_hours_end\n";
    let config = fleet::with_flights(fleet::config(), &format!("{head}{rows}"));
    (config, installations.with_aliases(&aliases))
}

/// What a run stores of a flight's log under some tables. `correction` is the state of the log's content.
fn result(flight: i64, correction: u64, (config, installations): &(Config, Installations)) -> LogResult {
    let at = departure(flight);
    let row = config.flights.of("N1", "FP1", at);
    let record = |position: &str| {
        let (tail, place) = (TailNumber::new("N1").unwrap(), Position::new(position).unwrap());
        let installation = installations.installed_at(&tail, &place, at).unwrap();
        let (part, serial) = installation.unit();
        let gap_m = 1e-6 * (50 + flight) as f64 + 1e-7 * correction as f64;
        let estimate =
            GapEstimate { status: Status::Estimated, gap_m: Some(gap_m), ..GapEstimate::default() };
        let names = ["N1", position, part.as_str(), serial.as_str(), "FP1"];
        let mut record = fleet::record(names, at, 0.0, estimate);
        record.flight.flight_hours = row.and_then(|row| row.flight_hours);
        record.flight.tail_hours_end = row.and_then(|row| row.tail_hours_end);
        record.unit_hours = installation.unit_hours(record.flight.tail_hours_end);
        record.provenance.log_digest = format!("d{correction}");
        record
    };
    fleet::result(POSITIONS.map(record).to_vec())
}

fn run_row(number: i64, tables_digest: Option<String>) -> RunRecord {
    RunRecord {
        run_id: format!("run-{number}"),
        // A clock that goes back from run to run: the order of commits counts.
        started_utc: departure(200 - number),
        finished_utc: Some(departure(200 - number)),
        program_version: "0".into(),
        exit_code: tables_digest.as_ref().map(|_| 0),
        tables_digest,
        ..RunRecord::default()
    }
}

fn writer(folder: &Path) -> Writer {
    Store::create_or_open(folder).unwrap().lock(None).unwrap()
}

/// A run: some logs, then the tables, then its end; a killed one stops after `steps`.
fn run(
    folder: &Path,
    number: i64,
    logs: &[(i64, u64)],
    tables: &(Config, Installations),
    steps: u64,
) -> Vec<(i64, u64)> {
    let mut writer = writer(folder);
    writer.begin_run(&run_row(number, None), &[]).unwrap();
    let done: Vec<(i64, u64)> = logs.iter().take(steps as usize).copied().collect();
    let results: Vec<LogResult> =
        done.iter().map(|(flight, content)| result(*flight, *content, tables)).collect();
    if !results.is_empty() {
        writer.commit(&results).unwrap();
    }
    if steps as usize > logs.len() {
        let books = Bookkeeping::new(&tables.0, &tables.1);
        books.write(&mut writer, &BTreeMap::new()).unwrap();
        if steps as usize > logs.len() + 1 {
            writer.end_run(&run_row(number, Some(books.digest().to_owned()))).unwrap();
        }
    }
    done
}

fn records(folder: &Path, tables: &(Config, Installations)) -> Vec<GapRecord> {
    let books = Bookkeeping::new(&tables.0, &tables.1);
    match Store::open(folder) {
        // No run has stored a record.
        Err(store::Error::Missing { .. }) => Vec::new(),
        store => books.join_to(store.unwrap()).unwrap().records(&Query::default()).unwrap(),
    }
}

#[test]
fn any_order_of_logs_corrections_and_kills_ends_where_one_ordered_run_does() {
    let versions: Vec<(Config, Installations)> = (0..VERSIONS).map(tables).collect();
    let sequences = if is_gate() { 1_000 } else { 12 };
    let sequence = |seed: u64| {
        let mut chance = fastrand::Rng::with_seed(seed);
        let dir = tempfile::tempdir().unwrap();
        let mixed = dir.path().join("results");
        // The content of each log that was stored last, and flights that are withdrawn.
        let mut stored = BTreeMap::<i64, u64>::new();
        let mut withdrawn = BTreeMap::<i64, u64>::new();
        for number in 0..2 + chance.i64(..4) {
            let logs: Vec<(i64, u64)> =
                (0..chance.u64(..4)).map(|_| (chance.i64(..FLIGHTS), chance.u64(..3))).collect();
            let steps = chance.u64(..logs.len() as u64 + 4);
            let version = &versions[chance.u64(..VERSIONS) as usize];
            for (flight, correction) in run(&mixed, number, &logs, version, steps) {
                stored.insert(flight, correction);
                withdrawn.remove(&flight);
            }
            if chance.u64(..5) == 0 {
                let flight = chance.i64(..FLIGHTS);
                let until_utc = Some(departure(flight) + SignedDuration::from_hours(1));
                let query = Query { since_utc: Some(departure(flight)), until_utc, ..Query::default() };
                let undo = withdrawn.contains_key(&flight);
                let count = writer(&mixed).withdraw(&query, None, undo).unwrap().records;
                assert_eq!(count > 0, stored.contains_key(&flight) || undo, "seed {seed}");
                if undo {
                    stored.extend(withdrawn.remove(&flight).map(|correction| (flight, correction)));
                } else {
                    withdrawn.extend(stored.remove(&flight).map(|correction| (flight, correction)));
                }
            }
        }
        let last = &versions[chance.u64(..VERSIONS) as usize];
        // What one run over the last tables stores, in order of departure.
        let logs = stored.into_iter().map(|(flight, content)| result(flight, content, last));
        let expected: Vec<GapRecord> = logs.flat_map(|result| result.records).collect();
        // Every reader joins the tables, before and after a run writes them.
        assert_eq!(records(&mixed, last), expected, "seed {seed}, joined");
        run(&mixed, 90, &[], last, u64::MAX);
        let written = Store::create_or_open(&mixed).unwrap().records(&Query::default()).unwrap();
        assert_eq!(written, expected, "seed {seed}");
    };
    // Threads of their own: a pool's thread that waits for the store would begin the next sequence on its stack.
    let threads = std::thread::available_parallelism().map_or(1, std::num::NonZero::get) as u64;
    let share = |first: u64| (first..sequences).step_by(threads as usize).for_each(&sequence);
    std::thread::scope(|scope| {
        let running: Vec<_> = (0..threads).map(|first| scope.spawn(move || share(first))).collect();
        for thread in running {
            thread.join().unwrap();
        }
    });
}

#[test]
fn a_date_ahead_whose_day_and_month_exchanged_are_past_names_that_date() {
    let utc = |text: &str| text.parse::<Timestamp>().unwrap();
    let (installed, removed) = (utc("2026-08-24T00:00:00Z"), utc("2026-12-10T06:00:00Z"));
    let installation = fleet::installation(["N1", "left", "P", "S"], installed, Some(removed));
    let table = Installations::new(vec![installation]).unwrap();
    let named =
        |now: &str| dates_ahead(&table, [], utc(now)).iter().map(ToString::to_string).collect::<Vec<_>>();
    let likely =
        "P / S: `removed_utc` is 2026-12-10, a date to come; day and month may be exchanged (2026-10-12)";
    assert_eq!(named("2026-11-23T00:00:00Z"), [likely]);
    // Before the exchanged date, nothing hints at an exchange; at the date itself, it has come.
    assert_eq!(named("2026-10-01T00:00:00Z"), [likely.split(';').next().unwrap()]);
    assert!(named("2026-12-10T00:00:00Z").is_empty());
}
