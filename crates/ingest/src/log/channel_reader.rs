//! One channel: from raw readings on its own clock to SI at the instants of the motor position.
//!
//! The motor position leads. A channel of the same rows and the same instants passes untouched; any
//! other is brought to the motor's instants by [`crate::time::resample`].

use std::borrow::Cow;

use crate::channel::buffer_pool;
use crate::channel::si_conversion::{Geometry, apply_to_all, to_si};
use crate::channel::stats::ChannelStats;
use crate::channel::turns::unwrap_turns;
use crate::error::{Error, ErrorKind};
use crate::log::row_table::{RowTable, SampleSelector};
use crate::mapping::column_pattern::ColumnPattern;
use crate::mapping::{ChannelMapping, ClockMapping, RawValue, Role};
use crate::parquet::row_selection::RowSelection;
use crate::time::clock::{self, BREAK_STEPS, TimeBase, Timestamps};
use crate::time::resample::{Interpolation, TimeSeries, decimated_rows, interpolate_at};

/// The least share of samples that a redundant channel must hold to be called alive.
const ALIVE_SHARE: f64 = 0.5;

/// A channel in SI.
#[derive(Debug)]
pub(crate) struct Channel {
    pub(crate) values: Vec<f64>,
    /// Statistics gathered while the channel was decoded; `None` if the values changed since.
    pub(crate) seen: Option<ChannelStats>,
    /// One turn of a wrapped sensor, m at the screw.
    pub(crate) turn_m: Option<f64>,
    /// Its column, where a log has one.
    pub(crate) column: Option<String>,
    /// Whether the column is not the first of redundant ones.
    pub(crate) is_alternative: bool,
    /// Samples that no condition leaves: NaN.
    pub(crate) excluded: usize,
}

impl Channel {
    /// Whether the channel can serve: at least half of the samples that conditions leave are there, and it moves.
    pub(crate) fn is_alive(&self) -> bool {
        let needed = (ALIVE_SHARE * (self.values.len() - self.excluded) as f64).ceil() as usize;
        let present = || self.values.iter().copied().filter(|v| v.is_finite());
        let first = present().next();
        present().take(needed).count() == needed && present().any(|v| Some(v) != first)
    }
}

impl From<Vec<f64>> for Channel {
    fn from(values: Vec<f64>) -> Self {
        Self { values, seen: None, turn_m: None, column: None, is_alternative: false, excluded: 0 }
    }
}

/// How the samples of a channel lie in time.
#[derive(Debug)]
pub(crate) struct ChannelSampling<'s> {
    pub(crate) table: &'s RowTable,
    pub(crate) map: &'s ChannelMapping,
    pub(crate) samples: SampleSelector,
    pub(crate) time_column: Option<String>,
    valid: Option<SampleSelector>,
    /// Rows between samples where the channel is slower than its rows; else 1.
    every: usize,
    /// Its rows on one clock.
    pub(crate) base: TimeBase,
}

impl<'s> ChannelSampling<'s> {
    /// A channel of a position, whose clock is not read yet.
    pub(crate) fn new(table: &'s RowTable, map: &'s ChannelMapping, name: &str, position: &str) -> Self {
        let named = |column: &String| ColumnPattern::new(column).column_for(position);
        Self {
            table,
            map,
            samples: table.samples(name, position),
            time_column: map.time_column.as_ref().map(named),
            valid: map.valid_column.as_ref().map(|column| table.samples(&named(column), position)),
            every: 1,
            base: clock::uniform(0, 1.0),
        }
    }

    /// The same with its rows on one clock.
    pub(crate) fn with_clock(mut self) -> Result<Self, Error> {
        (self.base, _) = self.base_of()?;
        self.every = self.rows_between();
        Ok(self)
    }

    /// All that the instants of its samples depend on: channels of one log that agree in it share them.
    pub(crate) fn clock_key(&self) -> String {
        let SampleSelector { leaf, rows } = &self.samples;
        let listed_leaf = self.table.is_listed(leaf).then_some(leaf);
        let ChannelMapping { group, rate_hz, .. } = self.map;
        format!("{:?}", (group, listed_leaf, rows, &self.time_column, self.map.shift_s(), rate_hz))
    }

    /// Whether the pages of its column hold the rows that are declared, where a row is a sample.
    pub(crate) fn check_rows(&self) -> Result<(), Error> {
        let SampleSelector { leaf, rows } = &self.samples;
        let mut files = self.table.files.iter().filter(|_| rows.is_empty());
        files.try_for_each(|file| file.check_pages(leaf))
    }

    /// The column of the channel.
    pub(crate) fn column(&self) -> &str {
        self.samples.rows.first().map_or(&self.samples.leaf, |(_, name)| name)
    }

    /// Whether its rows are those of another channel.
    fn shares_rows(&self, other: &Self) -> bool {
        std::ptr::eq(self.table, other.table)
            && self.samples.rows == other.samples.rows
            && self.time_column == other.time_column
    }

    /// Whether its rows hold lists of another length than those of another channel, which `error` found: its samples have
    /// instants of their own, which begin with the stamp of the row.
    fn has_own_list(&self, other: &Self, error: &Error) -> Result<bool, Error> {
        let own = &self.samples.leaf;
        if !matches!(*error.kind, ErrorKind::RowCount { .. }) || !self.table.is_listed(own) {
            return Ok(false);
        }
        if self.time_column.is_some() || self.table.clock.column.is_some() {
            return Ok(true);
        }
        let (column, other) = (own.clone(), other.samples.leaf.clone());
        Err(self.table.error(ErrorKind::ListLengths { column, other }))
    }

    fn is_apart(&self) -> bool {
        self.time_column.is_some() || self.table.layout.name_column.is_some()
    }

    /// A channel with rows of its own has a rate of its own.
    fn clock(&self) -> Cow<'s, ClockMapping> {
        if !self.is_apart() || self.table.clock.rate_hz == self.map.rate_hz {
            return Cow::Borrowed(&self.table.clock);
        }
        let shared = if self.time_column.is_some() { None } else { self.table.clock.rate_hz };
        Cow::Owned(ClockMapping { rate_hz: self.map.rate_hz.or(shared), ..self.table.clock.clone() })
    }

    /// The clock of its rows, with their stamps where it is its own. That of a table's own rows is read once for all its
    /// channels.
    fn base_of(&self) -> Result<(TimeBase, Option<Timestamps>), Error> {
        let of_table = self.time_column.is_none()
            && self.samples.rows.is_empty()
            && matches!(self.clock(), Cow::Borrowed(_))
            && !self.table.is_listed(&self.samples.leaf);
        if let Some(known) = self.table.base.get().filter(|_| of_table) {
            return Ok((known.clone(), None));
        }
        let (stamps, base) = self.read_base()?;
        if !of_table {
            return Ok((base, stamps));
        }
        buffer_pool::release(stamps.map(|stamps| stamps.seconds).unwrap_or_default());
        Ok((self.table.base.get_or_init(|| base).clone(), None))
    }

    fn read_base(&self) -> Result<(Option<Timestamps>, TimeBase), Error> {
        let clock = self.clock();
        if let (None, None, Some(rate_hz), true) =
            (&clock.column, &self.time_column, clock.rate_hz, self.samples.rows.is_empty())
        {
            let rows = self.table.count(&self.samples)?;
            return Ok((None, clock::uniform(rows, rate_hz)));
        }
        let mut stamps = self.table.stamps(&self.samples, self.time_column.as_deref())?;
        let base = clock::build_time_base(&mut stamps, &clock).map_err(|f| self.table.error(f))?;
        Ok((Some(stamps), base))
    }

    fn rows_between(&self) -> usize {
        match self.map.rate_hz {
            Some(rate_hz) if !self.is_apart() => {
                ((self.base.step_s * rate_hz).recip().round() as usize).max(1)
            }
            _ => 1,
        }
    }

    /// The stamps of the rows that count, which are read where they are not `known`, and their instants, shifted to when the
    /// channel was true.
    fn instants(&self, known: Option<Timestamps>) -> Result<(Timestamps, Vec<f64>), Error> {
        let stamps = if known.is_some() { known } else { self.read_base()?.0 };
        let even = || Timestamps::uniform(self.base.rows, self.base.step_s.recip());
        let stamps = stamps.unwrap_or_else(even);
        let mut instants = self.base.keep(stamps.seconds);
        instants.iter_mut().for_each(|t| *t += self.map.shift_s());
        Ok((Timestamps { seconds: Vec::new(), ..stamps }, instants))
    }

    /// The channel in SI at its own rows; those that are not wanted may be missing.
    fn readings(&self, geometry: Geometry, wanted: RowSelection<'_>) -> Result<Channel, Error> {
        let map = self.map;
        let mut si = to_si(self.column(), map, geometry).map_err(|f| self.table.error(f))?;
        if !map.ignore_metadata && self.table.layout.name_column.is_none() {
            let (scale, offset) = self.table.scale_and_offset(&self.samples.leaf, map)?;
            si = si.with_line(scale, offset);
        }
        let is_text = !map.texts.is_empty();
        let is_mended = is_text || !map.missing.is_empty() || self.valid.is_some() || map.wraps_at.is_some();
        if !is_mended {
            // Rows that were put in order are not those of the file.
            let wanted = if self.base.kept.is_none() { wanted } else { None };
            let (values, seen) = self.table.numbers(&self.samples, Some(si), wanted)?;
            self.same_count(values.len(), self.column())?;
            let seen = seen.filter(|_| self.base.kept.is_none());
            return Ok(Channel { seen, ..self.base.keep(values).into() });
        }
        let read = if is_text {
            self.table.matches(&self.samples, &map.texts)?
        } else {
            self.table.numbers(&self.samples, None, None)?.0
        };
        self.same_count(read.len(), self.column())?;
        let mut values = self.base.keep(read);
        if !map.missing.is_empty() {
            values.iter_mut().filter(|v| map.missing.contains(v)).for_each(|v| *v = f64::NAN);
        }
        if let Some(valid) = &self.valid {
            let marks = match map.status_bits() {
                Some((set, clear)) => self.table.bit_marks(valid, set, clear)?,
                None => self.table.matches(valid, &map.valid_values)?,
            };
            self.same_count(marks.len(), &valid.leaf)?;
            let is_bad = |mark: f64| !RawValue::Truth(true).is(mark);
            let marked = values.iter_mut().zip(self.base.keep(marks));
            marked.filter(|(_, mark)| is_bad(*mark)).for_each(|(value, _)| *value = f64::NAN);
        }
        if let Some(turn) = map.wraps_at {
            unwrap_turns(&mut values, turn);
        }
        apply_to_all(si, &mut values);
        Ok(Channel { turn_m: map.wraps_at.map(|turn| si.length(turn)), ..values.into() })
    }

    fn same_count(&self, found: usize, column: &str) -> Result<(), Error> {
        if found == self.base.rows {
            return Ok(());
        }
        let (column, found, declared) = (column.to_owned(), found as u64, self.base.rows as u64);
        Err(self.table.error(ErrorKind::RowCount { column, found, declared }))
    }

    /// The channel in SI at every row of its own that counts; those that are not wanted may be missing.
    pub(crate) fn own(&self, geometry: Geometry, wanted: RowSelection<'_>) -> Result<Channel, Error> {
        if self.every == 1 {
            return self.readings(geometry, wanted);
        }
        let read = self.readings(geometry, None)?;
        let (_, instants) = self.instants(None)?;
        let values = self.placed(&instants, &read.values, &instants, Interpolation::Line);
        Ok(Channel { values, seen: None, ..read })
    }

    /// Its values, sampled at instants of its own, at others; where it is slower than its rows, its own samples count.
    fn placed(&self, own_s: &[f64], values: &[f64], at_s: &[f64], between: Interpolation) -> Vec<f64> {
        let rows = decimated_rows(values, self.every).into_iter();
        let (own_s, values): (Vec<_>, Vec<_>) = rows.map(|i| (own_s[i as usize], values[i as usize])).unzip();
        let step_s = self.base.step_s * self.every as f64;
        interpolate_at(TimeSeries { at_s: &own_s, values: &values, step_s }, at_s, between)
    }
}

/// Reads a channel, whose clock is not read yet, in SI at the instants of the motor position `master`; those that are not
/// wanted may be missing.
pub(crate) fn follow(
    master: &ChannelSampling<'_>,
    mut own: ChannelSampling<'_>,
    role: Role,
    geometry: Geometry,
    wanted: RowSelection<'_>,
) -> Result<Channel, Error> {
    let shared = own.shares_rows(master);
    let mut stamps = None;
    if shared {
        own.base = master.base.clone();
    } else {
        (own.base, stamps) = own.base_of()?;
    }
    own.every = own.rows_between();
    let is_slow_load = role == Role::Load && own.every > 1;
    // A nanosecond is no shift.
    let is_shifted = (own.map.shift_s() - master.map.shift_s()).abs() >= 1e-9;
    let is_direct = shared && !is_shifted && (own.every == 1 || is_slow_load);
    let read = own.readings(geometry, if is_direct { wanted } else { None });
    let Channel { values, turn_m, .. } = match read {
        Ok(read) if is_direct => return Ok(read),
        Err(error) if shared && own.has_own_list(master, &error)? => {
            (own.base, stamps) = own.base_of()?;
            own.readings(geometry, None)?
        }
        read => read?,
    };
    let (stamps, own_s) = own.instants(stamps)?;
    let (lead, mut at_s) = master.instants(None)?;
    let apart_s = lead.origin.since(stamps.origin).ok_or_else(|| {
        own.table.error(ErrorKind::ClocksDiffer { column: stamps.column.clone(), other: lead.column.clone() })
    })?;
    at_s.iter_mut().for_each(|t| *t += apart_s);
    let is_slow = own.base.step_s * own.every as f64 > BREAK_STEPS * master.base.step_s;
    let between = if role == Role::Load && is_slow { Interpolation::First } else { Interpolation::Line };
    let values = own.placed(&own_s, &values, &at_s, between);
    Ok(Channel { turn_m, ..values.into() })
}
