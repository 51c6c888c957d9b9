//! Keys of units, the positions in which they were installed, and one flight of one unit in as few bytes as its numbers take:
//! a fleet has tens of millions of them.

use jiff::Timestamp;
use records::Installation;
use trend::Observation;

/// Part number where known, and serial number.
pub type UnitKey = (Option<String>, String);

/// Tail and position of a unit; `None` where its rows have none.
#[derive(Debug, Clone, Default, PartialEq, Eq, PartialOrd, Ord)]
#[expect(missing_docs, reason = "each field is named for the contract's column")]
pub struct TailPosition {
    pub tail_number: Option<String>,
    pub position: Option<String>,
}

impl TailPosition {
    pub(crate) fn of(installation: &Installation) -> Self {
        Self {
            tail_number: Some(installation.tail_number.to_string()),
            position: Some(installation.position.to_string()),
        }
    }

    fn is(&self, tail_number: Option<&str>, position: Option<&str>) -> bool {
        self.tail_number.as_deref() == tail_number && self.position.as_deref() == position
    }
}

/// Index of a place among those of a unit; a new place is appended.
pub(crate) fn place_number(
    places: &mut Vec<TailPosition>,
    tail_number: Option<&str>,
    position: Option<&str>,
) -> u32 {
    // From the end: most rows have the place of the row before.
    let known = places.iter().rposition(|place| place.is(tail_number, position));
    let at = known.unwrap_or_else(|| {
        let owned = |name: Option<&str>| name.map(str::to_owned);
        places.push(TailPosition { tail_number: owned(tail_number), position: owned(position) });
        places.len() - 1
    });
    at as u32
}

pub(crate) const DAY_US: i64 = 86_400_000_000;

/// Whether a time is midnight UTC, as of a date without a time.
pub(crate) fn is_day(utc_us: i64) -> bool {
    utc_us % DAY_US == 0
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
    /// Which row of the table it was read from: that of its further columns.
    pub(crate) row: u32,
    /// Where its name begins and ends among its unit's names; at one place where it has none.
    name: [u32; 2],
}

impl FlightRow {
    /// A flight in a place of its unit; its name, which may be empty, is appended to those of the unit's other flights.
    pub(crate) fn new(
        departure_us: i64,
        gap_m: Option<f64>,
        (place, row): (u32, u32),
        name: &str,
        names: &mut String,
    ) -> Self {
        let begin = names.len() as u32;
        names.push_str(name);
        Self { departure_us, gap_m: gap_m.unwrap_or(f64::NAN), place, row, name: [begin, names.len() as u32] }
    }

    /// Adjusts the indices when the flight is appended to others: of its place, its row and its name.
    pub(crate) fn relocate(&mut self, places: &[u32], rows: u32, names: u32) {
        self.place = places[self.place as usize];
        self.row += rows;
        self.name = self.name.map(|at| at + names);
    }

    /// The flight's name, from the joined names of its unit's flights.
    pub(crate) fn name_in<'a>(&self, names: &'a str) -> Option<&'a str> {
        let name = &names[self.name[0] as usize..self.name[1] as usize];
        (!name.is_empty()).then_some(name)
    }

    pub(crate) fn departure_us(&self) -> i64 {
        self.departure_us
    }

    pub(crate) fn departure_utc(&self) -> Timestamp {
        // Parsed as an instant when it was stored, so it is valid here.
        Timestamp::from_microsecond(self.departure_us).unwrap_or_default()
    }

    /// The gap, m; none of a refused flight.
    pub(crate) fn gap_m(&self) -> Option<f64> {
        known(self.gap_m)
    }
}

/// Secondary columns of a flight, in 32 bytes: needed only until usage is accumulated.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FlightExtras {
    /// Numbers; `NaN` for none.
    pub(crate) flight_hours: f64,
    pub(crate) tail_hours_end: f64,
    /// As [`signed_error`] makes it.
    pub(crate) gap_se_m: f64,
    /// The largest number for none.
    pub(crate) load_reversals: u64,
}

impl FlightExtras {
    /// Whether the estimators disagree, or the record of an external table is flagged.
    pub(crate) fn is_disputed(&self) -> bool {
        self.gap_se_m.is_sign_negative()
    }

    /// The observation of a flight, with its installation and its number among the flights of its day. The standard error
    /// spans both estimators where they disagree.
    pub(crate) fn observation(&self, flown: &FlightRow, installation: u32, flight: u32) -> Observation {
        Observation {
            departure_us: flown.departure_us,
            installation,
            flight,
            flight_hours: known(self.flight_hours),
            tail_hours_end: known(self.tail_hours_end),
            load_reversals: (self.load_reversals != u64::MAX).then_some(self.load_reversals),
            gap_m: flown.gap_m(),
            gap_se_m: known(self.gap_se_m.abs()).filter(|se_m| *se_m > 0.0),
            is_doubtful: self.is_disputed(),
        }
    }
}

/// The standard error of a gap, m; where another estimate of the gap contradicts it, with the distance between the two, and
/// negative.
pub(crate) fn signed_error(gap_se_m: Option<f64>, contradicting_m: Option<(f64, f64)>) -> f64 {
    match contradicting_m {
        Some((gap_m, other_m)) => -gap_se_m.unwrap_or(0.0).hypot(gap_m - other_m),
        None => gap_se_m.map_or(f64::NAN, f64::abs),
    }
}

/// A number; none of NaN.
pub(crate) fn known(number: f64) -> Option<f64> {
    (!number.is_nan()).then_some(number)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A standard error of 3 µm and a distance of 4 µm between the estimators make 5 µm.
    #[test]
    fn the_error_of_a_disputed_gap_spans_both_estimators() {
        assert!((signed_error(Some(3e-6), Some((30e-6, 34e-6))) + 5e-6).abs() < 1e-15);
        assert!((signed_error(Some(3e-6), None) - 3e-6).abs() < 1e-15);
    }
}
