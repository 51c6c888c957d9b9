//! Files of one kind, read as one table: what their columns are called, and the samples of one of them.
//!
//! A flight may come in pieces (several files, one after the other) and in several layouts: a row for
//! each moment, for each actuator at each moment, or for each channel at each moment. After this room
//! there are only names of channels and lists of samples.

use std::collections::BTreeSet;
use std::sync::OnceLock;

use arrow::array::{Array, ArrayRef, AsArray, PrimitiveArray};
use arrow::compute::cast;
use arrow::datatypes::{DataType, Int64Type, TimeUnit as ArrowTimeUnit};
use jiff::Timestamp;

use crate::clock::{Origin, Stamps, Timeline};
use crate::error::{Error, Fault};
use crate::file::LogFile;
use crate::growing::Growing;
use crate::numbers::{append, append_where, wrong_type};
use crate::pattern::nearest;
use crate::scan::Scan;
use crate::schema::{ClockMapping, Epoch, Layout};
use crate::screw::ToSi;
use crate::spare;
use crate::unit::TimeUnit;
use crate::wanted::Wanted;

/// The files of one kind that belong to one flight.
#[derive(Debug)]
pub(crate) struct Sheet {
    pub(crate) files: Vec<LogFile>,
    pub(crate) clock: ClockMapping,
    pub(crate) layout: Layout,
    /// The clock of its rows, once it was read.
    pub(crate) line: OnceLock<Timeline>,
}

/// Which samples are meant: the leaf that holds them, and the rows in which it does.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Samples {
    /// The leaf.
    pub(crate) leaf: String,
    /// Columns and the text they must hold.
    pub(crate) rows: Vec<(String, String)>,
}

impl Sheet {
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

    /// A fault of the whole sheet is told of its first file.
    pub(crate) fn error(&self, fault: Fault) -> Error {
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

    /// The actuators that rows are said to belong to, where rows say so.
    ///
    /// # Errors
    /// When that column cannot be read.
    pub(crate) fn row_positions(&self) -> Result<Option<BTreeSet<String>>, Error> {
        self.layout.position_column.as_deref().map(|column| self.texts(column)).transpose()
    }

    /// The samples of a channel, of one actuator where rows belong to one.
    pub(crate) fn samples(&self, name: &str, position: &str) -> Samples {
        let Layout { name_column, value_column, position_column } = &self.layout;
        let named = name_column.iter().map(|column| (column.clone(), name.to_owned()));
        let own = position_column.iter().map(|column| (column.clone(), position.to_owned()));
        let leaf = if name_column.is_some() { value_column.clone() } else { None };
        Samples { leaf: leaf.unwrap_or_else(|| name.to_owned()), rows: named.chain(own).collect() }
    }

    /// The leaves that those samples need.
    pub(crate) fn leaves_of(&self, samples: &Samples) -> Vec<String> {
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
        samples: &Samples,
        to_si: Option<ToSi>,
        wanted: Wanted<'_>,
    ) -> Result<(Vec<f64>, Option<Scan>), Error> {
        // The footer may lie about the rows; what it claims is a hint, not a promise.
        let room = if samples.rows.is_empty() { self.rows().min(1 << 26) } else { 0 };
        let mut values = Growing::with_room(room, to_si);
        if to_si.is_some() && wanted.are_all() {
            values = values.looked_at();
        }
        if samples.rows.is_empty() {
            // In a list a row is no sample.
            let wanted = if self.is_listed(&samples.leaf) { Wanted::ALL } else { wanted };
            for file in &self.files {
                file.append_numbers(&samples.leaf, wanted.from(values.len()), &mut values)?;
            }
            return Ok(values.whole());
        }
        self.each(samples, &samples.leaf, |array, wanted| match wanted {
            None => append(&samples.leaf, array, &mut values),
            Some(wanted) => append_where(&samples.leaf, array, wanted, &mut values),
        })?;
        Ok(values.whole())
    }

    /// Whether the headers of a leaf's pages claim what can be, and the rows that are declared.
    pub(crate) fn check_pages(&self, leaf: &str) -> Result<(), Error> {
        self.files.iter().try_for_each(|file| file.check_pages(leaf))
    }

    /// Hands over one leaf of the rows meant, batch by batch, with a mark for each that is.
    fn each(
        &self,
        samples: &Samples,
        leaf: &str,
        mut take: impl FnMut(&ArrayRef, Option<&[bool]>) -> Result<(), Fault>,
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
                let text = text(column, &arrays[0])?;
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
                let text = text(column, &arrays[0])?;
                for value in text.as_string::<i32>() {
                    match (value, &first) {
                        (Some(value), Some(before)) if value != before => {
                            let (found, before) = (value.to_owned(), before.clone());
                            let column = column.to_owned();
                            return Err(Fault::IdentityChanges { fact, column, row, found, before });
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
    pub(crate) fn stamps(&self, samples: &Samples, own: Option<&str>) -> Result<Stamps, Error> {
        let Some(column) = own.or(self.clock.column.as_deref()) else {
            let rate_hz = self.clock.rate_hz.ok_or_else(|| self.error(Fault::NoClock))?;
            return Ok(Stamps::even(self.count(samples)?, rate_hz));
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
            let mut reals = Growing::with_room(self.rows().min(1 << 26), None);
            self.files.iter().try_for_each(|file| file.append_numbers(column, Wanted::ALL, &mut reals))?;
            let mut reader = Reader::new(column, ticks, 0);
            reader.take_reals(reals.whole().0);
            return Ok(reader.stamps());
        }
        let mut reader = Reader::new(column, ticks, self.rows());
        self.each(samples, column, |array, wanted| reader.append(array, wanted))?;
        Ok(reader.stamps())
    }

    /// Rows that each hold a burst of samples from their stamp on: a burst's samples are spread evenly to
    /// the next one, the last as the one before it.
    fn burst_stamps(&self, samples: &Samples, column: &str, ticks: Ticks) -> Result<Stamps, Error> {
        let (mut reader, mut bursts) = (Reader::new(column, ticks, self.rows()), Vec::new());
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
        Ok(Stamps { seconds, ..starts })
    }

    /// How many samples those are.
    ///
    /// # Errors
    /// When they cannot be read.
    pub(crate) fn count(&self, samples: &Samples) -> Result<usize, Error> {
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
    fn ticks(&self, column: &str) -> Result<Ticks, Error> {
        let kind = self.files[0].kind(column)?.clone();
        let unit = match (&kind, self.clock.unit) {
            (DataType::Timestamp(unit, zone), _) => return Ok(Ticks::of_timestamp(*unit, zone.is_none())),
            (DataType::Utf8 | DataType::LargeUtf8 | DataType::Utf8View, _) => return Ok(Ticks::text()),
            (kind, None) => {
                let (column, found) = (column.to_owned(), kind.to_string());
                return Err(self.error(Fault::TimeUnit { column, found }));
            }
            (_, Some(unit)) => unit,
        };
        let per_second = match unit {
            TimeUnit::Count => self.clock.rate_hz.ok_or_else(|| {
                let found = "a counter, and no `clock.rate_hz`".to_owned();
                self.error(Fault::TimeUnit { column: column.to_owned(), found })
            })?,
            other => other.per_second().unwrap_or(1.0),
        };
        let is_whole = kind.is_integer();
        let origin = if self.clock.epoch == Epoch::Unix { Zero::Utc } else { Zero::Own };
        Ok(Ticks { per_second, is_whole, is_text: false, origin, wraps_at: self.clock.wraps_at })
    }

    /// The known name nearest to a channel that is not here.
    pub(crate) fn lacks(&self, name: &str) -> Error {
        let names = self.names().unwrap_or_default();
        let nearest = nearest(name, names.iter().map(String::as_str)).map(str::to_owned);
        self.error(Fault::ColumnMissing { column: name.to_owned(), nearest })
    }
}

/// Marks the rows that hold the wanted text in every column; none when all rows are meant.
fn wanted(rows: &[(String, String)], arrays: &[ArrayRef]) -> Result<Option<Vec<bool>>, Fault> {
    if rows.is_empty() {
        return Ok(None);
    }
    let mut marks = vec![true; arrays.first().map_or(0, Array::len)];
    for ((column, wanted), array) in rows.iter().zip(arrays) {
        let text = text(column, array)?;
        let fits = text.as_string::<i32>().iter().map(|value| value == Some(wanted));
        marks.iter_mut().zip(fits).for_each(|(mark, fits)| *mark &= fits);
    }
    Ok(Some(marks))
}

fn text(column: &str, array: &ArrayRef) -> Result<ArrayRef, Fault> {
    cast(array, &DataType::Utf8).map_err(|_| wrong_type(column, array, "text or numbers"))
}

/// What zero means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Zero {
    Own,
    Utc,
    Local,
}

/// What the numbers of a time column are.
#[derive(Debug, Clone, Copy)]
struct Ticks {
    per_second: f64,
    is_whole: bool,
    is_text: bool,
    origin: Zero,
    wraps_at: Option<f64>,
}

impl Ticks {
    fn of_timestamp(unit: ArrowTimeUnit, is_local: bool) -> Self {
        let per_second = match unit {
            ArrowTimeUnit::Second => 1.0,
            ArrowTimeUnit::Millisecond => 1e3,
            ArrowTimeUnit::Microsecond => 1e6,
            ArrowTimeUnit::Nanosecond => 1e9,
        };
        let origin = if is_local { Zero::Local } else { Zero::Utc };
        Self { per_second, is_whole: true, is_text: false, origin, wraps_at: None }
    }

    /// Whether they are numbers with a fraction.
    fn is_real(self) -> bool {
        !self.is_text && !self.is_whole
    }

    /// ISO 8601 text; an offset in it is taken, and without one the time is local.
    fn text() -> Self {
        Self { per_second: 1e9, is_whole: true, is_text: true, origin: Zero::Local, wraps_at: None }
    }
}

/// Turns a time column into seconds since its first stamp: ticks are subtracted before they become
/// seconds, so that counts since 1970 lose nothing.
struct Reader<'a> {
    column: &'a str,
    ticks: Ticks,
    first: Option<First>,
    turns: f64,
    before: f64,
    seconds: Vec<f64>,
    is_zoned: bool,
}

#[derive(Clone, Copy)]
enum First {
    Whole(i64),
    Real(f64),
}

impl<'a> Reader<'a> {
    fn new(column: &'a str, ticks: Ticks, rows: usize) -> Self {
        let seconds = Vec::with_capacity(rows.min(1 << 26));
        Self { column, ticks, first: None, turns: 0.0, before: f64::NAN, seconds, is_zoned: false }
    }

    fn append(&mut self, array: &ArrayRef, wanted: Option<&[bool]>) -> Result<(), Fault> {
        let is_wanted = |row: usize| wanted.is_none_or(|marks| marks[row]);
        if self.ticks.is_text {
            let text = text(self.column, array)?;
            for (row, value) in text.as_string::<i32>().iter().enumerate().filter(|(row, _)| is_wanted(*row))
            {
                let tick = value.map(|value| self.parsed(value, row)).transpose()?;
                self.push_whole(tick);
            }
        } else if self.ticks.is_whole {
            let whole =
                cast(array, &DataType::Int64).map_err(|_| wrong_type(self.column, array, "time stamps"))?;
            let whole: &PrimitiveArray<Int64Type> = whole.as_primitive();
            whole
                .iter()
                .enumerate()
                .filter(|(row, _)| is_wanted(*row))
                .for_each(|(_, tick)| self.push_whole(tick));
        } else {
            let mut reals = Vec::with_capacity(array.len());
            append(self.column, array, &mut reals)?;
            reals
                .iter()
                .enumerate()
                .filter(|(row, _)| is_wanted(*row))
                .for_each(|(_, &tick)| self.push_real(tick));
        }
        Ok(())
    }

    /// As [`Reader::append`], for all there is, in its place.
    fn take_reals(&mut self, mut reals: Vec<f64>) {
        if self.ticks.wraps_at.is_some() {
            reals.iter().for_each(|&tick| self.push_real(tick));
            return spare::give(reals);
        }
        let (begun, per_second) = (reals.iter().find(|tick| tick.is_finite()), self.ticks.per_second);
        let first = begun.map_or(f64::NAN, |&begun| self.first_real(begun));
        for tick in &mut reals {
            *tick = if tick.is_finite() { (*tick - first) / per_second } else { f64::NAN };
        }
        self.seconds = reals;
    }

    /// The first tick of all, which is this one if none came before.
    fn first_real(&mut self, tick: f64) -> f64 {
        match *self.first.get_or_insert(First::Real(tick)) {
            First::Real(first) => first,
            First::Whole(first) => first as f64,
        }
    }

    fn parsed(&mut self, value: &str, row: usize) -> Result<i64, Fault> {
        let value = value.trim();
        let instant = value.parse::<Timestamp>().inspect(|_| self.is_zoned = true).or_else(|_| {
            value
                .parse::<jiff::civil::DateTime>()
                .and_then(|local| jiff::tz::TimeZone::UTC.to_timestamp(local))
        });
        let tick = instant.ok().and_then(|t| i64::try_from(t.as_nanosecond()).ok());
        let found = || format!("`{value}` in row {row}");
        tick.ok_or_else(|| Fault::TimeUnit { column: self.column.to_owned(), found: found() })
    }

    fn push_whole(&mut self, tick: Option<i64>) {
        let Some(tick) = tick else { return self.seconds.push(f64::NAN) };
        let first = match *self.first.get_or_insert(First::Whole(tick)) {
            First::Whole(first) => first,
            First::Real(first) => first as i64,
        };
        self.push(tick.wrapping_sub(first) as f64);
    }

    fn push_real(&mut self, tick: f64) {
        if !tick.is_finite() {
            return self.seconds.push(f64::NAN);
        }
        let first = self.first_real(tick);
        self.push(tick - first);
    }

    /// A counter that starts again only ever goes on: a fall by more than half its range is a turn.
    fn push(&mut self, ticks: f64) {
        if let Some(range) = self.ticks.wraps_at {
            if ticks - self.before < -0.5 * range {
                self.turns += 1.0;
            }
            self.before = ticks;
            self.seconds.push((ticks + self.turns * range) / self.ticks.per_second);
        } else {
            self.seconds.push(ticks / self.ticks.per_second);
        }
    }

    fn stamps(self) -> Stamps {
        let instant = |whole: i64| {
            let nanoseconds = i128::from(whole) * (1e9 / self.ticks.per_second) as i128;
            Timestamp::from_nanosecond(nanoseconds).ok()
        };
        let real =
            |ticks: f64| Timestamp::from_nanosecond((ticks / self.ticks.per_second * 1e9) as i128).ok();
        let counted = match self.first {
            Some(First::Whole(first)) => first as f64 / self.ticks.per_second,
            Some(First::Real(first)) => first / self.ticks.per_second,
            None => 0.0,
        };
        let start = match self.first {
            Some(First::Whole(first)) => instant(first),
            Some(First::Real(first)) => real(first),
            None => None,
        };
        let zero = if self.is_zoned { Zero::Utc } else { self.ticks.origin };
        let origin = match (zero, start) {
            (Zero::Utc, Some(start)) => Origin::Utc(start),
            (Zero::Local, Some(start)) => Origin::Local(start),
            _ => Origin::Counted(counted),
        };
        Stamps { column: self.column.to_owned(), seconds: self.seconds, origin }
    }
}
