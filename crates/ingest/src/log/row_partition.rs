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

/// No slot: the row belongs to a channel that is not requested.
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

/// The texts that mark the rows of a channel or an actuator, by column.
#[derive(Debug, Clone, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) struct RowKeys {
    columns: Vec<String>,
    texts: Vec<String>,
}

impl RowKeys {
    pub(crate) fn of(samples: &SampleSelector) -> Self {
        let (columns, texts) = samples.rows.iter().cloned().unzip();
        Self { columns, texts }
    }

    /// These rows, as far as they are of the flight that a file is opened for.
    fn of_flight(&self, file: &LogFile) -> Self {
        let mut rows = self.clone();
        for (column, text) in &file.flight_rows {
            rows.columns.push(column.clone());
            rows.texts.push(text.clone());
        }
        rows
    }
}

/// Gathered samples are kept by their rows, their leaf, and the leaf whose lists they are aligned to.
type GatheredKey = (RowKeys, String, Option<String>);

/// The rows of a table by channel or actuator.
#[derive(Debug, Default)]
pub(crate) struct Partition {
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    /// Rows that will be asked for, in this order, and by which positions.
    announced: Vec<(RowKeys, BTreeSet<String>)>,
    /// Leaves that will be asked for.
    leaves: BTreeSet<String>,
    gathered: HashMap<GatheredKey, Arc<Vec<ArrayRef>>>,
}

impl Partition {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Remembers rows and leaves that a position will ask for.
    pub(crate) fn announce(&self, rows: &RowKeys, leaves: impl Iterator<Item = String>, position: &str) {
        let mut state = self.state();
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
    ///
    /// # Errors
    /// When a column is missing or cannot be decoded.
    pub(crate) fn samples(
        &self,
        files: &[LogFile],
        samples: &SampleSelector,
        leaf: &str,
    ) -> Result<Arc<Vec<ArrayRef>>, Error> {
        let rows = RowKeys::of(samples);
        let is_listed = |name: &str| files.iter().any(|f| f.leaf(name).is_ok_and(|leaf| leaf.is_listed));
        // A list in the channel's own leaf gives a row its samples.
        let aligned = (leaf != samples.leaf && is_listed(&samples.leaf)).then(|| samples.leaf.clone());
        let mut state = self.state();
        let asked = (rows, leaf.to_owned(), aligned);
        if let Some(found) = state.gathered.get(&asked) {
            return Ok(Arc::clone(found));
        }
        let mut leaves = vec![leaf.to_owned()];
        // Lists of different channels may differ in length: their leaves are gathered one by one.
        let has_lists = state.leaves.iter().chain([&samples.leaf]).any(|name| is_listed(name));
        // Rows of a flight in which each is a sample of every channel: one leaf at a time, as in a file of their own.
        let is_wide = asked.0.columns.is_empty();
        if asked.2.is_none() && !has_lists && !is_wide {
            let here = |name: &&String| *name != leaf && files.iter().all(|file| file.has(name));
            leaves.extend(state.leaves.iter().filter(here).cloned());
        }
        let mut keys = vec![asked.0.clone()];
        let is_new = |rows: &RowKeys| {
            *rows != asked.0
                && rows.columns == asked.0.columns
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
    keys: &[RowKeys],
    leaves: &[String],
    aligned: Option<&str>,
) -> Result<Gathered, Error> {
    let leaves: Vec<&str> = leaves.iter().map(String::as_str).collect();
    let mut gathered: Gathered = vec![vec![Vec::new(); leaves.len()]; keys.len()];
    let mut bytes = vec![0_usize; keys.len()];
    for file in files {
        let keys: Vec<RowKeys> = keys[..gathered.len()].iter().map(|rows| rows.of_flight(file)).collect();
        let columns: Vec<&str> = keys[0].columns.iter().map(String::as_str).collect();
        let names: Vec<&str> = leaves.iter().chain(&columns).copied().chain(aligned).collect();
        let mut slots = Slots::of(&keys);
        let may_hold = |group: usize| {
            keys.iter().any(|rows| {
                let mut pairs = rows.columns.iter().zip(&rows.texts);
                pairs.all(|(column, text)| {
                    file.text_bounds(column, group).is_none_or(|bounds| bounds.may_hold(text))
                })
            })
        };
        let scan = Scan { batch_rows: LONG_BATCH_ROWS, as_codes: true, wants_group: &may_hold };
        file.scan(&names, scan, |arrays| {
            let (values, rest) = arrays.split_at(leaves.len());
            slots.assign(&columns, &rest[..columns.len()])?;
            for slot in 0..gathered.len() {
                let rows = slots.rows_of(slot);
                if rows.is_empty() {
                    continue;
                }
                for (part, array) in gathered[slot].iter_mut().zip(values) {
                    let samples = take(array, &rows, None).map_err(|_| ErrorKind::ColumnType {
                        column: leaves[0].to_owned(),
                        found: array.data_type().to_string(),
                        wanted: "numbers",
                    })?;
                    bytes[slot] += samples.get_array_memory_size();
                    part.push(samples);
                }
            }
            while gathered.len() > 1 && bytes[..gathered.len()].iter().sum::<usize>() > MAX_GATHERED_BYTES {
                gathered.pop();
                slots.rows.pop();
            }
            Ok(())
        })?;
    }
    Ok(gathered)
}

/// The rows of a batch by slot: slot k holds the rows of key k.
struct Slots {
    /// The requested texts of each column.
    columns: Vec<TextNumbers>,
    /// The slot of every combination of their numbers.
    slots: Vec<u32>,
    /// The rows of each slot.
    rows: Vec<Vec<u32>>,
}

impl Slots {
    fn of(keys: &[RowKeys]) -> Self {
        let mut columns: Vec<TextNumbers> = keys[0].columns.iter().map(|_| TextNumbers::default()).collect();
        for rows in keys {
            for (column, text) in columns.iter_mut().zip(&rows.texts) {
                column.enter(text);
            }
        }
        let mut slots = vec![NONE; columns.iter().map(|column| column.texts.len()).product()];
        for (slot, rows) in (0..).zip(keys) {
            let numbers =
                columns.iter().zip(&rows.texts).map(|(column, text)| (column, column.numbers[text]));
            slots[numbers.fold(0, combined) as usize] = slot;
        }
        Self { columns, slots, rows: vec![Vec::new(); keys.len()] }
    }

    /// Sorts the rows of a batch by slot.
    fn assign(&mut self, names: &[&str], arrays: &[ArrayRef]) -> Result<(), ErrorKind> {
        let combinations = combine(&mut self.columns, names, arrays, false)?;
        self.rows.iter_mut().for_each(Vec::clear);
        for (row, at) in (0..).zip(combinations) {
            let slot = self.slots.get(at as usize).copied().unwrap_or(NONE);
            self.rows.get_mut(slot as usize).into_iter().for_each(|rows| rows.push(row));
        }
        Ok(())
    }

    /// The rows of a slot in the batch.
    fn rows_of(&self, slot: usize) -> UInt32Array {
        UInt32Array::from(self.rows[slot].clone())
    }
}

/// The combinations of texts that the rows of some columns hold; a row without one of the texts holds none.
#[derive(Debug, Default)]
pub(crate) struct DistinctTexts {
    columns: Vec<TextNumbers>,
    pub(crate) found: BTreeSet<Vec<String>>,
}

impl DistinctTexts {
    /// Looks at a file; a row group that holds but one combination, by its statistics, is not read.
    ///
    /// # Errors
    /// When a column is missing or cannot be decoded.
    pub(crate) fn take_file(&mut self, file: &LogFile, names: &[&str]) -> Result<(), Error> {
        let only = |group: usize| -> Option<Vec<String>> {
            names.iter().map(|name| Some(file.text_bounds(name, group)?.only()?.to_owned())).collect()
        };
        self.found.extend(file.groups().filter_map(only));
        let wants_group = &|group| only(group).is_none();
        let scan = Scan { batch_rows: LONG_BATCH_ROWS, as_codes: true, wants_group };
        file.scan(names, scan, |arrays| self.take(names, arrays))
    }

    /// Looks at a batch.
    ///
    /// # Errors
    /// When a column has no text form, or the combinations are too many.
    pub(crate) fn take(&mut self, names: &[&str], arrays: &[ArrayRef]) -> Result<(), ErrorKind> {
        self.columns.resize_with(names.len(), TextNumbers::default);
        let combinations = combine(&mut self.columns, names, arrays, true)?;
        let all = self.columns.iter().map(|column| column.texts.len()).product();
        let mut used = vec![false; all];
        combinations.into_iter().filter(|at| *at != NONE).for_each(|at| used[at as usize] = true);
        for mut at in (0..used.len()).filter(|at| used[*at]) {
            let mut texts = Vec::with_capacity(names.len());
            for column in self.columns.iter().rev() {
                texts.push(column.texts[at % column.texts.len()].clone());
                at /= column.texts.len();
            }
            texts.reverse();
            self.found.insert(texts);
        }
        Ok(())
    }
}

/// The texts of a column, numbered.
#[derive(Debug, Default)]
struct TextNumbers {
    texts: Vec<String>,
    numbers: HashMap<String, u32>,
    /// A dictionary and the number of each of its codes, as batch after batch shares one.
    coded: Option<(ArrayRef, Vec<u32>)>,
}

impl TextNumbers {
    fn enter(&mut self, text: &str) -> u32 {
        if let Some(number) = self.numbers.get(text) {
            return *number;
        }
        let number = self.texts.len() as u32;
        self.texts.push(text.to_owned());
        self.numbers.insert(text.to_owned(), number);
        number
    }

    /// The number of a text; a new text gets one where the column `is_open`.
    fn number(&mut self, text: Option<&str>, is_open: bool) -> u32 {
        match text {
            Some(text) if is_open => self.enter(text),
            Some(text) => self.numbers.get(text).copied().unwrap_or(NONE),
            None => NONE,
        }
    }

    /// The number of each row.
    fn rows(&mut self, name: &str, array: &ArrayRef, is_open: bool) -> Result<Vec<u32>, ErrorKind> {
        let Some(codes) = array.as_dictionary_opt::<Int32Type>() else {
            let texts = as_text(name, array)?;
            return Ok(texts.as_string::<i32>().iter().map(|text| self.number(text, is_open)).collect());
        };
        let known = self.coded.take().filter(|(known, _)| Arc::ptr_eq(known, codes.values()));
        let (dictionary, numbers) = known.unwrap_or_else(|| {
            let texts = codes.values().as_string::<i32>().iter();
            (Arc::clone(codes.values()), texts.map(|text| self.number(text, is_open)).collect())
        });
        let rows = codes.keys().iter().map(|code| code.map_or(NONE, |code| numbers[code as usize])).collect();
        self.coded = Some((dictionary, numbers));
        Ok(rows)
    }
}

/// A combination with the number of one more column, the last column's counting fastest.
fn combined(at: u32, (column, number): (&TextNumbers, u32)) -> u32 {
    if at == NONE || number == NONE { NONE } else { at * column.texts.len() as u32 + number }
}

/// The combination of the numbers of each row.
fn combine(
    columns: &mut [TextNumbers],
    names: &[&str],
    arrays: &[ArrayRef],
    is_open: bool,
) -> Result<Vec<u32>, ErrorKind> {
    let rows = arrays.first().map_or(0, Array::len);
    let each = columns.iter_mut().zip(names.iter().zip(arrays));
    let numbers = each.map(|(column, (name, array))| column.rows(name, array, is_open));
    let numbers = numbers.collect::<Result<Vec<_>, _>>()?;
    let all = columns.iter().fold(1_u64, |all, column| all.saturating_mul(column.texts.len() as u64));
    bounds::check("texts of columns that name rows", all, MAX_COMBINATIONS)?;
    let mut combinations = vec![0; rows];
    for (column, numbers) in columns.iter().zip(numbers) {
        combinations.iter_mut().zip(numbers).for_each(|(at, number)| *at = combined(*at, (column, number)));
    }
    Ok(combinations)
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
                partition.announce(&RowKeys::of(&samples(name)), std::iter::empty(), name);
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
        let key = |name: &str, place: &str| RowKeys {
            columns: vec!["name".into(), "place".into()],
            texts: vec![name.into(), place.into()],
        };
        let mut slots = Slots::of(&[key("motor", "left"), key("load", "right"), key("motor", "right")]);
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
        slots.assign(&["name", "place"], &[Arc::new(names), Arc::new(places)]).unwrap();
        let found: Vec<Vec<u32>> = (0..3).map(|slot| slots.rows_of(slot).values().to_vec()).collect();
        assert_eq!(found, [vec![3], vec![1], vec![0]]);
    }
}
