//! What rows say beside their gaps, of many units on one shelf: given up whole, so that the system has it back while
//! the next shelf is still needed.

use std::sync::Arc;

use crate::flown::Beside;

/// Rows of a full shelf: its 32 MiB are more than what any allocator keeps to itself.
const SHELF_ROWS: usize = 1 << 20;

/// What a row says, as bits: a shelf of nothing but zeros is had from the system for nothing.
type Bits = [u64; 4];

/// Shelves while rows are put on them.
pub(crate) struct Shelves {
    shelves: Vec<Vec<Bits>>,
    /// Shelf and first row of each unit.
    units: Vec<(usize, usize)>,
}

/// The rows of one unit, in the order of arrival.
#[derive(Debug, Clone, Default)]
pub(crate) struct Shelved {
    shelf: Arc<Vec<Bits>>,
    first: usize,
}

impl Shelves {
    /// Room for so many rows of each unit.
    pub(crate) fn with_room(rows: impl Iterator<Item = usize>) -> Self {
        let (mut lengths, mut units): (Vec<usize>, _) = (Vec::new(), Vec::new());
        for rows in rows {
            let shelf = match lengths.last() {
                Some(length) if *length < SHELF_ROWS => lengths.len() - 1,
                _ => {
                    lengths.push(0);
                    lengths.len() - 1
                }
            };
            units.push((shelf, lengths[shelf]));
            lengths[shelf] += rows;
        }
        Self { shelves: lengths.into_iter().map(|rows| vec![[0; 4]; rows]).collect(), units }
    }

    /// Puts down a unit's row of that number.
    pub(crate) fn put(&mut self, unit: usize, row: u32, beside: Beside) {
        let (shelf, first) = self.units[unit];
        self.shelves[shelf][first + row as usize] = beside.to_bits();
    }

    /// The rows of each unit.
    pub(crate) fn of_units(self) -> impl Iterator<Item = Shelved> {
        let shelves: Vec<Arc<Vec<Bits>>> = self.shelves.into_iter().map(Arc::new).collect();
        self.units
            .into_iter()
            .map(move |(shelf, first)| Shelved { shelf: Arc::clone(&shelves[shelf]), first })
    }
}

impl Shelved {
    /// The row of that number.
    pub(crate) fn row(&self, row: u32) -> Beside {
        Beside::from_bits(self.shelf[self.first + row as usize])
    }
}

#[cfg(test)]
mod tests {
    use jiff::Timestamp;

    use super::*;
    use crate::flown::Row;

    fn beside(hours: f64) -> Beside {
        Beside::of(&Row {
            flight_id: None,
            departure_utc: Timestamp::UNIX_EPOCH,
            flight_hours: Some(hours),
            tail_hours_end: None,
            load_reversals: None,
            gap_m: None,
            gap_se_m: None,
        })
    }

    /// Three units, of which the first alone fills a shelf.
    #[test]
    fn every_unit_finds_its_own_rows_in_whatever_order_they_were_put_down() {
        let rows = [SHELF_ROWS + 1, 3, 2];
        let mut shelves = Shelves::with_room(rows.into_iter());
        for unit in [1, 0, 2] {
            for row in (0..rows[unit]).rev() {
                shelves.put(unit, row as u32, beside((10_000_000 * unit + row) as f64));
            }
        }
        for (unit, shelved) in shelves.of_units().enumerate() {
            for row in 0..rows[unit] {
                let hours = shelved.row(row as u32).flight_hours();
                assert_eq!(hours, Some((10_000_000 * unit + row) as f64));
            }
        }
    }
}
