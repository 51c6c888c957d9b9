//! Records and log status made up for tests of more than one crate.

use jiff::Timestamp;
use records::{
    Flight, FlightId, GapEstimate, GapRecord, PartNumber, Position, Provenance, SerialNumber, TailNumber,
};
use store::{LogRecord, LogResult};

/// A record of a tail, position, part number, serial number and flight.
pub(crate) fn record(
    [tail, position, part, serial, flight]: [&str; 5],
    departure_utc: Timestamp,
    flight_hours: f64,
    estimate: GapEstimate,
) -> GapRecord {
    GapRecord {
        flight: Flight {
            tail_number: TailNumber::new(tail).unwrap(),
            flight_id: FlightId::new(flight).unwrap(),
            departure_utc,
            flight_hours: Some(flight_hours),
            tail_hours_end: None,
        },
        position: Position::new(position).unwrap(),
        part_number: PartNumber::new(part).unwrap(),
        serial_number: SerialNumber::new(serial).unwrap(),
        unit_hours: None,
        estimate,
        provenance: Provenance {
            log_path: format!("{tail}/{flight} {departure_utc}.parquet"),
            log_digest: "d".into(),
            config_digest: "c".into(),
            program_version: "0".into(),
            run_id: "run".into(),
            processed_utc: departure_utc,
        },
    }
}

/// What a run stores of a log with some records of one flight.
pub(crate) fn result(records: Vec<GapRecord>) -> LogResult {
    let GapRecord { flight, provenance, .. } = &records[0];
    let account = LogRecord {
        log_path: provenance.log_path.clone(),
        size_bytes: 1_000,
        modified_utc_ns: 1_700_000_000_123_456_789,
        file_id: "1:2".into(),
        log_digest: Some(provenance.log_digest.clone()),
        config_digest: Some(provenance.config_digest.clone()),
        tail_number: Some(flight.tail_number.to_string()),
        flight_id: Some(flight.flight_id.to_string()),
        departure_utc: Some(flight.departure_utc),
        positions: records.iter().map(|record| record.position.to_string()).collect(),
        estimated: records.len() as i64,
        duration_s: 0.1,
        run_id: "run".into(),
        processed_utc: provenance.processed_utc,
        ..LogRecord::default()
    };
    LogResult { account, records, moved_from: Vec::new() }
}
