//! Samples of long layouts: one pass over the files gathers the rows of every channel and actuator that will be read.
//!
//! A row of such a file belongs to one channel, or to one actuator, and a column of texts names it. Other
//! rows are dropped as they are decoded, and row groups whose statistics exclude every requested text are not decoded.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use arrow::array::{Array, ArrayRef, AsArray, UInt32Array};
use arrow::compute::take;
use arrow::datatypes::Int32Type;

use crate::error::{Error, ErrorKind};
use crate::parquet::log_file::{LogFile, Scan};
use crate::parquet::numeric::as_text;

/// Rows decoded at a time: a batch is split among many channels, so it is larger than that of a wide log.
pub(crate) const LONG_BATCH_ROWS: usize = 1 << 16;

/// Memory limit of gathered samples, bytes; what does not fit is gathered by a later pass.
const MAX_GATHERED_BYTES: usize = 256 << 20;

/// No slot: the row belongs to a channel that is not requested.
const NONE: u32 = u32::MAX;

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
    /// For each column the number of each requested text.
    texts: Vec<BTreeMap<String, u32>>,
    /// The slot of every combination of these numbers, the last column's counting fastest.
    slots: Vec<u32>,
    /// The number of each text of a dictionary, and that dictionary, as batch after batch shares one.
    coded: Vec<Option<(ArrayRef, Vec<u32>)>>,
    /// The rows of each slot.
    rows: Vec<Vec<u32>>,
}

impl Slots {
    fn of(keys: &[RowKeys]) -> Self {
        let columns = keys[0].columns.len();
        let texts: Vec<BTreeMap<String, u32>> = (0..columns)
            .map(|column| {
                let all: BTreeSet<&String> = keys.iter().map(|rows| &rows.texts[column]).collect();
                all.into_iter().zip(0..).map(|(text, number)| (text.clone(), number)).collect()
            })
            .collect();
        let mut slots = vec![NONE; texts.iter().map(BTreeMap::len).product()];
        for (slot, rows) in (0..).zip(keys) {
            let numbers = rows.texts.iter().zip(&texts);
            let at = numbers.fold(0, |at, (text, known)| at * known.len() + known[text] as usize);
            slots[at] = slot;
        }
        Self { coded: vec![None; columns], texts, slots, rows: vec![Vec::new(); keys.len()] }
    }

    /// Sorts the rows of a batch by slot.
    fn assign(&mut self, columns: &[&str], arrays: &[ArrayRef]) -> Result<(), ErrorKind> {
        let mut combined = vec![0_u32; arrays.first().map_or(0, Array::len)];
        for (k, (column, array)) in columns.iter().zip(arrays).enumerate() {
            let of_column = self.texts[k].len() as u32;
            let enter = |(at, number): (&mut u32, u32)| {
                *at = if *at == NONE || number == NONE { NONE } else { *at * of_column + number };
            };
            if let Some(codes) = array.as_dictionary_opt::<Int32Type>() {
                let numbers = self.numbers_of_codes(k, codes.values());
                let number = |code: Option<i32>| code.map_or(NONE, |code| numbers[code as usize]);
                combined.iter_mut().zip(codes.keys().iter().map(number)).for_each(enter);
            } else {
                let text = as_text(column, array)?;
                let numbers = text.as_string::<i32>().iter().map(|text| number_of(&self.texts[k], text));
                combined.iter_mut().zip(numbers).for_each(enter);
            }
        }
        self.rows.iter_mut().for_each(Vec::clear);
        for (row, at) in (0..).zip(combined) {
            let slot = self.slots.get(at as usize).copied().unwrap_or(NONE);
            self.rows.get_mut(slot as usize).into_iter().for_each(|rows| rows.push(row));
        }
        Ok(())
    }

    /// The number of each code of a dictionary of column `k`.
    fn numbers_of_codes(&mut self, k: usize, dictionary: &ArrayRef) -> &[u32] {
        let known = self.coded[k].take().filter(|(known, _)| Arc::ptr_eq(known, dictionary));
        let (_, numbers) = self.coded[k].insert(known.unwrap_or_else(|| {
            let texts = dictionary.as_string::<i32>().iter();
            (Arc::clone(dictionary), texts.map(|text| number_of(&self.texts[k], text)).collect())
        }));
        numbers
    }

    /// The rows of a slot in the batch.
    fn rows_of(&self, slot: usize) -> UInt32Array {
        UInt32Array::from(self.rows[slot].clone())
    }
}

/// The number of a requested text.
fn number_of(texts: &BTreeMap<String, u32>, text: Option<&str>) -> u32 {
    text.and_then(|text| texts.get(text)).copied().unwrap_or(NONE)
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
