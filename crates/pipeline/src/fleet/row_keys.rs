//! Row keys (part, serial, tail, position), resolved once for the many rows that share them.

use arrow::array::{Array, AsArray, DictionaryArray, StringArray};
use arrow::datatypes::Int32Type;
use ingest::tables::{StringColumn, TableBatch, trim_ascii_fast};

/// Key columns of some rows.
pub(crate) struct KeyColumns {
    pub(crate) serials: TextColumn,
    pub(crate) parts: TextColumn,
    pub(crate) tails: TextColumn,
    pub(crate) positions: TextColumn,
}

impl KeyColumns {
    /// The columns of names that repeat, under all their names.
    pub(crate) const COLUMNS: [&'static str; 6] =
        ["serial_number", "serial", "part_number", "tail_number", "tail", "position"];

    /// Those of some rows of a table.
    pub(crate) fn of(chunk: &TableBatch) -> Result<Self, ingest::Error> {
        let names: [&[&str]; 4] =
            [&["serial_number", "serial"], &["part_number"], &["tail_number", "tail"], &["position"]];
        let [serials, parts, tails, positions] = names.map(|names| TextColumn::of(chunk, names));
        Ok(Self { serials: serials?, parts: parts?, tails: tails?, positions: positions? })
    }

    /// Whether two rows are of one unit in one place.
    fn are_same(&self, a: usize, b: usize) -> bool {
        [&self.serials, &self.positions, &self.tails, &self.parts].iter().all(|names| names.are_same(a, b))
    }
}

/// Numbers of a unit and of its place.
type Seat = (usize, u32);

/// Seats of earlier rows: of the last one, and of the last one of each serial number where these have codes.
#[derive(Default)]
pub(crate) struct KeyCache {
    last: Option<(usize, Seat)>,
    by_code: Vec<Option<(usize, Seat)>>,
}

impl KeyCache {
    /// The seat of a row, if it is that of an earlier row.
    pub(crate) fn get(&self, keys: &KeyColumns, row: usize) -> Option<Seat> {
        let of_code = match keys.serials.code(row) {
            Some(code) => self.by_code.get(code).copied().flatten(),
            None => self.last,
        };
        of_code.filter(|(before, _)| keys.are_same(*before, row)).map(|(_, found)| found)
    }

    /// Remembers the seat of a row.
    pub(crate) fn put(&mut self, keys: &KeyColumns, row: usize, found: Seat) {
        self.last = Some((row, found));
        let Some(code) = keys.serials.code(row) else { return };
        if self.by_code.len() <= code {
            self.by_code.resize(code + 1, None);
        }
        self.by_code[code] = self.last;
    }
}

/// Texts of a column: each by itself, or as a code for one of a few.
pub(crate) enum TextColumn {
    Plain(StringColumn),
    Coded(DictionaryArray<Int32Type>, StringArray),
}

impl TextColumn {
    /// Those of a column under one of its names; all none where there is no such column.
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
