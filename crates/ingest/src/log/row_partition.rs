//! Samples of long layouts: one pass over the files gathers the rows of every channel and actuator that will be read.
//!
//! A row of such a file belongs to one channel, or to one actuator, and a column of texts names it. Other
//! rows are dropped as they are decoded, and row groups whose statistics exclude every requested text are not decoded.

use std::collections::{BTreeSet, HashMap};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use arrow::array::{Array, ArrayRef, AsArray, UInt32Array};
use arrow::compute::take;
use arrow::datatypes::Int32Type;

use crate::bounds;
use crate::error::{Error, ErrorKind};
use crate::parquet::log_file::{LogFile, Scan};
use crate::parquet::numeric::as_text;

/// Rows decoded at a time: a batch is split among many channels, so it is larger than that of a wide log.
pub(crate) const LONG_BATCH_ROWS: usize = 1 << 16;

/// Memory limit of gathered samples, bytes; what does not fit is gathered by a later pass.
const MAX_GATHERED_BYTES: usize = 256 << 20;

/// No combination: the row belongs to a channel that is not requested.
const NONE: u32 = u32::MAX;

/// The most combinations of texts of the columns that name rows: more are the numbers or times of a wrong column.
const MAX_COMBINATIONS: u64 = 1 << 22;

/// Which samples are meant: the leaf that holds them, and the rows in which it does.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct SampleSelector {
    /// The leaf.
    pub(crate) leaf: String,
    /// Columns and the text they must hold.
    pub(crate) rows: Vec<(String, String)>,
}

impl SampleSelector {
    /// Every row of a leaf.
    pub(crate) fn every_row(leaf: &str) -> Self {
        Self { leaf: leaf.to_owned(), rows: Vec::new() }
    }
}

/// Columns and the texts that mark the rows of a channel or an actuator.
type Rows = Vec<(String, String)>;

/// Gathered samples are kept by their rows, their leaf, and the leaf whose lists they are aligned to.
type GatheredKey = (Rows, String, Option<String>);

/// The rows of a table by channel or actuator.
#[derive(Debug, Default)]
pub(crate) struct Partition {
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    /// Rows that will be asked for, in this order, and by which positions.
    announced: Vec<(Rows, BTreeSet<String>)>,
    /// Leaves that will be asked for.
    leaves: BTreeSet<String>,
    gathered: HashMap<GatheredKey, Arc<Vec<ArrayRef>>>,
}

impl Partition {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Remembers rows and leaves that a position will ask for.
    pub(crate) fn announce(
        &self,
        samples: &SampleSelector,
        leaves: impl Iterator<Item = String>,
        position: &str,
    ) {
        let (mut state, rows) = (self.state(), &samples.rows);
        state.leaves.extend(leaves);
        match state.announced.iter_mut().find(|(known, _)| known == rows) {
            Some((_, positions)) => drop(positions.insert(position.to_owned())),
            None => state.announced.push((rows.clone(), BTreeSet::from([position.to_owned()]))),
        }
    }

    /// Frees the samples that only this position asks for.
    pub(crate) fn release(&self, position: &str) {
        let mut state = self.state();
        for (_, positions) in &mut state.announced {
            positions.remove(position);
        }
        state.announced.retain(|(_, positions)| !positions.is_empty());
        let State { announced, gathered, .. } = &mut *state;
        gathered.retain(|(rows, ..), _| announced.iter().any(|(known, _)| known == rows));
    }

    /// One leaf of the samples meant, in batches.
    pub(crate) fn samples(
        &self,
        files: &[LogFile],
        samples: &SampleSelector,
        leaf: &str,
    ) -> Result<Arc<Vec<ArrayRef>>, Error> {
        let is_listed = |name: &str| files.iter().any(|file| file.is_listed(name));
        // A list in the channel's own leaf gives a row its samples.
        let aligned = (leaf != samples.leaf && is_listed(&samples.leaf)).then(|| samples.leaf.clone());
        let mut state = self.state();
        let asked = (samples.rows.clone(), leaf.to_owned(), aligned);
        if let Some(found) = state.gathered.get(&asked) {
            return Ok(Arc::clone(found));
        }
        let mut leaves = vec![leaf.to_owned()];
        // Lists of different channels may differ in length: their leaves are gathered one by one.
        let has_lists = state.leaves.iter().chain([&samples.leaf]).any(|name| is_listed(name));
        // Rows of a flight in which each is a sample of every channel: one leaf at a time, as in a file of their own.
        let is_wide = asked.0.is_empty();
        if asked.2.is_none() && !has_lists && !is_wide {
            let here = |name: &&String| *name != leaf && files.iter().all(|file| file.has(name));
            leaves.extend(state.leaves.iter().filter(here).cloned());
        }
        let mut keys = vec![asked.0.clone()];
        let is_new = |rows: &Rows| {
            *rows != asked.0
                && rows.iter().map(|row| &row.0).eq(asked.0.iter().map(|row| &row.0))
                && !state.gathered.contains_key(&(rows.clone(), leaf.to_owned(), asked.2.clone()))
        };
        keys.extend(state.announced.iter().map(|(rows, _)| rows).filter(|rows| is_new(rows)).cloned());
        let mut gathered = gather(files, &keys, &leaves, asked.2.as_deref())?;
        if is_wide {
            return Ok(Arc::new(gathered.remove(0).remove(0)));
        }
        for (slot, parts) in gathered.into_iter().enumerate() {
            for (name, arrays) in leaves.iter().zip(parts) {
                state.gathered.insert((keys[slot].clone(), name.clone(), asked.2.clone()), Arc::new(arrays));
            }
        }
        Ok(state.gathered.get(&asked).cloned().unwrap_or_default())
    }
}

/// Samples of each key, leaf by leaf; fewer keys than requested where the samples of all would occupy too much memory.
type Gathered = Vec<Vec<Vec<ArrayRef>>>;

fn gather(
    files: &[LogFile],
    keys: &[Rows],
    leaves: &[String],
    aligned: Option<&str>,
) -> Result<Gathered, Error> {
    let leaves: Vec<&str> = leaves.iter().map(String::as_str).collect();
    let mut gathered: Gathered = vec![vec![Vec::new(); leaves.len()]; keys.len()];
    let (mut bytes, mut by_key) = (vec![0_usize; keys.len()], vec![Vec::new(); keys.len()]);
    for file in files {
        // The rows of the flight that the file is opened for.
        let of_flight = |rows: &Rows| [rows.as_slice(), &file.flight_rows].concat();
        let keys: Vec<Rows> = keys[..gathered.len()].iter().map(of_flight).collect();
        let columns: Vec<&str> = keys[0].iter().map(|(column, _)| column.as_str()).collect();
        let names: Vec<&str> = leaves.iter().chain(&columns).copied().chain(aligned).collect();
        let mut combinations = Combinations::of(&keys);
        let may_hold = |group: usize| {
            keys.iter().any(|rows| {
                rows.iter().all(|(column, text)| {
                    file.text_bounds(column, group).is_none_or(|bounds| bounds.may_hold(text))
                })
            })
        };
        let scan = Scan { batch_rows: LONG_BATCH_ROWS, as_codes: true, wants_group: &may_hold };
        file.scan(&names, scan, |arrays| {
            let (values, rest) = arrays.split_at(leaves.len());
            let of_rows = combinations.of_rows(&columns, &rest[..columns.len()], false)?;
            sort_by_key(of_rows, &mut by_key[..gathered.len()]);
            for (key, rows) in
                by_key[..gathered.len()].iter().enumerate().filter(|(_, rows)| !rows.is_empty())
            {
                let rows = UInt32Array::from(rows.clone());
                for (part, array) in gathered[key].iter_mut().zip(values) {
                    let samples = take(array, &rows, None).map_err(|_| ErrorKind::ColumnType {
                        column: leaves[0].to_owned(),
                        found: array.data_type().to_string(),
                        wanted: "numbers",
                    })?;
                    bytes[key] += samples.get_array_memory_size();
                    part.push(samples);
                }
            }
            while gathered.len() > 1 && bytes[..gathered.len()].iter().sum::<usize>() > MAX_GATHERED_BYTES {
                gathered.pop();
            }
            Ok(())
        })?;
    }
    Ok(gathered)
}

/// Sorts the rows of a batch by their keys.
fn sort_by_key(of_rows: &[u32], by_key: &mut [Vec<u32>]) {
    by_key.iter_mut().for_each(Vec::clear);
    for (row, key) in (0..).zip(of_rows) {
        by_key.get_mut(*key as usize).into_iter().for_each(|rows| rows.push(row));
    }
}

/// The combinations of texts that the rows of some columns hold; a row without one of the texts holds none.
#[derive(Debug, Default)]
pub(crate) struct DistinctTexts {
    combinations: Combinations,
    /// Combinations of row groups that hold but one.
    stated: BTreeSet<Vec<String>>,
}

impl DistinctTexts {
    /// Looks at a file; a row group that holds but one combination, by its statistics, is not read.
    pub(crate) fn take_file(&mut self, file: &LogFile, names: &[&str]) -> Result<(), Error> {
        let only = |group: usize| -> Option<Vec<String>> {
            names.iter().map(|name| Some(file.text_bounds(name, group)?.only()?.to_owned())).collect()
        };
        self.stated.extend(file.groups().filter_map(only));
        let wants_group = &|group| only(group).is_none();
        let scan = Scan { batch_rows: LONG_BATCH_ROWS, as_codes: true, wants_group };
        file.scan(names, scan, |arrays| self.take(names, arrays))
    }

    /// Looks at a batch.
    pub(crate) fn take(&mut self, names: &[&str], arrays: &[ArrayRef]) -> Result<(), ErrorKind> {
        self.combinations.of_rows(names, arrays, true).map(drop)
    }

    /// All that were found.
    pub(crate) fn found(mut self) -> BTreeSet<Vec<String>> {
        self.stated.extend(self.combinations.texts());
        self.stated
    }
}

/// Combinations of the texts of some columns, numbered in the order in which they are entered.
#[derive(Debug, Default)]
struct Combinations {
    columns: Vec<TextColumn>,
    /// Of the rows of the latest batch.
    rows: Vec<u32>,
}

impl Combinations {
    /// The requested rows: combination k is that of key k.
    fn of(keys: &[Rows]) -> Self {
        let mut all = Self::default();
        for rows in keys {
            all.columns.resize_with(rows.len(), TextColumn::default);
            let each = all.columns.iter_mut().zip(rows);
            each.fold(0, |before, (column, (_, text))| {
                let number = column.number(text);
                column.enter(before, number)
            });
        }
        all
    }

    /// The combination of each row. One that is not known becomes known where they are `open`, and is [`NONE`] elsewhere.
    fn of_rows(&mut self, names: &[&str], arrays: &[ArrayRef], open: bool) -> Result<&[u32], ErrorKind> {
        self.columns.resize_with(names.len(), TextColumn::default);
        self.rows.clear();
        for (column, (name, array)) in self.columns.iter_mut().zip(names.iter().zip(arrays)) {
            column.append_to(&mut self.rows, name, array, open)?;
        }
        Ok(&self.rows)
    }

    /// The texts of every combination; none before a batch was seen.
    fn texts(&self) -> Vec<Vec<String>> {
        let none = vec![Vec::new(); self.columns.len().min(1)];
        self.columns.iter().fold(none, |before, column| {
            let texts = |(at, text): &(u32, u32)| {
                let mut texts = before[*at as usize].clone();
                texts.push(column.texts[*text as usize].clone());
                texts
            };
            column.parts.iter().map(texts).collect()
        })
    }
}

/// The texts of a column, and their combinations with those of the columns before it.
#[derive(Debug, Default)]
struct TextColumn {
    texts: Vec<String>,
    numbers: HashMap<String, u32>,
    /// A dictionary and the number of each of its codes, as batch after batch shares one.
    coded: Option<(ArrayRef, Vec<u32>)>,
    /// The combination of a combination of the columns before and the number of a text.
    combinations: Vec<Vec<u32>>,
    /// Both parts of each combination.
    parts: Vec<(u32, u32)>,
}

impl TextColumn {
    fn number(&mut self, text: &str) -> u32 {
        if let Some(number) = self.numbers.get(text) {
            return *number;
        }
        let number = self.texts.len() as u32;
        self.texts.push(text.to_owned());
        self.numbers.insert(text.to_owned(), number);
        number
    }

    /// The combination of two parts, which becomes known.
    fn enter(&mut self, before: u32, number: u32) -> u32 {
        let (row, column) = (before as usize, number as usize);
        self.combinations.resize_with(self.combinations.len().max(row + 1), Vec::new);
        let of_before = &mut self.combinations[row];
        of_before.resize(of_before.len().max(column + 1), NONE);
        if of_before[column] == NONE {
            of_before[column] = self.parts.len() as u32;
            self.parts.push((before, number));
        }
        of_before[column]
    }

    /// Combines the texts of this column with what the columns before gave for each row.
    fn append_to(
        &mut self,
        rows: &mut Vec<u32>,
        name: &str,
        array: &ArrayRef,
        open: bool,
    ) -> Result<(), ErrorKind> {
        let codes = array.as_dictionary_opt::<Int32Type>();
        let dictionary =
            codes.map_or_else(|| as_text(name, array), |codes| Ok(Arc::clone(codes.values())))?;
        let known = self.coded.take().filter(|(known, _)| Arc::ptr_eq(known, &dictionary));
        let (dictionary, numbers) = known.unwrap_or_else(|| {
            let number = |text: Option<&str>| match text {
                Some(text) if open => self.number(text),
                text => text.and_then(|text| self.numbers.get(text)).map_or(NONE, |number| *number),
            };
            let numbers = dictionary.as_string::<i32>().iter().map(number).collect();
            (dictionary, numbers)
        });
        let most = (self.texts.len() as u64).saturating_mul(self.combinations.len() as u64);
        bounds::check("texts of columns that name rows", most, MAX_COMBINATIONS)?;
        let number = |code: Option<i32>| code.map_or(NONE, |code| numbers[code as usize]);
        if rows.is_empty() && !open {
            // Those of the first column are its texts.
            match codes {
                None => rows.extend_from_slice(&numbers),
                Some(codes) => rows.extend(codes.keys().iter().map(number)),
            }
            self.coded = codes.map(|_| (dictionary, numbers));
            return Ok(());
        }
        if rows.is_empty() {
            rows.resize(array.len(), 0);
        }
        let mut append = |row: &mut u32, number: u32| {
            let known = self.combinations.get(*row as usize).and_then(|of_row| of_row.get(number as usize));
            let known = known.copied().unwrap_or(NONE);
            let is_new = known == NONE && open && *row != NONE && number != NONE;
            *row = if is_new { self.enter(*row, number) } else { known };
        };
        match codes {
            None => rows.iter_mut().zip(&numbers).for_each(|(row, number)| append(row, *number)),
            Some(codes) => {
                rows.iter_mut().zip(codes.keys()).for_each(|(row, code)| append(row, number(code)));
                self.coded = Some((dictionary, numbers));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use arrow::array::{DictionaryArray, Float64Array, RecordBatch, StringArray};
    use arrow::datatypes::Float64Type;
    use parquet::arrow::ArrowWriter;
    use parquet::file::properties::WriterProperties;

    use super::*;

    /// Rows of parameters p0 to p9 in turn, or one parameter after the other, whose values are their row numbers.
    fn file(folder: &std::path::Path, is_sorted: bool) -> LogFile {
        let name = |row: u32| format!("p{}", if is_sorted { row / 100 } else { row % 10 });
        let names: StringArray = (0..1000).map(|row| Some(name(row))).collect();
        let values: Float64Array = (0..1000).map(f64::from).collect();
        let columns: [(&str, ArrayRef); 2] = [("name", Arc::new(names)), ("value", Arc::new(values))];
        let batch = RecordBatch::try_from_iter(columns).unwrap();
        let path = folder.join("log.parquet");
        let groups = WriterProperties::builder().set_max_row_group_row_count(Some(100)).build();
        let sink = std::fs::File::create(&path).unwrap();
        let mut writer = ArrowWriter::try_new(sink, batch.schema(), Some(groups)).unwrap();
        writer.write(&batch).unwrap();
        writer.close().unwrap();
        LogFile::open(&path).unwrap()
    }

    fn samples(name: &str) -> SampleSelector {
        SampleSelector { leaf: "value".into(), rows: vec![("name".into(), name.into())] }
    }

    fn values(arrays: &[ArrayRef]) -> Vec<f64> {
        arrays.iter().flat_map(|a| a.as_primitive::<Float64Type>().values().to_vec()).collect()
    }

    /// After the first parameter is read the file is gone, and the others that were announced are still there.
    #[test]
    fn one_pass_gathers_all_that_was_announced() {
        for is_sorted in [false, true] {
            let folder = tempfile::tempdir().unwrap();
            let files = [file(folder.path(), is_sorted)];
            let partition = Partition::default();
            for name in ["p3", "p7", "p9"] {
                partition.announce(&samples(name), std::iter::empty(), name);
            }
            let wanted = |k: u32| -> Vec<f64> {
                let rows = (0..100).map(|i| if is_sorted { k * 100 + i } else { i * 10 + k });
                rows.map(f64::from).collect()
            };
            assert_eq!(values(&partition.samples(&files, &samples("p7"), "value").unwrap()), wanted(7));
            for (name, k) in [("p3", 3), ("p9", 9)] {
                assert_eq!(values(&partition.samples(&[], &samples(name), "value").unwrap()), wanted(k));
            }
            partition.release("p3");
            assert_eq!(partition.state().gathered.len(), 2);
        }
    }

    #[test]
    fn row_groups_without_an_asked_parameter_are_not_read() {
        let folder = tempfile::tempdir().unwrap();
        let file = file(folder.path(), true);
        let holding = |name: &str| {
            file.groups().filter(|g| file.text_bounds("name", *g).unwrap().may_hold(name)).collect::<Vec<_>>()
        };
        assert_eq!((holding("p4"), holding("p10"), holding("q")), (vec![4], vec![], vec![]));
        assert_eq!(file.text_bounds("name", 4).unwrap().only(), Some("p4"));
    }

    /// Two columns mark the rows of a slot; the texts of one are codes of a dictionary, of the other plain.
    #[test]
    fn rows_are_sorted_by_both_of_their_columns() {
        let key =
            |name: &str, place: &str| vec![("name".into(), name.into()), ("place".into(), place.into())];
        let mut keys = Combinations::of(&[key("motor", "left"), key("load", "right"), key("motor", "right")]);
        let names: DictionaryArray<Int32Type> =
            ["motor", "load", "flap", "motor", "motor", "load"].into_iter().collect();
        let places = StringArray::from(vec![
            Some("right"),
            Some("right"),
            Some("left"),
            Some("left"),
            None,
            Some("left"),
        ]);
        let rows = keys.of_rows(&["name", "place"], &[Arc::new(names), Arc::new(places)], false).unwrap();
        assert_eq!(rows, [2, 1, NONE, 0, NONE, NONE]);
        let mut by_key = [Vec::new(), Vec::new()];
        sort_by_key(rows, &mut by_key);
        assert_eq!(by_key, [[3], [1]]);
    }
}
