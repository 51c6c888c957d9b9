//! One Parquet file: its leaves by name, their values in batches, checked against the footer.

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::iter::once;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use arrow::array::ArrayRef;
use arrow::datatypes::{DataType, Field, Fields, Schema, TimeUnit};
use blake3::Hasher;
use parquet::arrow::arrow_reader::{ArrowReaderMetadata, ArrowReaderOptions, ParquetRecordBatchReader};
use parquet::arrow::{ProjectionMask, parquet_to_arrow_schema};
use parquet::basic::{Encoding, Type};
use parquet::data_type::{DoubleType, FloatType};
use parquet::file::metadata::{ColumnChunkMetaData, KeyValue};

use crate::channel::column_builder::ColumnBuilder;
use crate::error::{self, Error, Fault, encrypted, not_parquet};
use crate::io::byte_source::ByteSource;
use crate::io::retry;
use crate::mapping::column_pattern::composed;
use crate::mapping::field_metadata::FieldMetadata;
use crate::parquet::column_numbers::{self, RowSelection, intersects};
use crate::parquet::leaf_columns::{self, LeafColumn};
use crate::parquet::numeric::append;
use crate::parquet::page_header::{self, Page};
use crate::parquet::page_reader::{self, BoundedGroups, Pages};
use crate::parquet::raw_footer::{self, Claims, Footer, caught};

/// Rows decoded at a time: few enough for the cache, many enough that the cost of a batch is small.
const BATCH_ROWS: usize = 8192;
/// Bytes that are read and hashed at a time: as many as stay in the cache in between.
const HASHED_BYTES: usize = 1 << 17;

/// An open Parquet file, of which only the footer has been read.
#[derive(Debug)]
pub(crate) struct LogFile {
    pub(crate) path: PathBuf,
    /// Columns and the texts that mark the rows of one flight; empty if the file holds only one.
    pub(crate) flight_rows: Vec<(String, String)>,
    source: ByteSource,
    footer: ArrowReaderMetadata,
    footer_start: u64,
    claims: Claims,
    /// The columns of the file, texts as dictionary codes.
    coded: OnceLock<Fields>,
    /// The Arrow schema in the footer, decoded at its first use; `None` if it is missing or damaged.
    noted: OnceLock<Option<Schema>>,
    /// Every leaf, in the order of the file.
    pub(crate) leaves: Vec<LeafColumn>,
    /// Indices in `leaves`, by name.
    by_name: HashMap<String, Vec<usize>>,
}

#[derive(Clone, Copy)]
pub(crate) struct Scan<'s> {
    /// Rows decoded at a time.
    pub(crate) batch_rows: usize,
    /// Whether text that is stored as dictionary codes is returned as codes.
    pub(crate) as_codes: bool,
    /// Whether a row group is read, by its number; a skipped one must hold no requested row.
    pub(crate) wants_group: &'s dyn Fn(usize) -> bool,
}

impl Scan<'_> {
    /// Every row group in small batches, text as text.
    pub(crate) const PLAIN: Self = Self { batch_rows: BATCH_ROWS, as_codes: false, wants_group: &|_| true };
}

impl LogFile {
    pub(crate) fn open(path: &Path) -> Result<Self, Error> {
        Self::read_footer(path).map_err(|fault| fault.in_file(path))
    }

    fn read_footer(path: &Path) -> Result<Self, Fault> {
        let source = ByteSource::open(path)?;
        let empty = || {
            let hint = "file is empty; delete it or ignore it. It is skipped until it changes";
            Fault::new("empty_log", "the log has no rows", hint)
        };
        if retry::file_length(&source.file)? == 0 {
            return Err(empty());
        }
        let Footer { metadata, start: footer_start, claims } =
            raw_footer::read(&source.file, |range| source.want(once(range)))?;
        // The embedded Arrow schema adds only zones and dictionaries, and its decoder panics on some damage.
        let options = ArrowReaderOptions::new().with_skip_arrow_metadata(true);
        let footer = caught(|| ArrowReaderMetadata::try_new(metadata, options)).map_err(not_parquet)?;
        let leaves = leaf_columns::leaves(footer.schema().fields());
        let mut by_name: HashMap<String, Vec<usize>> = HashMap::with_capacity(leaves.len());
        for (place, leaf) in leaves.iter().enumerate() {
            by_name.entry(leaf.name.clone()).or_default().push(place);
        }
        let (coded, noted) = (OnceLock::new(), OnceLock::new());
        let (path, flight_rows) = (path.to_owned(), Vec::new());
        let opened =
            Self { path, flight_rows, source, footer, footer_start, claims, coded, noted, leaves, by_name };
        if opened.rows() == 0 { Err(empty()) } else { Ok(opened) }
    }

    pub(crate) fn error(&self, fault: Fault) -> Error {
        fault.in_file(&self.path)
    }

    /// Rows the footer declares.
    pub(crate) fn rows(&self) -> usize {
        usize::try_from(self.footer.metadata().file_metadata().num_rows()).unwrap_or(0)
    }

    pub(crate) fn has(&self, name: &str) -> bool {
        self.find(name).is_some()
    }

    /// The columns of a name, or the fields of structs where no column has it: a column called `a.b` comes before field
    /// `b` of struct `a`.
    fn named(&self, name: &str) -> Vec<&LeafColumn> {
        let places = self.by_name.get(&*composed(name)).into_iter().flatten();
        let leaves = places.map(|place| &self.leaves[*place]);
        let (fields, columns): (Vec<_>, Vec<_>) = leaves.partition(|leaf| leaf.is_field);
        if columns.is_empty() { fields } else { columns }
    }

    fn find(&self, name: &str) -> Option<&LeafColumn> {
        self.named(name).first().copied()
    }

    pub(crate) fn leaf(&self, name: &str) -> Result<&LeafColumn, Error> {
        let found = self.named(name);
        Err(self.error(match found[..] {
            [leaf] => return Ok(leaf),
            [] => error::column_missing(name, self.leaves.iter().map(|leaf| leaf.name.as_str())),
            _ => {
                let message = format!("the log has {} columns called `{name}`", found.len());
                let hint =
                    "give each column a name of its own where the file is written, or map another column";
                Fault::new("duplicate_column", message, hint).column(name)
            }
        }))
    }

    /// Whether each row holds a list of this leaf's samples; false if there is no such leaf.
    pub(crate) fn is_listed(&self, name: &str) -> bool {
        matches!(self.named(name)[..], [leaf] if leaf.is_listed)
    }

    /// The unit of a column of durations: Parquet has no such type, so Arrow's writers note the unit in the metadata.
    pub(crate) fn duration_unit(&self, name: &str) -> Option<TimeUnit> {
        match self.noted_field(name)?.data_type() {
            DataType::Duration(unit) => Some(*unit),
            _ => None,
        }
    }

    pub(crate) fn field_metadata(&self, name: &str) -> FieldMetadata {
        self.noted_field(name).map(FieldMetadata::of).unwrap_or_default()
    }

    /// A column's field in the Arrow schema; found by index, as a log may have ten thousand columns.
    fn noted_field(&self, name: &str) -> Option<&Field> {
        let leaf = self.find(name).filter(|leaf| !leaf.is_field)?;
        let noted = || {
            self.metadata("ARROW:schema")?;
            let file = self.footer.metadata().file_metadata();
            // The decoder of that schema panics on some damage.
            caught(|| parquet_to_arrow_schema(file.schema_descr(), file.key_value_metadata())).ok()
        };
        self.noted.get_or_init(noted).as_ref()?.fields().get(leaf.root).map(Arc::as_ref)
    }

    /// A value of the footer's key-value metadata.
    pub(crate) fn metadata(&self, key: &str) -> Option<&str> {
        let pairs = self.footer.metadata().file_metadata().key_value_metadata()?;
        pairs.iter().find(|pair| pair.key == key)?.value.as_deref()
    }

    /// A value of that metadata, or a field of a JSON value: `flight.tail` of `{"tail": "N1"}` under the key `flight`.
    pub(crate) fn metadata_field(&self, key: &str) -> Option<String> {
        if let Some(text) = self.metadata(key) {
            return Some(text.to_owned());
        }
        let (key, field) = key.rsplit_once('.')?;
        json_fields(self.metadata(key)?).remove(field)
    }

    /// Names in the key-value metadata, each with its key: the keys themselves, and the fields of values that are JSON.
    pub(crate) fn metadata_names(&self) -> Vec<(String, String)> {
        let pairs = self.footer.metadata().file_metadata().key_value_metadata();
        let names = |KeyValue { key, value }: &KeyValue| {
            let fields = json_fields(value.as_deref().unwrap_or_default()).into_keys();
            let fields = fields.map(|field| (field.clone(), format!("{key}.{field}")));
            once((key.clone(), key.clone())).chain(fields).collect::<Vec<_>>()
        };
        pairs.into_iter().flatten().flat_map(names).collect()
    }

    /// Passes the values of some leaves, batch by batch and aligned by sample, to `take`.
    pub(crate) fn scan(
        &self,
        names: &[&str],
        scan: Scan<'_>,
        mut take: impl FnMut(&[ArrayRef]) -> Result<(), Fault>,
    ) -> Result<(), Error> {
        let leaves = names.iter().map(|name| self.leaf(name)).collect::<Result<Vec<_>, _>>()?;
        let wanted: Vec<usize> = self.groups().filter(|group| (scan.wants_group)(*group)).collect();
        self.want(&leaves, wanted.iter().copied())?;
        for group in wanted {
            let mut scan = scan;
            let has_shared_beginnings =
                |leaf: &&&LeafColumn| page_reader::has_shared_beginnings(self.chunk(group, leaf));
            for leaf in leaves.iter().filter(has_shared_beginnings) {
                scan.batch_rows = page_reader::batch_rows(&self.pages(group, leaf)?, scan.batch_rows);
            }
            self.each_batch(group, &leaves, scan, |columns| {
                let flats = columns.iter().map(leaf_columns::flatten).collect();
                take(&leaf_columns::align_lengths(names, flats)?)
            })?;
        }
        Ok(())
    }

    /// Bounds of the texts of a column in a row group, from its statistics; `None` if these do not hold them.
    pub(crate) fn text_bounds(&self, name: &str, group: usize) -> Option<TextBounds<'_>> {
        let leaf = self.find(name).filter(|leaf| leaf.kind == DataType::Utf8 && !leaf.is_listed)?;
        let statistics = self.chunk(group, leaf).statistics()?;
        if statistics.is_min_max_deprecated() {
            return None;
        }
        let (least, greatest) = (statistics.min_bytes_opt()?, statistics.max_bytes_opt()?);
        let is_exact = statistics.min_is_exact() && statistics.max_is_exact();
        Some(TextBounds { least, greatest, is_exact })
    }

    /// Whether a column of texts seems to hold numbers, by the statistics of its first rows.
    pub(crate) fn holds_numbers(&self, name: &str) -> bool {
        self.text_bounds(name, 0).is_some_and(|bounds| {
            let number = |text| std::str::from_utf8(text).ok()?.trim().parse::<f64>().ok();
            [bounds.least, bounds.greatest].into_iter().all(|text| number(text).is_some())
        })
    }

    /// Appends the numbers of a leaf, sample by sample; nulls and unwanted samples are NaN. Row groups and pages without
    /// a wanted row are not decompressed. A leaf whose rows hold lists must be wanted as a whole.
    pub(crate) fn append_numbers(
        &self,
        name: &str,
        wanted: RowSelection<'_>,
        into: &mut ColumnBuilder,
    ) -> Result<(), Error> {
        let leaf = self.leaf(name)?;
        self.want(&[leaf], self.groups())?;
        for group in self.groups() {
            let (before, declared) = (into.len(), self.rows_of(group));
            if !intersects(wanted, &(before..before + declared)) {
                into.append_nulls(declared);
                continue;
            }
            let chunk = self.chunk(group, leaf);
            if column_numbers::is_plain(chunk) {
                let pages = self.pages(group, leaf)?;
                let pages = Pages::new(Arc::clone(&self.source.file), chunk, pages, BATCH_ROWS);
                let read = caught(|| match chunk.column_type() {
                    Type::DOUBLE => column_numbers::append::<DoubleType>(pages, chunk, wanted, into),
                    _ => column_numbers::append::<FloatType>(pages, chunk, wanted, into),
                });
                read.map_err(|detail| self.decode(leaf, group, &detail))?;
                self.all_rows(group, into.len() - before, leaf)?;
            } else {
                self.each_batch(group, &[leaf], Scan::PLAIN, |columns| {
                    append(name, &leaf_columns::flatten(&columns[0]).values, into)
                })?;
            }
        }
        Ok(())
    }

    /// Checks that as many rows of a row group were read as it declares.
    fn all_rows(&self, group: usize, rows: usize, leaf: &LeafColumn) -> Result<(), Error> {
        let declared = self.rows();
        let found = declared - self.rows_of(group) + rows;
        if found == declared {
            return Ok(());
        }
        Err(self.error(error::row_count(&leaf.name, found, declared)))
    }

    /// Steps through one row group's leaves, each by its own reader: two fields of one struct would
    /// otherwise come back as one column.
    fn each_batch(
        &self,
        group: usize,
        leaves: &[&LeafColumn],
        scan: Scan<'_>,
        mut take: impl FnMut(&[ArrayRef]) -> Result<(), Fault>,
    ) -> Result<(), Error> {
        let mut columns =
            leaves.iter().map(|leaf| self.column(group, leaf, scan)).collect::<Result<Vec<_>, _>>()?;
        let mut rows = 0;
        loop {
            let mut batch: Vec<ArrayRef> = Vec::with_capacity(columns.len());
            for (reader, leaf) in columns.iter_mut().zip(leaves) {
                let next = caught(|| reader.next().transpose());
                let next = next.map_err(|detail| self.decode(leaf, group, &detail))?;
                batch.extend(next.map(|found| Arc::clone(found.column(0))));
            }
            let Some(first) = batch.first() else { return self.all_rows(group, rows, leaves[0]) };
            if batch.len() < leaves.len() || batch.iter().any(|a| a.len() != first.len()) {
                return Err(self.decode(leaves[0], group, "its leaves hold different numbers of rows"));
            }
            rows += first.len();
            take(&batch).map_err(|fault| self.error(fault))?;
        }
    }

    fn column(
        &self,
        group: usize,
        leaf: &LeafColumn,
        scan: Scan<'_>,
    ) -> Result<ParquetRecordBatchReader, Error> {
        let is_coded = scan.as_codes && self.is_coded(group, leaf);
        let coded = || self.coded.get_or_init(|| with_codes(self.footer.schema().fields(), |_| true));
        let kinds = is_coded.then(coded);
        let mask = ProjectionMask::leaves(self.footer.parquet_schema(), [leaf.index]);
        let (file, groups) = (Arc::clone(&self.source.file), vec![group]);
        let metadata = self.footer.metadata();
        let groups = BoundedGroups { file, metadata, groups, batch_rows: scan.batch_rows };
        groups.reader(mask, kinds).map_err(|e| self.decode(leaf, group, &e.to_string()))
    }

    /// Whether a chunk is a text column outside of structs, with dictionary codes as values.
    fn is_coded(&self, group: usize, leaf: &LeafColumn) -> bool {
        let is_code = |e: Encoding| matches!(e, Encoding::RLE_DICTIONARY | Encoding::PLAIN_DICTIONARY);
        let has_dictionary = self.chunk(group, leaf).encodings().any(is_code);
        has_dictionary && self.footer.schema().field(leaf.root).data_type() == &DataType::Utf8
    }

    /// Whether every page of the named leaves has a checksum; an error for a header that claims what is impossible, or for
    /// pages that hold other rows than are declared.
    pub(crate) fn has_page_checksums(&self, names: &[&str]) -> Result<bool, Error> {
        let leaves = names.iter().map(|name| self.leaf(name)).collect::<Result<Vec<_>, _>>()?;
        self.want(&leaves, self.groups())?;
        let mut has_all = true;
        for (group, leaf) in self.groups().flat_map(|group| leaves.iter().map(move |leaf| (group, leaf))) {
            has_all &= self.pages(group, leaf)?.iter().all(|page| page.header.crc.is_some());
        }
        Ok(has_all)
    }

    pub(crate) fn groups(&self) -> Range<usize> {
        0..self.footer.metadata().num_row_groups()
    }

    pub(crate) fn rows_of(&self, group: usize) -> usize {
        usize::try_from(self.footer.metadata().row_group(group).num_rows()).unwrap_or(0)
    }

    /// The pages of a chunk; an error for a header that claims what is impossible.
    fn pages(&self, group: usize, leaf: &LeafColumn) -> Result<Vec<Page>, Error> {
        let rows = self.footer.metadata().row_group(group).num_rows();
        page_header::bounded(&self.source.file, self.chunk(group, leaf), rows)
            .map_err(|detail| self.decode(leaf, group, &detail))
    }

    fn chunk(&self, group: usize, leaf: &LeafColumn) -> &ColumnChunkMetaData {
        self.footer.metadata().row_group(group).column(leaf.index)
    }

    /// Fetches the chunks of these leaves in some row groups.
    fn want(&self, leaves: &[&LeafColumn], groups: impl Iterator<Item = usize>) -> Result<(), Error> {
        let chunks = groups.flat_map(|group| leaves.iter().map(move |leaf| self.chunk(group, leaf)));
        self.source.want(chunks.map(range_of)).map_err(|fault| self.error(fault))
    }

    fn decode(&self, leaf: &LeafColumn, group: usize, detail: &str) -> Error {
        let is_own = |chunk: &u64| chunk % self.leaves.len() as u64 == leaf.index as u64;
        self.error(if self.claims.encrypted_chunks.iter().any(is_own) {
            encrypted(Some(&leaf.name))
        } else if self.claims.is_encrypted {
            encrypted(None)
        } else {
            error::decode_failed(&leaf.name, group, detail)
        })
    }

    /// Feeds the footer and the chunks of the named leaves, in the order of the file, into a digest.
    ///
    /// Equal digests mean equal data read, whatever the name of the file and
    /// whatever else was added to it.
    pub(crate) fn feed(&self, names: &[&str], hash: &mut Hasher) -> Result<(), Error> {
        let unreadable = |source: std::io::Error| self.error(source.into());
        let length = retry::file_length(&self.source.file).map_err(unreadable)?;
        let names: HashSet<Cow<'_, str>> = names.iter().map(|name| composed(name)).collect();
        let wanted: Vec<&LeafColumn> =
            self.leaves.iter().filter(|l| names.contains(l.name.as_str())).collect();
        self.want(&wanted, self.groups())?;
        let chunks = self.groups().flat_map(|group| wanted.iter().map(move |leaf| self.chunk(group, leaf)));
        let pages = chunks.map(range_of).map(|Range { start, end }| start..length.min(end));
        let mut buffer = vec![0; HASHED_BYTES];
        for stretch in pages.chain(once(self.footer_start..length)) {
            for at in stretch.clone().step_by(HASHED_BYTES) {
                let bytes = &mut buffer[..HASHED_BYTES.min((stretch.end - at) as usize)];
                retry::read_exact(&self.source.file, bytes, at).map_err(unreadable)?;
                hash.update(bytes);
            }
        }
        for (_, text) in &self.flight_rows {
            hash.update(&text.len().to_le_bytes());
            hash.update(text.as_bytes());
        }
        Ok(())
    }
}

/// The texts and numbers of a JSON object by name; none of any other text.
fn json_fields(text: &str) -> BTreeMap<String, String> {
    let fields: BTreeMap<String, serde_json::Value> = serde_json::from_str(text).unwrap_or_default();
    let text = |value: serde_json::Value| match value {
        serde_json::Value::String(text) => Some(text),
        serde_json::Value::Number(number) => Some(number.to_string()),
        _ => None,
    };
    fields.into_iter().filter_map(|(name, value)| Some((name, text(value)?))).collect()
}

/// Bounds of the texts of a column in a row group.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TextBounds<'f> {
    pub(crate) least: &'f [u8],
    pub(crate) greatest: &'f [u8],
    /// Whether both are texts of the column, and not truncated.
    pub(crate) is_exact: bool,
}

impl TextBounds<'_> {
    /// Whether the row group may hold a text, which may be padded with blanks there.
    pub(crate) fn may_hold(&self, text: &str) -> bool {
        self.least.trim_ascii_end() <= text.as_bytes() && text.as_bytes() <= self.greatest
    }

    /// The text of the row group without blanks at its end, if it has only one.
    pub(crate) fn only(&self) -> Option<&str> {
        let is_one = self.is_exact && self.least == self.greatest;
        is_one.then(|| std::str::from_utf8(self.least).ok()).flatten().map(str::trim_end)
    }
}

/// Columns, of which the selected ones that hold texts are read as dictionary codes.
pub(crate) fn with_codes(fields: &Fields, is_coded: impl Fn(&str) -> bool) -> Fields {
    let codes = DataType::Dictionary(Box::new(DataType::Int32), Box::new(DataType::Utf8));
    let field = |field: &Arc<Field>| {
        let is_text = matches!(field.data_type(), DataType::Utf8 | DataType::LargeUtf8 | DataType::Utf8View);
        let coded = || Arc::new(field.as_ref().clone().with_data_type(codes.clone()));
        if is_text && is_coded(field.name()) { coded() } else { Arc::clone(field) }
    };
    fields.iter().map(field).collect()
}

fn range_of(chunk: &ColumnChunkMetaData) -> Range<u64> {
    let (start, bytes) = chunk.byte_range();
    start..start.saturating_add(bytes)
}
