//! Keys of units, and the positions in which they were installed.

use records::Installation;

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
