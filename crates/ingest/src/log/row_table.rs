//! Files of one kind, read as one table: what their columns are called, and the samples of one of them.
//!
//! A flight may come in pieces (several files, one after the other) and in several layouts: a row for
//! each moment, for each actuator at each moment, or for each channel at each moment. After this room
//! there are only names of channels and lists of samples.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use arrow::array::{Array, ArrayRef, AsArray, Int64Array};
use arrow::compute::cast;
use arrow::datatypes::{DataType, UInt64Type};

use crate::channel::column_builder::ColumnBuilder;
use crate::channel::si_conversion::SiConversion;
use crate::channel::stats::ChannelStats;
use crate::error::{self, Error, Fault, STRUCT};
pub(crate) use crate::log::row_partition::SampleSelector;
use crate::log::row_partition::{DistinctTexts, Partition};
use crate::mapping::{ChannelMapping, ClockMapping, Layout, Mapping, RawValue};
use crate::parquet::column_numbers::RowSelection;
use crate::parquet::log_file::{LogFile, Scan};
use crate::parquet::numeric::{append, as_text, wrong_type};
use crate::time::clock::{TimeBase, Timestamps};
use crate::time::timestamps::{TickFormat, TimestampParser};

/// The files of one kind that belong to one flight.
#[derive(Debug, Default)]
pub(crate) struct RowTable {
    pub(crate) files: Vec<LogFile>,
    pub(crate) clock: ClockMapping,
    pub(crate) layout: Layout,
    /// The time zone of local times that name none.
    pub(crate) time_zone: Option<String>,
    /// The clock of its rows, once it was read.
    pub(crate) base: OnceLock<TimeBase>,
    /// The names of all leaves, once they were asked for.
    leaf_names: OnceLock<Arc<BTreeSet<String>>>,
    /// The texts of columns that name channels or positions, once they were read.
    texts: Mutex<BTreeMap<String, Arc<BTreeSet<String>>>>,
    /// The rows of each channel or actuator, where rows belong to one.
    pub(crate) partition: Partition,
}

impl RowTable {
    pub(crate) fn new(files: Vec<LogFile>, mapping: Mapping) -> Self {
        let Mapping { clock, layout, identity, .. } = mapping;
        Self { files, clock, layout, time_zone: identity.time_zone, ..Self::default() }
    }

    /// A table of one file that is read the same way.
    pub(crate) fn alone(&self, file: LogFile) -> Self {
        let (clock, layout) = (self.clock.clone(), self.layout.clone());
        Self { files: vec![file], clock, layout, time_zone: self.time_zone.clone(), ..Self::default() }
    }

    /// Whether a row holds a list of this leaf's samples in any file.
    pub(crate) fn is_listed(&self, leaf: &str) -> bool {
        self.files.iter().any(|file| file.is_listed(leaf))
    }

    /// An error of the whole table names its first file.
    pub(crate) fn error(&self, fault: Fault) -> Error {
        self.files[0].error(fault)
    }

    /// Rows that the footers declare.
    pub(crate) fn rows(&self) -> usize {
        self.files.iter().map(LogFile::rows).sum()
    }

    /// What channels may be called here.
    pub(crate) fn names(&self) -> Result<Arc<BTreeSet<String>>, Error> {
        if let Some(column) = &self.layout.name_column {
            return self.texts(column);
        }
        let leaves = || self.files.iter().flat_map(|file| &file.leaves).map(|leaf| leaf.name.clone());
        Ok(Arc::clone(self.leaf_names.get_or_init(|| Arc::new(leaves().collect()))))
    }

    /// The samples of a channel, of one actuator where rows belong to one.
    pub(crate) fn samples(&self, name: &str, position: &str) -> SampleSelector {
        let Layout { name_column, value_column, position_column } = &self.layout;
        let named = name_column.iter().map(|column| (column.clone(), name.to_owned()));
        let own = position_column.iter().map(|column| (column.clone(), position.to_owned()));
        let leaf = if name_column.is_some() { value_column.clone() } else { None };
        SampleSelector { leaf: leaf.unwrap_or_else(|| name.to_owned()), rows: named.chain(own).collect() }
    }

    pub(crate) fn leaves_of(&self, samples: &SampleSelector) -> Vec<String> {
        let clock = self.clock.column.iter();
        let rows = samples.rows.iter().map(|(column, _)| column);
        std::iter::once(&samples.leaf).chain(rows).chain(clock).cloned().collect()
    }

    /// As numbers, raw or brought to SI, and what was seen of them where all are wanted in SI; a null is NaN. Where a
    /// sample is a row, so may be those that are not wanted.
    pub(crate) fn numbers(
        &self,
        samples: &SampleSelector,
        to_si: Option<SiConversion>,
        wanted: RowSelection<'_>,
    ) -> Result<(Vec<f64>, Option<ChannelStats>), Error> {
        // The footer may lie about the rows; what it claims is a hint, not a promise.
        let room = if self.holds_all(samples) { self.rows().min(1 << 26) } else { 0 };
        let mut values = ColumnBuilder::new(room, to_si, to_si.is_some() && wanted.is_none());
        if self.holds_all(samples) {
            // In a list a row is no sample.
            let wanted = if self.is_listed(&samples.leaf) { None } else { wanted };
            for file in &self.files {
                file.append_numbers(&samples.leaf, wanted, &mut values)?;
            }
        } else {
            self.each(samples, &samples.leaf, |array| append(&samples.leaf, array, &mut values))?;
        }
        Ok(values.finish())
    }

    /// Raw numbers for [`RawValue::is_one_of`]: where `values` are texts, 1 where a sample is one of them and 0 where it is
    /// another. NaN where a sample is missing.
    pub(crate) fn raw_values(
        &self,
        samples: &SampleSelector,
        values: &[RawValue],
    ) -> Result<Vec<f64>, Error> {
        let texts = RawValue::texts(values);
        if texts.is_empty() {
            return Ok(self.numbers(samples, None, None)?.0);
        }
        let mut marks = Vec::new();
        self.each(samples, &samples.leaf, |array| {
            let text = as_text(&samples.leaf, array)?;
            let mark = |text: &str| f64::from(u8::from(texts.iter().any(|wanted| wanted == text.trim())));
            marks.extend(text.as_string::<i32>().iter().map(|text| text.map_or(f64::NAN, mark)));
            Ok(())
        })?;
        Ok(marks)
    }

    /// 1 where all bits of `set` are set and all of `clear` are clear in the word of a sample, 0 elsewhere, NaN where it is
    /// missing.
    pub(crate) fn bit_marks(
        &self,
        samples: &SampleSelector,
        set: u64,
        clear: u64,
    ) -> Result<Vec<f64>, Error> {
        let mut marks = Vec::new();
        self.each(samples, &samples.leaf, |array| {
            let wrong =
                || wrong_type(&samples.leaf, array, "whole numbers, of which `valid_bits` names bits");
            if !array.data_type().is_integer() {
                return Err(wrong());
            }
            let words: Int64Array = match array.as_primitive_opt::<UInt64Type>() {
                Some(words) => words.unary(u64::cast_signed),
                None => cast(array, &DataType::Int64).map_err(|_| wrong())?.as_primitive().clone(),
            };
            let [set, clear] = [set, clear].map(u64::cast_signed);
            let mark = |word: i64| f64::from(u8::from(word & set == set && word & clear == 0));
            marks.extend(words.iter().map(|word| word.map_or(f64::NAN, mark)));
            Ok(())
        })?;
        Ok(marks)
    }

    /// Scale and offset of a channel: those of its mapping, or those in the Arrow metadata of its column.
    pub(crate) fn scale_and_offset(&self, leaf: &str, map: &ChannelMapping) -> Result<(f64, f64), Error> {
        let mut noted = None;
        for file in self.files.iter().filter(|file| file.has(leaf)) {
            let own = file.field_metadata(leaf);
            own.check(leaf, noted.get_or_insert(own)).map_err(|fault| file.error(fault))?;
        }
        noted.unwrap_or_default().line(leaf, map).map_err(|fault| self.error(fault))
    }

    /// Announces samples that will be read for a position, so that one pass over the files gathers them all.
    pub(crate) fn announce(&self, samples: &SampleSelector, position: &str) {
        if !samples.rows.is_empty() {
            let leaves = std::iter::once(&samples.leaf).chain(&self.clock.column);
            self.partition.announce(samples, leaves.cloned(), position);
        }
    }

    /// Whether every row of the files holds those samples.
    fn holds_all(&self, samples: &SampleSelector) -> bool {
        samples.rows.is_empty() && !self.is_of_many()
    }

    /// Whether a file holds rows of other flights.
    fn is_of_many(&self) -> bool {
        self.files.iter().any(|file| !file.flight_rows.is_empty())
    }

    /// Hands over one leaf of the samples meant, batch by batch.
    fn each(
        &self,
        samples: &SampleSelector,
        leaf: &str,
        mut take: impl FnMut(&ArrayRef) -> Result<(), Fault>,
    ) -> Result<(), Error> {
        if !self.holds_all(samples) {
            let gathered = self.partition.samples(&self.files, samples, leaf)?;
            return gathered.iter().try_for_each(take).map_err(|fault| self.error(fault));
        }
        for file in &self.files {
            // The channel's own leaf comes along: a list in it gives a row its samples.
            let has_own = leaf != samples.leaf && file.is_listed(&samples.leaf);
            let names = [leaf, samples.leaf.as_str()];
            file.scan(&names[..=usize::from(has_own)], Scan::PLAIN, |arrays| take(&arrays[0]))?;
        }
        Ok(())
    }

    /// Every text that a column holds.
    pub(crate) fn texts(&self, column: &str) -> Result<Arc<BTreeSet<String>>, Error> {
        let texts = || self.texts.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = texts().get(column) {
            return Ok(Arc::clone(known));
        }
        self.files.iter().try_for_each(|file| file.leaf(column).map(drop))?;
        let mut distinct = DistinctTexts::default();
        self.read_texts(column, &mut distinct)?;
        let found: Arc<BTreeSet<String>> = Arc::new(distinct.found.into_iter().flatten().collect());
        texts().insert(column.to_owned(), Arc::clone(&found));
        Ok(found)
    }

    /// The texts of a column, where files have it.
    fn read_texts(&self, column: &str, into: &mut DistinctTexts) -> Result<(), Error> {
        if self.is_of_many() {
            let rows = SampleSelector::every_row(column);
            return self.each(&rows, column, |array| into.take(&[column], std::slice::from_ref(array)));
        }
        let mut files = self.files.iter().filter(|file| file.has(column));
        files.try_for_each(|file| into.take_file(file, &[column]))
    }

    /// One column as text that must not change; `None` when it is null throughout, or not there.
    pub(crate) fn constant(&self, column: &str, fact: &str) -> Result<Option<String>, Error> {
        if let Some((_, text)) = self.files[0].flight_rows.iter().find(|(own, _)| own == column) {
            return Ok(Some(text.clone()));
        }
        if self.is_of_many() && !self.files.iter().all(|file| file.has(column)) {
            return Ok(None);
        }
        let mut distinct = DistinctTexts { most: 1, ..DistinctTexts::default() };
        let read = self.read_texts(column, &mut distinct);
        let mut found = distinct.found.into_iter().flatten();
        match (found.next(), found.next()) {
            (Some(one), Some(other)) => {
                let message = format!("column `{column}` should hold one {fact}, but changes");
                let hint = "where a file holds many flights, set `identity.by_row = true`; else a log must hold one flight";
                let fault = Fault::new("identity_changes", message, hint).column(column);
                Err(self.error(fault.found(format!("`{one}` and `{other}`"))))
            }
            (first, _) => read.map(|()| first),
        }
    }

    /// The stamps of those samples, from the table's time column or the channel's own.
    pub(crate) fn stamps(&self, samples: &SampleSelector, own: Option<&str>) -> Result<Timestamps, Error> {
        let Some(column) = own.or(self.clock.column.as_deref()) else {
            let no_clock = || {
                let message = "the log has no clock: neither `clock.column` nor `clock.rate_hz` is given";
                let hint = "name the time column, or give the rate when rows are evenly spaced";
                self.error(Fault::new("no_clock", message, hint))
            };
            let rate_hz = self.clock.rate_hz.ok_or_else(no_clock)?;
            return Ok(Timestamps::uniform(self.count(samples)?, rate_hz));
        };
        let ticks = self.ticks(column)?;
        let is_every_row = self.holds_all(samples);
        if !ticks.is_whole && !self.is_listed(column) && !self.is_listed(&samples.leaf) {
            let own = SampleSelector { leaf: column.to_owned(), rows: samples.rows.clone() };
            let mut reader = TimestampParser::new(column, ticks, 0);
            reader.seconds = self.numbers(&own, None, None)?.0;
            return Ok(reader.stamps());
        }
        let room = if is_every_row { self.rows() } else { 0 };
        let mut reader = TimestampParser::new(column, ticks, room);
        self.each(samples, column, |array| reader.append(array))?;
        let mut stamps = reader.stamps();
        if self.is_listed(&samples.leaf) && !self.is_listed(column) {
            spread_bursts(&mut stamps.seconds, self.clock.rate_hz);
        }
        Ok(stamps)
    }

    pub(crate) fn count(&self, samples: &SampleSelector) -> Result<usize, Error> {
        if self.holds_all(samples) && !self.is_listed(&samples.leaf) {
            return Ok(self.rows());
        }
        let mut count = 0;
        self.each(samples, &samples.leaf, |array| {
            count += array.len();
            Ok(())
        })?;
        Ok(count)
    }

    fn ticks(&self, column: &str) -> Result<TickFormat, Error> {
        let (file, clock) = (&self.files[0], &self.clock);
        let kind = &file.leaf(column)?.kind;
        let is_text = *kind == DataType::Utf8 && (clock.unit.is_none() || !file.holds_numbers(column));
        let duration = if *kind == DataType::Int64 { file.duration_unit(column) } else { None };
        TickFormat::of(kind, is_text, duration, clock)
            .map_err(|found| self.error(error::time_unit_unknown(column, &found)))
    }

    /// The known name nearest to a channel that is not here.
    pub(crate) fn lacks(&self, name: &str) -> Error {
        let names = self.names().unwrap_or_default();
        if let Err(error) = self.check_no_struct(name, &names) {
            return error;
        }
        self.error(error::column_missing(name, names.iter().map(String::as_str)))
    }

    /// Whether this is the name of a column of structs, whose fields alone can be mapped.
    pub(crate) fn check_no_struct(&self, name: &str, names: &BTreeSet<String>) -> Result<(), Error> {
        let first = format!("{name}.");
        let fields = names.range(first.clone()..).map_while(|leaf| leaf.strip_prefix(&first));
        let shown: Vec<String> = fields.take(8).map(|field| format!("`{field}`")).collect();
        if shown.is_empty() || self.layout.name_column.is_some() {
            return Ok(());
        }
        let found = format!("{STRUCT}{}", shown.join(", "));
        Err(self.error(error::column_type(name, &found, "numbers")))
    }
}

/// Spreads the samples of each row's list evenly from the row's stamp to the next row's; the last list takes the interval
/// before.
fn spread_bursts(seconds: &mut [f64], rate_hz: Option<f64>) {
    let stamps: Vec<(f64, usize)> =
        seconds.chunk_by(|a, b| a.to_bits() == b.to_bits()).map(|burst| (burst[0], burst.len())).collect();
    let (mut at, mut span_s) = (0, f64::NAN);
    for (burst, &(start, samples)) in stamps.iter().enumerate() {
        span_s = stamps.get(burst + 1).map_or(span_s, |(next, _)| next - start);
        let step_s = rate_hz.map_or(span_s / samples as f64, f64::recip);
        (0..samples).for_each(|k| seconds[at + k] = start + step_s * k as f64);
        at += samples;
    }
}
