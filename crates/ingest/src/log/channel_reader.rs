//! One channel: from raw readings on its own clock to SI at the instants of the motor position.
//!
//! The motor position leads. A channel of the same rows and the same instants passes untouched; any
//! other is brought to the motor's instants by [`crate::time::resample`].

use std::borrow::Cow;
use std::cell::OnceCell;

use crate::channel::buffer_pool;
use crate::channel::missing_code::missing_code;
use crate::channel::si_conversion::{Geometry, apply_to_all, to_si};
use crate::channel::stats::ChannelStats;
use crate::channel::turns::unwrap_turns;
use crate::error::{self, Error, Fault};
use crate::log::identity::in_zone;
use crate::log::row_table::{RowTable, SampleSelector};
use crate::mapping::column_pattern::column_for;
use crate::mapping::{ChannelMapping, ClockMapping, RawValue, Role};
use crate::parquet::column_numbers::RowSelection;
use crate::time::clock::{self, BREAK_STEPS, TimeBase, Timestamps};
use crate::time::resample::{Interpolation, decimated_rows, interpolate_at};

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

/// How the samples of a channel lie in their table and in time.
#[derive(Debug, Clone)]
pub(crate) struct ChannelSampling<'s> {
    pub(crate) table: &'s RowTable,
    pub(crate) map: &'s ChannelMapping,
    pub(crate) samples: SampleSelector,
    pub(crate) time_column: Option<String>,
    valid: Option<SampleSelector>,
    /// Its rows on one clock.
    pub(crate) base: TimeBase,
    /// The stamps of the rows that count, once they were read.
    stamps: OnceCell<Timestamps>,
}

impl<'s> ChannelSampling<'s> {
    /// A channel of a position, whose clock is not read yet.
    pub(crate) fn new(table: &'s RowTable, map: &'s ChannelMapping, position: &str) -> Self {
        let named = |column: &String| column_for(column, position);
        Self {
            table,
            map,
            samples: table.samples(&named(&map.column), position),
            time_column: map.time_column.as_ref().map(named),
            valid: map.valid_column.as_ref().map(|column| table.samples(&named(column), position)),
            base: clock::uniform(0, 1.0),
            stamps: OnceCell::new(),
        }
    }

    /// The samples that are read for it: its own, the marks of the valid ones, and its own stamps, which lie in its rows.
    pub(crate) fn selectors(&self) -> impl Iterator<Item = SampleSelector> {
        let time = self.time_column.iter();
        let stamps = time.map(|time| SampleSelector { leaf: time.clone(), rows: self.samples.rows.clone() });
        std::iter::once(self.samples.clone()).chain(self.valid.clone()).chain(stamps)
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
        files.try_for_each(|file| file.has_page_checksums(&[leaf]).map(drop))
    }

    /// The name of the channel in its table.
    pub(crate) fn column(&self) -> &str {
        let rows = self.samples.rows.first().filter(|_| self.table.layout.name_column.is_some());
        rows.map_or(&self.samples.leaf, |(_, name)| name)
    }

    fn shares_rows(&self, other: &Self) -> bool {
        std::ptr::eq(self.table, other.table)
            && self.samples.rows == other.samples.rows
            && self.time_column == other.time_column
    }

    /// Whether its rows hold lists of another length than those of another channel, which `error` found: its samples have
    /// instants of their own, which begin with the stamp of the row.
    fn has_own_list(&self, other: &Self, error: &Error) -> Result<bool, Error> {
        let own = &self.samples.leaf;
        let is_other = error.is_row_count() && *own != other.samples.leaf;
        if !is_other || !self.table.is_listed(own) {
            return Ok(false);
        }
        if self.time_column.is_some() || self.table.clock.column.is_some() {
            return Ok(true);
        }
        Err(self.table.error(error::list_lengths(own, &other.samples.leaf)))
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

    /// The same with the clock of its rows. That of a table's own rows is read once for all its channels.
    pub(crate) fn with_clock(mut self) -> Result<Self, Error> {
        let of_table = self.time_column.is_none()
            && self.samples.rows.is_empty()
            && matches!(self.clock(), Cow::Borrowed(_))
            && !self.table.is_listed(&self.samples.leaf);
        let known = self.table.base.get().filter(|_| of_table);
        self.base = if let Some(known) = known {
            known.clone()
        } else {
            let (stamps, base) = self.read_base()?;
            if of_table {
                buffer_pool::release(stamps.map(|stamps| stamps.seconds).unwrap_or_default());
                self.table.base.get_or_init(|| base).clone()
            } else {
                self.stamps = stamps.map(|stamps| base.keep_stamps(stamps).into()).unwrap_or_default();
                base
            }
        };
        Ok(self)
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
        let base = clock::build_time_base(&mut stamps, &clock);
        let base = base.map_err(|fault| self.table.error(fault.column(&stamps.column)))?;
        Ok((Some(stamps), base))
    }

    /// Rows between samples where the channel is slower than its rows; else 1, as where no whole number of rows fits: every
    /// n-th row would hold older and older samples.
    fn rows_between(&self) -> usize {
        let Some(rate_hz) = self.map.rate_hz.filter(|_| !self.is_apart()) else { return 1 };
        let rows = (self.base.step_s * rate_hz).recip();
        if (rows - rows.round()).abs() < 0.02 * rows { (rows.round() as usize).max(1) } else { 1 }
    }

    /// The stamps of the rows that count.
    fn stamps(&self) -> Result<&Timestamps, Error> {
        if let Some(known) = self.stamps.get() {
            return Ok(known);
        }
        let even = || Timestamps::uniform(self.base.rows, self.base.step_s.recip());
        let stamps = self.read_base()?.0.unwrap_or_else(even);
        Ok(self.stamps.get_or_init(|| self.base.keep_stamps(stamps)))
    }

    /// The channel in SI at its own rows; those that are not wanted may be missing.
    fn readings(&self, geometry: Geometry, wanted: RowSelection<'_>) -> Result<Channel, Error> {
        if let Some(values) = &self.map.condition {
            let read = self.table.raw_values(&self.samples, values)?;
            self.same_count(read.len(), self.column())?;
            return Ok(self.base.keep(read).into());
        }
        let read = self.converted(geometry, wanted)?;
        let Some((at, share)) = missing_code(&read.values) else { return Ok(read) };
        let raw = self.base.keep(self.table.numbers(&self.samples, None, None)?.0)[at];
        let (column, percent) = (self.column(), 100.0 * share);
        let message = format!(
            "column `{column}` leaps to {raw} and back in {percent:.1} % of its changes: a code for missing values"
        );
        let hint = format!("list it: `missing = [{raw}]` in the channel's table of the configuration");
        Err(self.table.error(Fault::new("missing_code", message, hint).column(column)))
    }

    fn converted(&self, geometry: Geometry, wanted: RowSelection<'_>) -> Result<Channel, Error> {
        let map = self.map;
        let mut si = to_si(self.column(), map, geometry).map_err(|f| self.table.error(f))?;
        if !map.ignore_metadata && self.table.layout.name_column.is_none() {
            let (scale, offset) = self.table.scale_and_offset(&self.samples.leaf, map)?;
            si = si.with_line(scale, offset);
        }
        let is_mended = !map.missing.is_empty() || self.valid.is_some() || map.wraps_at.is_some();
        if !is_mended {
            // Rows that were put in order are not those of the file.
            let wanted = if self.base.kept.is_none() { wanted } else { None };
            let (values, seen) = self.table.numbers(&self.samples, Some(si), wanted)?;
            self.same_count(values.len(), self.column())?;
            let seen = seen.filter(|_| self.base.kept.is_none());
            return Ok(Channel { seen, ..self.base.keep(values).into() });
        }
        let read = self.table.numbers(&self.samples, None, None)?.0;
        self.same_count(read.len(), self.column())?;
        let mut values = self.base.keep(read);
        if !map.missing.is_empty() {
            values.iter_mut().filter(|v| map.missing.contains(v)).for_each(|v| *v = f64::NAN);
        }
        if let Some(valid) = &self.valid {
            let (marks, wanted) = match map.status_bits() {
                Some((set, clear)) => {
                    (self.table.bit_marks(valid, set, clear)?, &[RawValue::Truth(true)][..])
                }
                None => (self.table.raw_values(valid, &map.valid_values)?, &*map.valid_values),
            };
            self.same_count(marks.len(), &valid.leaf)?;
            let marked = values.iter_mut().zip(self.base.keep(marks));
            let bad = marked.filter(|(_, mark)| !RawValue::is_one_of(wanted, *mark));
            bad.for_each(|(value, _)| *value = f64::NAN);
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
        Err(self.table.error(error::row_count(column, found, self.base.rows)))
    }

    /// Reads the channel in SI at the instants of the motor position `master`, which may be the channel itself; those that
    /// are not wanted may be missing.
    pub(crate) fn follow(
        mut self,
        master: &ChannelSampling<'_>,
        role: Role,
        geometry: Geometry,
        wanted: RowSelection<'_>,
    ) -> Result<Channel, Error> {
        let mut shared = self.shares_rows(master);
        if shared {
            self.base = master.base.clone();
        } else {
            self = self.with_clock()?;
        }
        let is_own_rate = self.rows_between() == 1;
        // A nanosecond is no shift.
        let is_shifted = (self.map.shift_s() - master.map.shift_s()).abs() >= 1e-9;
        let is_direct = shared && !is_shifted && (is_own_rate || role == Role::Load);
        let read = match self.readings(geometry, wanted.filter(|_| is_direct)) {
            Ok(read) if is_direct => return Ok(read),
            Err(error) if shared && self.has_own_list(master, &error)? => {
                shared = false;
                self = self.with_clock()?;
                self.readings(geometry, None)?
            }
            read => read?,
        };
        let lead = master.stamps()?;
        let stamps = if shared { lead } else { self.stamps()? };
        let apart_s = lead.origin.since(stamps.origin).or_else(|| {
            // One is an instant, and the other a local time.
            let [lead, own] = [(lead, master), (stamps, &self)]
                .map(|(stamps, channel)| in_zone(stamps.origin, channel.table.time_zone.as_deref()));
            lead.since(own)
        });
        let apart_s = apart_s.ok_or_else(|| {
            let (column, other) = (&stamps.column, &lead.column);
            let message = format!("the clocks `{column}` and `{other}` cannot be brought together");
            let hint = "both must be instants, or both numbers from the same zero: see `clock.epoch`, and `identity.time_zone` for local times";
            self.table.error(Fault::new("clocks_differ", message, hint).column(column))
        })?;
        let at_s: Vec<f64> = lead.seconds.iter().map(|t| t + master.map.shift_s() + apart_s).collect();
        // Where it is slower than its rows, its own samples count.
        let every = self.rows_between();
        let rows = decimated_rows(&read.values, every).into_iter().map(|row| row as usize);
        let own = rows.map(|row| (stamps.seconds[row] + self.map.shift_s(), read.values[row]));
        let (own_s, values): (Vec<_>, Vec<_>) = own.unzip();
        let step_s = self.base.step_s * every as f64;
        let is_slow = step_s > BREAK_STEPS * master.base.step_s;
        let between = if role == Role::Load && is_slow { Interpolation::First } else { Interpolation::Line };
        Ok(Channel { turn_m: read.turn_m, ..interpolate_at(&own_s, &values, step_s, &at_s, between).into() })
    }
}
