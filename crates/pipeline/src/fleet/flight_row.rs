//! One flight of one unit in as few bytes as its numbers take: a fleet has tens of millions of them.

use jiff::Timestamp;

/// One flight of one unit, from the store or from an external table of estimates.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(missing_docs, reason = "each field is named for the contract's column, with its unit")]
pub struct FlightInput<'a> {
    pub flight_id: Option<&'a str>,
    pub departure_utc: Timestamp,
    pub flight_hours: Option<f64>,
    pub tail_hours_end: Option<f64>,
    pub load_reversals: Option<u64>,
    pub gap_m: Option<f64>,
    pub gap_se_m: Option<f64>,
    /// The gap by the other estimator where the record has the flag `estimators_disagree`; of a flagged record of an
    /// external table its own.
    pub disagreeing_gap_m: Option<f64>,
}

/// A flight, and its secondary columns.
pub(crate) type StoredFlight = (FlightRow, FlightExtras);

/// A flight as a unit's history keeps it, in 32 bytes.
#[derive(Debug, Clone, Copy)]
pub struct FlightRow {
    departure_us: i64,
    /// `NaN` for none.
    gap_m: f64,
    /// Which of its unit's places it was flown in.
    pub(crate) place: u32,
    /// Which of its unit's flights it is, by departure.
    pub(crate) row: u32,
    /// Where its name begins and ends among its unit's names; at one place where it has none.
    name: [u32; 2],
}

impl FlightRow {
    /// A flight in a place of its unit; its name is appended to those of the unit's other flights.
    pub(crate) fn new(row: &FlightInput<'_>, place: u32, names: &mut String) -> Self {
        let begin = names.len() as u32;
        names.push_str(row.flight_id.unwrap_or_default());
        Self {
            departure_us: row.departure_utc.as_microsecond(),
            gap_m: row.gap_m.unwrap_or(f64::NAN),
            place,
            row: 0,
            name: [begin, names.len() as u32],
        }
    }

    /// The same among more flights: its place has another number, and its name comes after others.
    pub(crate) fn relocate(&mut self, places: &[u32], names: u32) {
        self.place = places[self.place as usize];
        self.name = self.name.map(|at| at + names);
    }

    /// The same with its number among the unit's flights.
    pub(crate) fn numbered(self, row: u32) -> Self {
        Self { row, ..self }
    }

    /// Its name among those of its unit's flights.
    pub(crate) fn name_in<'a>(&self, names: &'a str) -> Option<&'a str> {
        let name = &names[self.name[0] as usize..self.name[1] as usize];
        (!name.is_empty()).then_some(name)
    }

    /// Departure, µs since 1970 UTC.
    pub fn departure_us(&self) -> i64 {
        self.departure_us
    }

    /// Departure, to the microsecond.
    pub fn departure_utc(&self) -> Timestamp {
        // Parsed as an instant when it was stored, so it is valid here.
        Timestamp::from_microsecond(self.departure_us).unwrap_or_default()
    }

    /// The gap, m; none of a refused flight.
    pub fn gap_m(&self) -> Option<f64> {
        known(self.gap_m)
    }
}

/// Secondary columns of a flight, in 32 bytes: needed only until usage is accumulated.
#[derive(Debug, Clone, Copy)]
pub struct FlightExtras {
    /// Numbers; `NaN` for none.
    flight_hours: f64,
    tail_hours_end: f64,
    /// With a negative sign where the record is uncertain.
    gap_se_m: f64,
    /// The largest number for none.
    load_reversals: u64,
}

impl FlightExtras {
    pub(crate) fn of(row: &FlightInput<'_>) -> Self {
        Self {
            flight_hours: row.flight_hours.unwrap_or(f64::NAN),
            tail_hours_end: row.tail_hours_end.unwrap_or(f64::NAN),
            gap_se_m: signed_error(row),
            load_reversals: row.load_reversals.unwrap_or(u64::MAX),
        }
    }

    /// The flight's length, hours.
    pub fn flight_hours(&self) -> Option<f64> {
        known(self.flight_hours)
    }

    /// The tail's hours after it.
    pub fn tail_hours_end(&self) -> Option<f64> {
        known(self.tail_hours_end)
    }

    /// Load reversals in it.
    pub fn load_reversals(&self) -> Option<u64> {
        (self.load_reversals != u64::MAX).then_some(self.load_reversals)
    }

    /// The gap's standard error, m; it spans both estimators where they disagree.
    pub fn gap_se_m(&self) -> Option<f64> {
        known(self.gap_se_m.abs())
    }

    /// Whether the estimators disagree, or the record of an external table is flagged.
    pub(crate) fn is_disputed(&self) -> bool {
        self.gap_se_m.is_sign_negative()
    }
}

/// The standard error of a gap; where the estimators disagree, with the distance between them, and negative.
fn signed_error(row: &FlightInput<'_>) -> f64 {
    match row.gap_m.zip(row.disagreeing_gap_m) {
        Some((gap_m, other_m)) => -row.gap_se_m.unwrap_or(0.0).hypot(gap_m - other_m),
        None => row.gap_se_m.unwrap_or(f64::NAN),
    }
}

fn known(number: f64) -> Option<f64> {
    (!number.is_nan()).then_some(number)
}
