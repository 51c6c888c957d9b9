//! What the last months' flights say beside gaps: delay, stiffness and surprise, place by place.

use std::collections::BTreeMap;
use std::path::Path;

use ingest::tables::Chunk;
use jiff::{SignedDuration, Timestamp};
use store::{Query, Store};

use crate::error::Error;
use crate::gathering::at;
use crate::parts::read_each;

/// As far back as is looked: some months of flights.
const LOOKED_BACK: SignedDuration = SignedDuration::from_hours(24 * 120);

/// One flight of one place.
#[derive(Debug, Clone, PartialEq)]
#[expect(missing_docs, reason = "each field is named for the contract's column, with its unit")]
pub struct Look {
    pub departure_utc: Timestamp,
    pub flight_id: Box<str>,
    pub skew_s: Option<f64>,
    pub stiffness_n_per_m: Option<f64>,
    pub nis: Option<f64>,
}

/// Where which unit sits.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
#[expect(missing_docs, reason = "each field is named for the contract's column")]
pub struct Seat {
    pub tail_number: String,
    pub position: String,
    pub part_number: String,
    pub serial_number: String,
}

/// The flights of a unit in a seat, by departure.
pub type Lately = BTreeMap<Seat, Vec<Look>>;

/// The last months until a time, with it.
///
/// # Errors
/// When the store cannot be read.
pub fn lately(store: &Store, until: Timestamp) -> Result<Lately, Error> {
    const COLUMNS: [&str; 9] = [
        "tail_number",
        "position",
        "part_number",
        "serial_number",
        "flight_id",
        "departure_utc",
        "skew_s",
        "stiffness_n_per_m",
        "nis",
    ];
    let since_utc = until.checked_sub(LOOKED_BACK).ok();
    let until_utc = until.checked_add(SignedDuration::from_micros(1)).ok();
    let query = Query { since_utc, until_utc, ..Query::default() };
    let mut found = Lately::new();
    let parts = store.parts(&query, &COLUMNS)?;
    read_each(&parts, |batch| add(&mut found, &Chunk::new(Path::new("results"), batch.clone(), 0)))?;
    for looks in found.values_mut() {
        looks.sort_by(|a, b| (a.departure_utc, &a.flight_id).cmp(&(b.departure_utc, &b.flight_id)));
    }
    Ok(found)
}

fn add(found: &mut Lately, chunk: &Chunk) -> Result<(), ingest::Error> {
    let texts = |name: &str| chunk.texts(Some(chunk.column(&[name])?));
    let numbers = |name: &str| chunk.numbers(Some(chunk.column(&[name])?));
    let [tails, positions, parts, serials, flights] =
        ["tail_number", "position", "part_number", "serial_number", "flight_id"].map(texts);
    let (tails, positions, parts, serials, flights) = (tails?, positions?, parts?, serials?, flights?);
    let [skews_s, stiffnesses, surprises] = ["skew_s", "stiffness_n_per_m", "nis"].map(numbers);
    let (skews_s, stiffnesses, surprises) = (skews_s?, stiffnesses?, surprises?);
    let departures = chunk.instants(Some(chunk.column(&["departure_utc"])?))?;
    for row in 0..chunk.len() {
        let text = |name: Option<&str>| name.unwrap_or_default().to_owned();
        let Ok(departure_utc) = Timestamp::from_microsecond(departures.value(row)) else { continue };
        let seat = Seat {
            tail_number: text(tails.get(row)),
            position: text(positions.get(row)),
            part_number: text(parts.get(row)),
            serial_number: text(serials.get(row)),
        };
        found.entry(seat).or_default().push(Look {
            departure_utc,
            flight_id: flights.get(row).unwrap_or_default().into(),
            skew_s: at(&skews_s, row),
            stiffness_n_per_m: at(&stiffnesses, row),
            nis: at(&surprises, row),
        });
    }
    Ok(())
}

/// The newest departure of all.
pub(crate) fn newest_utc(lately: &Lately) -> Option<Timestamp> {
    lately.values().filter_map(|looks| looks.last()).map(|look| look.departure_utc).max()
}
