//! Row keys (part, serial, tail, position), resolved once for the many rows that share them.

use ingest::tables::{StringColumn, TableBatch};

/// Numbers of a unit and of its place.
type Seat = (usize, u32);

/// Key columns of some rows.
pub(crate) struct KeyColumns {
    pub(crate) serials: StringColumn,
    pub(crate) parts: StringColumn,
    pub(crate) tails: StringColumn,
    pub(crate) positions: StringColumn,
    /// The last row of each serial number with its seat, by code; the first entry is that of serial numbers without codes.
    seats: Vec<Option<(usize, Seat)>>,
}

impl KeyColumns {
    /// The columns of names that repeat, under all their names.
    pub(crate) const COLUMNS: [&'static str; 6] =
        ["serial_number", "serial", "part_number", "tail_number", "tail", "position"];

    /// Those of some rows of a table.
    pub(crate) fn of(chunk: &TableBatch) -> Result<Self, ingest::Error> {
        let column = |names: &[&str]| chunk.texts(chunk.find(names));
        Ok(Self {
            serials: column(&["serial_number", "serial"])?,
            parts: column(&["part_number"])?,
            tails: column(&["tail_number", "tail"])?,
            positions: column(&["position"])?,
            seats: Vec::new(),
        })
    }

    /// The seat of a row: that of an earlier row with the same keys, or what `find` finds.
    pub(crate) fn seat(
        &mut self,
        row: usize,
        find: impl FnOnce(&Self) -> Result<Seat, ingest::Error>,
    ) -> Result<Seat, ingest::Error> {
        let entry = self.serials.code(row).map_or(0, |code| code + 1);
        let known = self.seats.get(entry).copied().flatten();
        if let Some((_, seat)) = known.filter(|(before, _)| self.are_same(*before, row)) {
            return Ok(seat);
        }
        let seat = find(self)?;
        self.seats.resize(self.seats.len().max(entry + 1), None);
        self.seats[entry] = Some((row, seat));
        Ok(seat)
    }

    /// Whether two rows are of one unit in one place.
    fn are_same(&self, a: usize, b: usize) -> bool {
        [&self.serials, &self.positions, &self.tails, &self.parts].iter().all(|names| names.are_same(a, b))
    }
}
