//! Secondary columns of the rows of many units, in one arena that is freed as a whole while
//! the next one is still needed.

use std::sync::Arc;

use crate::fleet::flight_row::FlightExtras;

/// Rows of a full shelf: its 32 MiB are more than what any allocator keeps to itself.
const SHELF_ROWS: usize = 1 << 20;

/// Secondary columns of a row, as bits: the system provides a zeroed arena without writing it.
type PackedExtras = [u64; 4];

/// Shelves while rows are put on them.
pub(crate) struct ExtrasArena {
    arena: Vec<Vec<PackedExtras>>,
    /// Shelf and first row of each unit.
    units: Vec<(usize, usize)>,
}

/// The rows of one unit, in the order of arrival.
#[derive(Debug, Clone, Default)]
pub(crate) struct UnitExtras {
    arena: Arc<Vec<PackedExtras>>,
    first: usize,
}

impl ExtrasArena {
    /// An arena with the given number of rows of each unit.
    pub(crate) fn with_capacity(rows: impl Iterator<Item = usize>) -> Self {
        let (mut lengths, mut units): (Vec<usize>, _) = (Vec::new(), Vec::new());
        for rows in rows {
            let arena = match lengths.last() {
                Some(length) if *length < SHELF_ROWS => lengths.len() - 1,
                _ => {
                    lengths.push(0);
                    lengths.len() - 1
                }
            };
            units.push((arena, lengths[arena]));
            lengths[arena] += rows;
        }
        Self { arena: lengths.into_iter().map(|rows| vec![[0; 4]; rows]).collect(), units }
    }

    /// Stores a row of a unit by its number.
    pub(crate) fn put(&mut self, unit: usize, row: u32, extras: FlightExtras) {
        let (index, first) = self.units[unit];
        self.arena[index][first + row as usize] = extras.to_bits();
    }

    /// The rows of each unit.
    pub(crate) fn of_units(self) -> impl Iterator<Item = UnitExtras> {
        let arena: Vec<Arc<Vec<PackedExtras>>> = self.arena.into_iter().map(Arc::new).collect();
        self.units
            .into_iter()
            .map(move |(index, first)| UnitExtras { arena: Arc::clone(&arena[index]), first })
    }
}

impl UnitExtras {
    /// The row of that number.
    pub(crate) fn row(&self, row: u32) -> FlightExtras {
        FlightExtras::from_bits(self.arena[self.first + row as usize])
    }
}

#[cfg(test)]
mod tests {
    use jiff::Timestamp;

    use super::*;
    use crate::fleet::flight_row::FlightInput;

    fn extras(hours: f64) -> FlightExtras {
        FlightExtras::of(&FlightInput {
            flight_id: None,
            departure_utc: Timestamp::UNIX_EPOCH,
            flight_hours: Some(hours),
            tail_hours_end: None,
            load_reversals: None,
            gap_m: None,
            gap_se_m: None,
            disagreeing_gap_m: None,
        })
    }

    /// Three units, of which the first alone fills a shelf.
    #[test]
    fn every_unit_finds_its_own_rows_in_whatever_order_they_were_put_down() {
        let rows = [SHELF_ROWS + 1, 3, 2];
        let mut arena = ExtrasArena::with_capacity(rows.into_iter());
        for unit in [1, 0, 2] {
            for row in (0..rows[unit]).rev() {
                arena.put(unit, row as u32, extras((10_000_000 * unit + row) as f64));
            }
        }
        for (unit, shelved) in arena.of_units().enumerate() {
            for row in 0..rows[unit] {
                let hours = shelved.row(row as u32).flight_hours();
                assert_eq!(hours, Some((10_000_000 * unit + row) as f64));
            }
        }
    }
}
