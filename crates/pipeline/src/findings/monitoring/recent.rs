//! Diagnostics of the last months in addition to gaps, by position: innovations and rejections.

use std::collections::BTreeMap;
use std::path::Path;

use arrow::array::RecordBatch;
use ingest::tables::TableBatch;
use jiff::{SignedDuration, Timestamp};
use records::Status;
use store::{Query, Store};

use crate::error::Error;
use crate::fleet::builder::at;
use crate::fleet::parallel_scan::read_each;
use crate::fleet::row_keys::{KeyCache, KeyColumns, RowKey, TextColumn};

/// Maximum age of the flights: some months.
const LOOKED_BACK: SignedDuration = SignedDuration::from_hours(24 * 120);

/// One flight of one place.
#[derive(Debug, Clone, Default, PartialEq)]
#[expect(missing_docs, reason = "each field is named for the contract's column, with its unit")]
pub struct FlightDiagnostics {
    pub departure_utc: Timestamp,
    pub flight_id: Box<str>,
    pub nis: Option<f64>,
    /// Stiffness fitted in the flight, N/m.
    pub stiffness_n_per_m: Option<f64>,
    /// Rejection code of a flight without a gap.
    pub rejection: Option<Box<str>>,
}

/// Where which unit sits.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
#[expect(missing_docs, reason = "each field is named for the contract's column")]
pub struct PositionKey {
    pub tail_number: String,
    pub position: String,
    pub part_number: String,
    pub serial_number: String,
}

/// Flights of a unit at one position, by departure.
pub type RecentDiagnostics = BTreeMap<PositionKey, Vec<FlightDiagnostics>>;

/// The last months until a time, with it.
///
/// # Errors
/// When the store cannot be read.
pub fn recent_diagnostics(store: &Store, until: Timestamp) -> Result<RecentDiagnostics, Error> {
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
    let mut found = Found::default();
    read_each(&store.scan_columns(&query, &COLUMNS)?, |batch| found.add(batch))?;
    Ok(found.in_order())
}

/// Looks while their rows come in.
#[derive(Default)]
struct Found {
    by_seat: BTreeMap<PositionKey, usize>,
    diagnostics: Vec<Vec<FlightDiagnostics>>,
}

impl Found {
    fn add(&mut self, batch: &RecordBatch) -> Result<(), ingest::Error> {
        let chunk = TableBatch::new(Path::new("results"), batch.clone(), 0);
        let (keys, flights) = (KeyColumns::of(&chunk)?, TextColumn::of(&chunk, &["flight_id"])?);
        let nis = chunk.numbers(Some(chunk.column(&["nis"])?))?;
        let stiffness = chunk.numbers(Some(chunk.column(&["stiffness_n_per_m"])?))?;
        let (statuses, reasons) =
            (TextColumn::of(&chunk, &["status"])?, TextColumn::of(&chunk, &["reason"])?);
        let departures = chunk.timestamps(Some(chunk.column(&["departure_utc"])?))?;
        let mut seen = KeyCache::default();
        for row in 0..chunk.len() {
            let Ok(departure_utc) = Timestamp::from_microsecond(departures.value(row)) else { continue };
            let Some(who) = keys.key_at(row) else { continue };
            let of_position = seen.get_or(&keys, row, || self.of_position(who));
            self.diagnostics[of_position].push(FlightDiagnostics {
                departure_utc,
                flight_id: flights.get(row).unwrap_or_default().into(),
                nis: at(&nis, row),
                stiffness_n_per_m: at(&stiffness, row),
                rejection: reasons
                    .get(row)
                    .filter(|_| statuses.get(row) == Some(Status::Refused.as_str()))
                    .map(Into::into),
            });
        }
        Ok(())
    }

    fn of_position(&mut self, who: RowKey<'_>) -> usize {
        let text = |name: Option<&str>| name.unwrap_or_default().to_owned();
        let position = PositionKey {
            tail_number: text(who.tail_number),
            position: text(who.position),
            part_number: text(who.part_number),
            serial_number: who.serial_number.to_owned(),
        };
        let diagnostics = &mut self.diagnostics;
        *self.by_seat.entry(position).or_insert_with(|| {
            diagnostics.push(Vec::new());
            diagnostics.len() - 1
        })
    }

    fn in_order(mut self) -> RecentDiagnostics {
        let in_order = |(position, of_position): (PositionKey, usize)| {
            let mut diagnostics = std::mem::take(&mut self.diagnostics[of_position]);
            diagnostics.sort_by(|a, b| (a.departure_utc, &a.flight_id).cmp(&(b.departure_utc, &b.flight_id)));
            (position, diagnostics)
        };
        self.by_seat.into_iter().map(in_order).collect()
    }
}

/// The newest departure of all.
pub(crate) fn newest_utc(recent_diagnostics: &RecentDiagnostics) -> Option<Timestamp> {
    recent_diagnostics
        .values()
        .filter_map(|diagnostics| diagnostics.last())
        .map(|diagnostics| diagnostics.departure_utc)
        .max()
}
