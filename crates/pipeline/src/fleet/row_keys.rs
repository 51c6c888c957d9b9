//! Row keys (part, serial, tail, position), resolved once for the many rows that share them.

use arrow::array::{Array, AsArray, DictionaryArray, StringArray};
use arrow::datatypes::Int32Type;
use ingest::tables::{StringColumn, TableBatch, trim_ascii_fast};

/// Numbers of a unit and of its place.
type Seat = (usize, u32);

/// Key columns of some rows.
pub(crate) struct KeyColumns {
    pub(crate) serials: TextColumn,
    pub(crate) parts: TextColumn,
    pub(crate) tails: TextColumn,
    pub(crate) positions: TextColumn,
    /// The last row of each serial number with its seat, by code; the first entry is that of serial numbers without codes.
    seats: Vec<Option<(usize, Seat)>>,
}

impl KeyColumns {
    /// The columns of names that repeat, under all their names.
    pub(crate) const COLUMNS: [&'static str; 6] =
        ["serial_number", "serial", "part_number", "tail_number", "tail", "position"];

    /// Those of some rows of a table.
    pub(crate) fn of(chunk: &TableBatch) -> Result<Self, ingest::Error> {
        let column = |names: &[&str]| TextColumn::of(chunk, names);
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

/// Texts of a column: each by itself, or as a code for one of a few.
pub(crate) enum TextColumn {
    Plain(StringColumn),
    Coded(DictionaryArray<Int32Type>, StringArray),
}

impl TextColumn {
    /// The texts of the column that has one of these names; all missing if there is no such column.
    pub(crate) fn of(chunk: &TableBatch, names: &[&str]) -> Result<Self, ingest::Error> {
        let column = chunk.find(names);
        let coded = column.and_then(|column| chunk.dictionary_column(column));
        let texts = coded.and_then(|coded| coded.values().as_string_opt::<i32>());
        match coded.zip(texts) {
            Some((coded, texts)) => Ok(Self::Coded(coded.clone(), texts.clone())),
            None => Ok(Self::Plain(chunk.texts(column)?)),
        }
    }

    /// The text of a row, trimmed; an empty one is none.
    pub(crate) fn get(&self, row: usize) -> Option<&str> {
        match self {
            Self::Plain(texts) => texts.get(row),
            Self::Coded(_, texts) => {
                let code = self.code(row)?;
                let text = texts.is_valid(code).then(|| trim_ascii_fast(texts.value(code)))?;
                (!text.is_empty()).then_some(text)
            }
        }
    }

    fn code(&self, row: usize) -> Option<usize> {
        match self {
            Self::Plain(_) => None,
            Self::Coded(coded, _) => coded.key(row),
        }
    }

    fn are_same(&self, a: usize, b: usize) -> bool {
        match self {
            Self::Plain(texts) => texts.get(a) == texts.get(b),
            Self::Coded(..) => self.code(a) == self.code(b),
        }
    }
}
