//! Fills a store of millions of rows, and measures the time of common queries.
//!
//! ```sh
//! cargo run -p store --release --example large -- fill FOLDER [DAYS]
//! cargo run -p store --release --example large -- ask FOLDER [DAYS]
//! ```
//! 500 tails fly five flights a day with eight actuators each; a unit moves to another tail every 250
//! days. A thousand days are 20 million rows. All but the last 30 days are stored as after a compaction,
//! sorted by tail; the last 30 as after daily runs, one file per run.

#![allow(clippy::print_stdout, reason = "an example that prints measurements")]

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use jiff::{SignedDuration, Timestamp};
use records::{
    Flight, FlightId, GapEstimate, GapRecord, PartNumber, Position, Provenance, SerialNumber, Status,
    TailNumber,
};
use store::{Holder, LogOutcome, LogRecord, LogResult, Query, Store};

type Maybe<T> = Result<T, Box<dyn Error>>;

const TAILS: usize = 500;
const NIGHTS: i64 = 1_000;
const FLIGHTS_A_NIGHT: i64 = 5;
const POSITIONS: [&str; 8] = [
    "aileron_left",
    "aileron_right",
    "elevator_left",
    "elevator_right",
    "rudder",
    "spoiler_left",
    "spoiler_right",
    "trim",
];
/// Nights that a unit stays on one tail.
const STAY: i64 = 250;
/// Nights that are not yet compacted.
const FRESH: i64 = 30;

fn main() -> Maybe<()> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    match args.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["fill", dir] => fill(Path::new(dir), NIGHTS),
        ["fill", dir, nights] => fill(Path::new(dir), nights.parse()?),
        ["ask", dir] => ask(Path::new(dir), NIGHTS),
        ["ask", dir, nights] => ask(Path::new(dir), nights.parse()?),
        _ => Err("usage: large fill|ask FOLDER [NIGHTS]".into()),
    }
}

fn fill(dir: &Path, nights: i64) -> Maybe<()> {
    let store = Store::create_or_open(dir)?;
    let mut writer = store.lock(&Holder::this_process(), None)?;
    let compacted = (nights - FRESH).max(0);
    for tails in (0..TAILS).collect::<Vec<_>>().chunks(2) {
        let flights = tails.iter().flat_map(|&tail| (0..compacted).map(move |night| (tail, night)));
        writer
            .commit(&flights.flat_map(|(tail, night)| of_night(tail, night)).collect::<Maybe<Vec<_>>>()?)?;
        println!("tails to {} of {TAILS}", tails.last().map_or(0, |tail| tail + 1));
    }
    for night in compacted..nights {
        let flights = (0..TAILS).flat_map(|tail| of_night(tail, night));
        writer.commit(&flights.collect::<Maybe<Vec<_>>>()?)?;
    }
    let rows = nights * TAILS as i64 * FLIGHTS_A_NIGHT * POSITIONS.len() as i64;
    println!("{rows} rows in {} files", store.files()?.len());
    Ok(())
}

fn of_night(tail: usize, night: i64) -> impl Iterator<Item = Maybe<LogResult>> {
    (0..FLIGHTS_A_NIGHT).map(move |leg| flight(tail, night, leg))
}

fn departure(night: i64, leg: i64, tail: usize) -> Timestamp {
    Timestamp::UNIX_EPOCH + SignedDuration::from_secs(((night * 24 + 4 * leg) * 60 + tail as i64 % 60) * 60)
}

fn serial(tail: usize, position: usize, night: i64) -> String {
    let unit = position * TAILS + (tail + night.div_euclid(STAY) as usize * 167) % TAILS;
    // Numbers of units that fly together do not stand together.
    format!("{:05}", unit * 7_919 % 100_003)
}

fn flight(tail: usize, night: i64, leg: i64) -> Maybe<LogResult> {
    let flight = Flight {
        tail_number: TailNumber::new(format!("N{:03}FP", 100 + tail))?,
        flight_id: FlightId::new(format!("{night:05}-{leg}"))?,
        departure_utc: departure(night, leg, tail),
        flight_hours: Some(2.5),
        tail_hours_end: Some(2.5 * (night * FLIGHTS_A_NIGHT + leg + 1) as f64),
    };
    let log_path = format!("logs/{}/{}.parquet", flight.tail_number, flight.flight_id);
    let run_id = format!("run-{night:05}");
    let digest = format!("{:064x}", (tail as u128) << 64 | (night as u128) << 8 | leg as u128);
    let stamp = Provenance {
        log_path,
        log_digest: digest,
        config_digest: format!("{:064x}", 7),
        program_version: "0.1.0".into(),
        run_id,
        processed_utc: flight.departure_utc + SignedDuration::from_hours(20),
    };
    let record = |at: usize| record(&flight, at, &serial(tail, at, night), &stamp);
    let records = (0..POSITIONS.len()).map(record).collect::<Maybe<Vec<_>>>()?;
    Ok(LogResult { account: account(&flight, &stamp), records, retires: Vec::new() })
}

/// Numbers with as many digits as real ones, so that files are as large as real ones.
fn record(flight: &Flight, at: usize, serial: &str, stamp: &Provenance) -> Maybe<GapRecord> {
    let seed = flight.departure_utc.as_second() as f64 + at as f64 * 0.37;
    let noise = |scale: f64| scale * (seed * scale.ln().abs()).sin();
    let gap_m = 40e-6 + noise(1e-6);
    let estimate = GapEstimate {
        status: Status::Estimated,
        reason: None,
        flags: if noise(1.3) > 1.25 { vec!["soft_contact".into()] } else { Vec::new() },
        gap_m: Some(gap_m),
        gap_se_m: Some(1e-6 + noise(1e-7)),
        gap_p05_m: Some(gap_m - 1.6e-6),
        gap_p95_m: Some(gap_m + 1.6e-6),
        gap_midrange_m: Some(gap_m + noise(2e-6)),
        stiffness_n_per_m: Some(5e7 + noise(1e6)),
        stiffness_se_n_per_m: Some(1e5 + noise(1e4)),
        skew_s: Some(noise(1e-3)),
        samples: 900_000,
        samples_upper: 200_000,
        samples_lower: 180_000,
        load_reversals: 40,
        load_p05_n: Some(-9e3 + noise(500.0)),
        load_p95_n: Some(8e3 + noise(700.0)),
        temperature_c: Some(12.0 + noise(9.0)),
        nis: Some(1.0 + noise(0.1)),
        ..GapEstimate::refused("none")
    };
    Ok(GapRecord {
        flight: flight.clone(),
        position: Position::new(POSITIONS[at])?,
        part_number: PartNumber::new("EMA-27-1040")?,
        serial_number: SerialNumber::new(serial)?,
        unit_hours: None,
        estimate,
        provenance: stamp.clone(),
    })
}

fn account(flight: &Flight, stamp: &Provenance) -> LogRecord {
    LogRecord {
        log_path: stamp.log_path.clone(),
        size_bytes: 9_000_000,
        modified_utc_ns: flight.departure_utc.as_second() * 1_000_000_000,
        file_id: format!("65024:{}", flight.departure_utc.as_second()),
        log_digest: Some(stamp.log_digest.clone()),
        config_digest: Some(stamp.config_digest.clone()),
        tail_number: Some(flight.tail_number.to_string()),
        flight_id: Some(flight.flight_id.to_string()),
        departure_utc: Some(flight.departure_utc),
        positions: POSITIONS.map(str::to_owned).to_vec(),
        outcome: LogOutcome::Done,
        estimated: POSITIONS.len() as i64,
        refused: 0,
        error_code: None,
        error_detail: None,
        duration_s: 0.4,
        run_id: stamp.run_id.clone(),
        processed_utc: stamp.processed_utc,
    }
}

/// Each question to a store opened for it, as a command does, and with files in the system's cache.
fn ask(dir: &Path, nights: i64) -> Maybe<()> {
    let last = departure(nights - 1, FLIGHTS_A_NIGHT - 1, 0);
    let year = last - SignedDuration::from_hours(24 * 365);
    let tail = || Some("N333FP".to_owned());
    let questions = [
        ("a tail's last year", Query { tail_number: tail(), since_utc: Some(year), ..Query::default() }),
        ("a tail's whole life", Query { tail_number: tail(), ..Query::default() }),
        ("a unit's whole life", Query { serial_number: Some(serial(233, 2, 0)), ..Query::default() }),
        ("a flight", Query { tail_number: tail(), flight_id: Some("00500-3".into()), ..Query::default() }),
        (
            "the last night",
            Query { since_utc: Some(last - SignedDuration::from_hours(20)), ..Query::default() },
        ),
    ];
    for (what, query) in questions {
        let mut took: Vec<f64> = Vec::new();
        let mut rows = 0;
        for _ in 0..7 {
            let clock = Instant::now();
            rows = Store::open(dir)?.scan(&query)?.num_rows();
            took.push(clock.elapsed().as_secs_f64() * 1e3);
        }
        took.sort_by(f64::total_cmp);
        println!("{what:<22} {rows:>7} rows  median {:>7.1} ms  worst {:>7.1} ms", took[3], took[6]);
    }
    Ok(())
}
