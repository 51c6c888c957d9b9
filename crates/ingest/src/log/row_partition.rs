//! Samples of long layouts: one pass over the files gathers the rows of every channel and actuator that will be read.
//!
//! A row of such a file belongs to one channel, or to one actuator, and a column of texts names it. Other
//! rows are dropped as they are decoded, and row groups whose statistics exclude every requested text are not decoded.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use arrow::array::{Array, ArrayRef, AsArray, DictionaryArray, UInt32Array};
use arrow::compute::{cast, take};
use arrow::datatypes::{DataType, Int32Type};
use smart_default::SmartDefault;

use crate::bounds;
use crate::error::{Error, Fault};
use crate::parquet::log_file::{LogFile, Scan};
use crate::parquet::numeric::wrong_type;

/// Rows decoded at a time: a batch is split among many channels, so it is larger than that of a wide log.
pub(crate) const LONG_BATCH_ROWS: usize = 1 << 16;

/// Memory limit of gathered samples, bytes; what does not fit is gathered by a later pass.
const MAX_GATHERED_BYTES: usize = 256 << 20;

/// A combination that has no number yet.
const NEW: u32 = u32::MAX;
/// Most combinations of a batch that are numbered by a table.
const MAX_TABLE: usize = 1 << 18;

/// The most combinations of texts of the columns that name rows: more are the numbers or times of a wrong column.
const MAX_COMBINATIONS: u64 = 1 << 22;

/// Which samples are meant: the leaf that holds them, and the rows in which it does.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct SampleSelector {
    pub(crate) leaf: String,
    /// Columns and the text they must hold.
    pub(crate) rows: Vec<(String, String)>,
}

impl SampleSelector {
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
pub(crate) struct Partition(Mutex<State>);

#[derive(Debug, Default)]
struct State {
    /// Rows that will be read, and the positions that will read them.
    announced: BTreeMap<Rows, BTreeSet<String>>,
    leaves: BTreeSet<String>,
    gathered: HashMap<GatheredKey, Arc<Vec<ArrayRef>>>,
}

impl Partition {
    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Remembers rows and leaves that a position will ask for.
    pub(crate) fn announce(
        &self,
        samples: &SampleSelector,
        leaves: impl Iterator<Item = String>,
        position: &str,
    ) {
        let mut state = self.state();
        state.leaves.extend(leaves);
        state.announced.entry(samples.rows.clone()).or_default().insert(position.to_owned());
    }

    /// Frees the samples that only this position asks for.
    pub(crate) fn release(&self, position: &str) {
        let State { announced, gathered, .. } = &mut *self.state();
        announced.retain(|_, positions| {
            positions.remove(position);
            !positions.is_empty()
        });
        gathered.retain(|(rows, ..), _| announced.contains_key(rows));
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
        keys.extend(state.announced.keys().filter(|rows| is_new(rows)).cloned());
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
    let mut bytes = vec![0_usize; keys.len()];
    for file in files {
        // The rows of the flight that the file is opened for.
        let of_flight = |rows: &Rows| [rows.as_slice(), &file.flight_rows].concat();
        let keys: Vec<Rows> = keys[..gathered.len()].iter().map(of_flight).collect();
        let columns: Vec<&str> = keys[0].iter().map(|(column, _)| column.as_str()).collect();
        let names: Vec<&str> = leaves.iter().chain(&columns).copied().chain(aligned).collect();
        let texts = keys.iter().map(|rows| rows.iter().map(|(_, text)| text.as_str()).collect());
        let by_texts: HashMap<Vec<&str>, usize> = texts.zip(0..).collect();
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
            let found = Combinations::of(&columns, rest)?;
            let keys: Vec<Option<usize>> =
                found.texts().map(|texts| by_texts.get(&texts?).copied()).collect();
            let mut by_key = vec![Vec::new(); by_texts.len()];
            for (row, number) in (0_u32..).zip(&found.of_rows) {
                if let Some(key) = keys[*number as usize] {
                    by_key[key].push(row);
                }
            }
            for (key, rows) in by_key.into_iter().enumerate().take(gathered.len()) {
                if rows.is_empty() {
                    continue;
                }
                let rows = UInt32Array::from(rows);
                for ((part, array), leaf) in gathered[key].iter_mut().zip(values).zip(&leaves) {
                    let samples = take(array, &rows, None).map_err(|_| wrong_type(leaf, array, "numbers"))?;
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

/// The combinations of texts that the rows of some columns hold; a row without one of the texts holds none.
#[derive(Debug, SmartDefault)]
pub(crate) struct DistinctTexts {
    pub(crate) found: BTreeSet<Vec<String>>,
    /// More are an error.
    #[default(MAX_COMBINATIONS)]
    pub(crate) most: u64,
}

impl DistinctTexts {
    /// Looks at a file; a row group that holds but one combination, by its statistics, is not read.
    pub(crate) fn take_file(&mut self, file: &LogFile, names: &[&str]) -> Result<(), Error> {
        let only = |group: usize| -> Option<Vec<String>> {
            names.iter().map(|name| Some(file.text_bounds(name, group)?.only()?.to_owned())).collect()
        };
        self.found.extend(file.groups().filter_map(only));
        let wants_group = &|group| only(group).is_none();
        let scan = Scan { batch_rows: LONG_BATCH_ROWS, as_codes: true, wants_group };
        file.scan(names, scan, |arrays| self.take(names, arrays))
    }

    pub(crate) fn take(&mut self, names: &[&str], arrays: &[ArrayRef]) -> Result<(), Fault> {
        let owned = |texts: Vec<&str>| texts.into_iter().map(str::to_owned).collect();
        self.found.extend(Combinations::of(names, arrays)?.texts().flatten().map(owned));
        bounds::check("texts of columns that name rows", self.found.len() as u64, self.most)
    }
}

/// A column of texts, each row as a code.
type Codes = DictionaryArray<Int32Type>;

/// The combinations of texts that the rows of a batch hold.
struct Combinations {
    columns: Vec<Codes>,
    /// The number of each row's combination.
    of_rows: Vec<u32>,
    /// The first row of each combination.
    first_rows: Vec<usize>,
}

impl Combinations {
    fn of(names: &[&str], arrays: &[ArrayRef]) -> Result<Self, Fault> {
        let kind = DataType::Dictionary(Box::new(DataType::Int32), Box::new(DataType::Utf8));
        let coded = |(name, array): (&&str, &ArrayRef)| {
            let coded = cast(array, &kind).map_err(|_| wrong_type(name, array, "text or numbers"))?;
            Ok(coded.as_dictionary().clone())
        };
        let columns = names.iter().zip(arrays).map(coded).collect::<Result<Vec<Codes>, Fault>>()?;
        let (mut of_rows, mut first_rows) = (vec![0; arrays.first().map_or(0, Array::len)], vec![0]);
        for column in &columns {
            // One more code stands for a missing text.
            let codes = column.values().len() + 1;
            // Numbers of the combinations with this column, in a table unless it would be large.
            let places = first_rows.len() * codes;
            let (is_small, mut others) = (places <= MAX_TABLE, HashMap::new());
            let mut table = vec![NEW; if is_small { places } else { 0 }];
            first_rows.clear();
            for (row, (number, code)) in of_rows.iter_mut().zip(column.keys()).enumerate() {
                let place = *number as usize * codes + code.map_or(codes - 1, |code| code as usize);
                let known = if is_small { &mut table[place] } else { others.entry(place).or_insert(NEW) };
                if *known == NEW {
                    *known = first_rows.len() as u32;
                    first_rows.push(row);
                }
                *number = *known;
            }
        }
        Ok(Self { columns, of_rows, first_rows })
    }

    /// The texts of each combination, by number, without blanks at their ends, to which databases pad; `None` where one of
    /// them is missing.
    fn texts(&self) -> impl Iterator<Item = Option<Vec<&str>>> {
        self.first_rows.iter().map(|row| {
            let texts = self.columns.iter();
            texts
                .map(|texts| Some(texts.values().as_string::<i32>().value(texts.key(*row)?).trim_end()))
                .collect()
        })
    }
}

#[cfg(test)]
mod tests {
    use arrow::array::{Float64Array, RecordBatch, StringArray};
    use arrow::datatypes::Float64Type;
    use parquet::file::properties::WriterProperties;

    use super::*;
    use crate::parquet::writer::write_batch;

    /// Rows of parameters p0 to p9 in turn, or one parameter after the other, whose values are their row numbers. Some names
    /// are padded, as a database does.
    fn file(folder: &std::path::Path, is_sorted: bool) -> LogFile {
        let pad = |row: u32| if row.is_multiple_of(7) { "  " } else { "" };
        let name = |row: u32| format!("p{}{}", if is_sorted { row / 100 } else { row % 10 }, pad(row));
        let names: StringArray = (0..1000).map(|row| Some(name(row))).collect();
        let values: Float64Array = (0..1000).map(f64::from).collect();
        let columns: [(&str, ArrayRef); 2] = [("name", Arc::new(names)), ("value", Arc::new(values))];
        let batch = RecordBatch::try_from_iter(columns).unwrap();
        let path = folder.join("log.parquet");
        let groups = WriterProperties::builder().set_max_row_group_row_count(Some(100)).build();
        write_batch(std::fs::File::create(&path).unwrap(), &batch, groups).unwrap();
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
            let bounds = |group| files[0].text_bounds("name", group).unwrap();
            let holding = |name: &str| files[0].groups().filter(|g| bounds(*g).may_hold(name)).count();
            assert_eq!(["p4", "q"].map(holding), [if is_sorted { 1 } else { 10 }, 0]);
        }
    }
}
