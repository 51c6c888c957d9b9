//! Diagnostics of the last months in addition to gaps, by position: innovations and rejections.

use std::collections::BTreeMap;

use ingest::tables::TableBatch;
use jiff::{SignedDuration, Timestamp};
use records::Status;
use store::{Query, Store};

use crate::error::Error;
use crate::fleet::histories::TailPosition;
use crate::fleet::row_keys::TextColumn;
use crate::fleet::unit_rows::{RowsByUnit, at, of_store};

/// Maximum age of the flights: some months.
const LOOKED_BACK: SignedDuration = SignedDuration::from_hours(24 * 120);

/// One flight of one place.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct FlightDiagnostics {
    pub(crate) departure_utc: Timestamp,
    pub(crate) flight_id: Box<str>,
    pub(crate) nis: Option<f64>,
    /// Stiffness fitted in the flight, N/m.
    pub(crate) stiffness_n_per_m: Option<f64>,
    /// Rejection code of a flight without a gap.
    pub(crate) rejection: Option<Box<str>>,
}

/// Where which unit sits.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct PositionKey {
    pub(crate) tail_number: String,
    pub(crate) position: String,
    pub(crate) part_number: String,
    pub(crate) serial_number: String,
}

/// Flights of a unit at one position, by departure.
pub(crate) type RecentDiagnostics = BTreeMap<PositionKey, Vec<FlightDiagnostics>>;

/// The last months until a time, with it.
pub(crate) fn recent_diagnostics(store: &Store, until: Timestamp) -> Result<RecentDiagnostics, Error> {
    const COLUMNS: [&str; 10] = [
        "tail_number",
        "position",
        "part_number",
        "serial_number",
        "flight_id",
        "departure_utc",
        "nis",
        "stiffness_n_per_m",
        "status",
        "reason",
    ];
    let since_utc = until.checked_sub(LOOKED_BACK).ok();
    let until_utc = until.checked_add(SignedDuration::from_micros(1)).ok();
    let query = Query { since_utc, until_utc, ..Query::default() };
    let parts = of_store(&store.scan_columns(&query, &COLUMNS)?, |rows, chunk, _| add(rows, chunk))?;
    let mut found = RecentDiagnostics::new();
    for ((part_number, serial_number), parts) in parts {
        for part in parts {
            for (place, flight) in part.rows {
                let TailPosition { tail_number, position } = part.places[place as usize].clone();
                let key = PositionKey {
                    tail_number: tail_number.unwrap_or_default(),
                    position: position.unwrap_or_default(),
                    part_number: part_number.clone().unwrap_or_default(),
                    serial_number: serial_number.clone(),
                };
                found.entry(key).or_default().push(flight);
            }
        }
    }
    for flights in found.values_mut() {
        flights.sort_by(|a, b| (a.departure_utc, &a.flight_id).cmp(&(b.departure_utc, &b.flight_id)));
    }
    Ok(found)
}

fn add(rows: &mut RowsByUnit<(u32, FlightDiagnostics)>, chunk: &TableBatch) -> Result<(), ingest::Error> {
    let numbers = |name: &str| chunk.numbers(Some(chunk.column(&[name])?));
    let texts = |name: &str| TextColumn::of(chunk, &[name]);
    let (nis, stiffness) = (numbers("nis")?, numbers("stiffness_n_per_m")?);
    let (flights, statuses, reasons) = (texts("flight_id")?, texts("status")?, texts("reason")?);
    let departures = chunk.timestamps(Some(chunk.column(&["departure_utc"])?))?;
    rows.add_rows(chunk, |row, unit, place| {
        let is_refused = statuses.get(row) == Some(Status::Refused.as_str());
        if let Ok(departure_utc) = Timestamp::from_microsecond(departures.value(row)) {
            let flight = FlightDiagnostics {
                departure_utc,
                flight_id: flights.get(row).unwrap_or_default().into(),
                nis: at(&nis, row),
                stiffness_n_per_m: at(&stiffness, row),
                rejection: reasons.get(row).filter(|_| is_refused).map(Into::into),
            };
            unit.rows.push((place, flight));
        }
        Ok(())
    })
}
