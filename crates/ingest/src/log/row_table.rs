//! Files of one kind, read as one table: what their columns are called, and the samples of one of them.
//!
//! A flight may come in pieces (several files, one after the other) and in several layouts: a row for
//! each moment, for each actuator at each moment, or for each channel at each moment. After this room
//! there are only names of channels and lists of samples.

use std::collections::BTreeSet;
use std::sync::OnceLock;

use arrow::array::{Array, ArrayRef, AsArray};
use arrow::datatypes::DataType;

use crate::channel::column_builder::ColumnBuilder;
use crate::channel::si_conversion::SiConversion;
use crate::channel::stats::ChannelStats;
use crate::error::{Error, ErrorKind};
use crate::log::timestamps::{TickEpoch, TickFormat, TimestampParser};
use crate::mapping::column_pattern::nearest;
use crate::mapping::units::TimeUnit;
use crate::mapping::{ClockMapping, Epoch, Layout};
use crate::parquet::log_file::LogFile;
use crate::parquet::numeric::{append, append_where, as_text};
use crate::parquet::row_selection::RowSelection;
use crate::time::clock::{TimeBase, Timestamps};

/// The files of one kind that belong to one flight.
#[derive(Debug)]
pub(crate) struct RowTable {
    pub(crate) files: Vec<LogFile>,
    pub(crate) clock: ClockMapping,
    pub(crate) layout: Layout,
    /// The clock of its rows, once it was read.
    pub(crate) line: OnceLock<TimeBase>,
}

/// Which samples are meant: the leaf that holds them, and the rows in which it does.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct SampleSelector {
    /// The leaf.
    pub(crate) leaf: String,
    /// Columns and the text they must hold.
    pub(crate) rows: Vec<(String, String)>,
}

impl RowTable {
    /// Some files read as one table.
    pub(crate) fn new(files: Vec<LogFile>, clock: ClockMapping, layout: Layout) -> Self {
        Self { files, clock, layout, line: OnceLock::new() }
    }

    /// The same files by another clock and layout.
    pub(crate) fn remap(&mut self, clock: &ClockMapping, layout: &Layout) {
        (self.clock, self.layout) = (clock.clone(), layout.clone());
        self.line = OnceLock::new();
    }

    /// Whether a row holds a list of this leaf's samples in any file.
    pub(crate) fn is_listed(&self, leaf: &str) -> bool {
        self.files.iter().any(|file| file.leaf(leaf).is_ok_and(|leaf| leaf.is_listed))
    }

    /// An error of the whole table names its first file.
    pub(crate) fn error(&self, fault: ErrorKind) -> Error {
        self.files[0].error(fault)
    }

    /// Rows that the footers declare.
    pub(crate) fn rows(&self) -> usize {
        self.files.iter().map(LogFile::rows).sum()
    }

    /// What channels may be called here.
    ///
    /// # Errors
    /// When channels are named by a column, and it cannot be read.
    pub(crate) fn names(&self) -> Result<BTreeSet<String>, Error> {
        match &self.layout.name_column {
            Some(column) => self.texts(column),
            None => Ok(self.files.iter().flat_map(|f| f.leaves().iter().map(|l| l.name.clone())).collect()),
        }
    }

    /// The positions in the position column, if the layout has one.
    ///
    /// # Errors
    /// When that column cannot be read.
    pub(crate) fn row_positions(&self) -> Result<Option<BTreeSet<String>>, Error> {
        self.layout.position_column.as_deref().map(|column| self.texts(column)).transpose()
    }

    /// The samples of a channel, of one actuator where rows belong to one.
    pub(crate) fn samples(&self, name: &str, position: &str) -> SampleSelector {
        let Layout { name_column, value_column, position_column } = &self.layout;
        let named = name_column.iter().map(|column| (column.clone(), name.to_owned()));
        let own = position_column.iter().map(|column| (column.clone(), position.to_owned()));
        let leaf = if name_column.is_some() { value_column.clone() } else { None };
        SampleSelector { leaf: leaf.unwrap_or_else(|| name.to_owned()), rows: named.chain(own).collect() }
    }

    /// The leaves that those samples need.
    pub(crate) fn leaves_of(&self, samples: &SampleSelector) -> Vec<String> {
        let clock = self.clock.column.iter();
        let rows = samples.rows.iter().map(|(column, _)| column);
        std::iter::once(&samples.leaf).chain(rows).chain(clock).cloned().collect()
    }

    /// As numbers, raw or brought to SI, and what was seen of them where all are wanted in SI; a null is NaN. Where a
    /// sample is a row, so may be those that are not wanted.
    ///
    /// # Errors
    /// When a leaf is missing, holds no numbers, or cannot be decoded.
    pub(crate) fn numbers(
        &self,
        samples: &SampleSelector,
        to_si: Option<SiConversion>,
        wanted: RowSelection<'_>,
    ) -> Result<(Vec<f64>, Option<ChannelStats>), Error> {
        // The footer may lie about the rows; what it claims is a hint, not a promise.
        let room = if samples.rows.is_empty() { self.rows().min(1 << 26) } else { 0 };
        let mut values = ColumnBuilder::with_capacity(room, to_si);
        if to_si.is_some() && wanted.is_all() {
            values = values.with_stats();
        }
        if samples.rows.is_empty() {
            // In a list a row is no sample.
            let wanted = if self.is_listed(&samples.leaf) { RowSelection::ALL } else { wanted };
            for file in &self.files {
                file.append_numbers(&samples.leaf, wanted.offset(values.len()), &mut values)?;
            }
            return Ok(values.finish());
        }
        self.each(samples, &samples.leaf, |array, wanted| match wanted {
            None => append(&samples.leaf, array, &mut values),
            Some(wanted) => append_where(&samples.leaf, array, wanted, &mut values),
        })?;
        Ok(values.finish())
    }

    /// Whether the headers of a leaf's pages claim what can be, and the rows that are declared.
    pub(crate) fn check_pages(&self, leaf: &str) -> Result<(), Error> {
        self.files.iter().try_for_each(|file| file.check_pages(leaf))
    }

    /// Hands over one leaf of the rows meant, batch by batch, with a mark for each that is.
    fn each(
        &self,
        samples: &SampleSelector,
        leaf: &str,
        mut take: impl FnMut(&ArrayRef, Option<&[bool]>) -> Result<(), ErrorKind>,
    ) -> Result<(), Error> {
        // The channel's own leaf comes along: a list in it gives a row its samples.
        let mut names: Vec<&str> = vec![leaf];
        names.extend(samples.rows.iter().map(|(column, _)| column.as_str()));
        let is_listed = |file: &LogFile| file.leaf(&samples.leaf).is_ok_and(|leaf| leaf.is_listed);
        for file in &self.files {
            let mut names = names.clone();
            if leaf != samples.leaf && is_listed(file) {
                names.push(&samples.leaf);
            }
            file.each_batch(&names, |arrays| {
                let wanted = wanted(&samples.rows, &arrays[1..])?;
                take(&arrays[0], wanted.as_deref())
            })?;
        }
        Ok(())
    }

    /// Every text that a column holds.
    fn texts(&self, column: &str) -> Result<BTreeSet<String>, Error> {
        let mut found = BTreeSet::new();
        for file in &self.files {
            file.each_batch(&[column], |arrays| {
                let text = as_text(column, &arrays[0])?;
                let mut last: Option<&str> = None;
                for value in text.as_string::<i32>().iter().flatten() {
                    if last != Some(value) && !found.contains(value) {
                        found.insert(value.to_owned());
                    }
                    last = Some(value);
                }
                Ok(())
            })?;
        }
        Ok(found)
    }

    /// One column as text that must not change; `None` when it is null throughout, or not there.
    pub(crate) fn constant(&self, column: &str, fact: &'static str) -> Result<Option<String>, Error> {
        let mut first: Option<String> = None;
        let mut row = 0_u64;
        for file in self.files.iter().filter(|file| file.has(column)) {
            file.each_batch(&[column], |arrays| {
                let text = as_text(column, &arrays[0])?;
                for value in text.as_string::<i32>() {
                    match (value, &first) {
                        (Some(value), Some(before)) if value != before => {
                            let (found, before) = (value.to_owned(), before.clone());
                            let column = column.to_owned();
                            return Err(ErrorKind::IdentityChanges { fact, column, row, found, before });
                        }
                        (Some(value), None) => first = Some(value.to_owned()),
                        _ => {}
                    }
                    row += 1;
                }
                Ok(())
            })?;
        }
        Ok(first)
    }

    /// The stamps of those samples, from the sheet's time column or the channel's own.
    ///
    /// # Errors
    /// When there is no clock, its unit is not known, or it cannot be read.
    pub(crate) fn stamps(&self, samples: &SampleSelector, own: Option<&str>) -> Result<Timestamps, Error> {
        let Some(column) = own.or(self.clock.column.as_deref()) else {
            let rate_hz = self.clock.rate_hz.ok_or_else(|| self.error(ErrorKind::NoClock))?;
            return Ok(Timestamps::uniform(self.count(samples)?, rate_hz));
        };
        let ticks = self.ticks(column)?;
        let lists = |file: &LogFile| {
            let listed = |name: &str| file.leaf(name).is_ok_and(|leaf| leaf.is_listed);
            listed(&samples.leaf) && !listed(column)
        };
        if samples.rows.is_empty() && self.files.iter().any(lists) {
            return self.burst_stamps(samples, column, ticks);
        }
        if samples.rows.is_empty()
            && ticks.is_real()
            && !self.is_listed(column)
            && !self.is_listed(&samples.leaf)
        {
            let mut reals = ColumnBuilder::with_capacity(self.rows().min(1 << 26), None);
            self.files
                .iter()
                .try_for_each(|file| file.append_numbers(column, RowSelection::ALL, &mut reals))?;
            let mut reader = TimestampParser::new(column, ticks, 0);
            reader.take_reals(reals.finish().0);
            return Ok(reader.stamps());
        }
        let mut reader = TimestampParser::new(column, ticks, self.rows());
        self.each(samples, column, |array, wanted| reader.append(array, wanted))?;
        Ok(reader.stamps())
    }

    /// Rows that each hold a burst of samples from their stamp on: a burst's samples are spread evenly to
    /// the next one, the last as the one before it.
    fn burst_stamps(
        &self,
        samples: &SampleSelector,
        column: &str,
        ticks: TickFormat,
    ) -> Result<Timestamps, Error> {
        let (mut reader, mut bursts) = (TimestampParser::new(column, ticks, self.rows()), Vec::new());
        for file in &self.files {
            file.each_flat(&[column, &samples.leaf], |_, flats| {
                reader.append(&flats[0].values, None)?;
                bursts.extend(flats[1].lengths.clone().unwrap_or_default());
                Ok(())
            })?;
        }
        let starts = reader.stamps();
        let (mut seconds, mut span_s) = (Vec::with_capacity(bursts.iter().sum()), f64::NAN);
        for (row, &samples) in bursts.iter().enumerate() {
            let start = starts.seconds[row];
            span_s = starts.seconds.get(row + 1).map_or(span_s, |next| next - start);
            let step_s = self.clock.rate_hz.map_or(span_s / samples.max(1) as f64, f64::recip);
            seconds.extend((0..samples).map(|k| start + step_s * k as f64));
        }
        Ok(Timestamps { seconds, ..starts })
    }

    /// How many samples those are.
    ///
    /// # Errors
    /// When they cannot be read.
    pub(crate) fn count(&self, samples: &SampleSelector) -> Result<usize, Error> {
        if samples.rows.is_empty() && !self.is_listed(&samples.leaf) {
            return Ok(self.rows());
        }
        let mut count = 0;
        self.each(samples, &samples.leaf, |array, wanted| {
            count += wanted.map_or(array.len(), |marks| marks.iter().filter(|m| **m).count());
            Ok(())
        })?;
        Ok(count)
    }

    /// What the numbers of a time column are.
    fn ticks(&self, column: &str) -> Result<TickFormat, Error> {
        let kind = self.files[0].kind(column)?.clone();
        let unit = match (&kind, self.clock.unit) {
            (DataType::Timestamp(unit, zone), _) => {
                return Ok(TickFormat::of_timestamp(*unit, zone.is_none()));
            }
            (DataType::Utf8 | DataType::LargeUtf8 | DataType::Utf8View, _) => return Ok(TickFormat::text()),
            (kind, None) => {
                let (column, found) = (column.to_owned(), kind.to_string());
                return Err(self.error(ErrorKind::TimeUnit { column, found }));
            }
            (_, Some(unit)) => unit,
        };
        let per_second = match unit {
            TimeUnit::Count => self.clock.rate_hz.ok_or_else(|| {
                let found = "a counter, and no `clock.rate_hz`".to_owned();
                self.error(ErrorKind::TimeUnit { column: column.to_owned(), found })
            })?,
            other => other.per_second().unwrap_or(1.0),
        };
        let is_whole = kind.is_integer();
        let origin = if self.clock.epoch == Epoch::Unix { TickEpoch::Utc } else { TickEpoch::Own };
        Ok(TickFormat { per_second, is_whole, is_text: false, origin, wraps_at: self.clock.wraps_at })
    }

    /// The known name nearest to a channel that is not here.
    pub(crate) fn lacks(&self, name: &str) -> Error {
        let names = self.names().unwrap_or_default();
        let nearest = nearest(name, names.iter().map(String::as_str)).map(str::to_owned);
        self.error(ErrorKind::ColumnMissing { column: name.to_owned(), nearest })
    }
}

/// Marks the rows that hold the wanted text in every column; none when all rows are meant.
fn wanted(rows: &[(String, String)], arrays: &[ArrayRef]) -> Result<Option<Vec<bool>>, ErrorKind> {
    if rows.is_empty() {
        return Ok(None);
    }
    let mut marks = vec![true; arrays.first().map_or(0, Array::len)];
    for ((column, wanted), array) in rows.iter().zip(arrays) {
        let text = as_text(column, array)?;
        let fits = text.as_string::<i32>().iter().map(|value| value == Some(wanted));
        marks.iter_mut().zip(fits).for_each(|(mark, fits)| *mark &= fits);
    }
    Ok(Some(marks))
}
