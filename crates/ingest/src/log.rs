//! One flight log: its identity, its actuators, and their channels in SI on one clock.

use std::collections::BTreeSet;
use std::ops::Range;
use std::path::Path;

use fleet::Position;

use crate::clock::{self, Timeline};
use crate::error::{Error, Fault};
use crate::identity::{self, Facts, Identity};
use crate::pattern::Pattern;
use crate::read::Columns;
use crate::schema::{ChannelMapping, Fact, Mapping};
use crate::unit::{Dimension, Unit};

/// A load is held over so many of its own steps, or so many seconds if that is more.
const HOLD_STEPS: usize = 4;
const HOLD_S: f64 = 0.2;

/// How far stamps may fall back by default, s.
const MAX_BACK_S: f64 = 1.0;

/// What brings a part's angles and torques to the screw axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Geometry {
    /// A part that pushes: x = θ·lead/2π (the paper's X₁ = θ·r/2π).
    Linear {
        /// Metres for a turn; needed only when a channel is an angle or a torque.
        lead_m_per_rev: Option<f64>,
    },
    /// A part that only turns: x = r·θ, F = T/r.
    Rotary {
        /// The radius at which the gap is stated, m.
        reference_radius_m: f64,
    },
}

impl Geometry {
    /// Metres at the screw axis for a radian, where it is known.
    pub fn metres_per_radian(self) -> Option<f64> {
        match self {
            Self::Linear { lead_m_per_rev } => lead_m_per_rev.map(|lead| lead / std::f64::consts::TAU),
            Self::Rotary { reference_radius_m } => Some(reference_radius_m),
        }
    }
}

/// The columns of one actuator in one log.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PositionColumns {
    /// Its place.
    pub position: Position,
    /// The columns that make it, as mapped: motor position, screw position, load, temperature.
    pub columns: [Option<String>; 4],
    /// Mapped columns that the log lacks, without which this actuator cannot be estimated.
    pub lacking: Vec<String>,
}

/// The channels of one actuator: SI, at the screw axis, on one clock.
#[derive(Debug, Clone, PartialEq)]
pub struct Actuator {
    /// Its place.
    pub position: Position,
    /// Step between samples, s.
    pub step_s: f64,
    /// Motor position X₁ brought to the screw axis, m; NaN where missing.
    pub motor_m: Vec<f64>,
    /// Relative position δX = X₂ − X₁, m; NaN where either is missing.
    pub dx_m: Vec<f64>,
    /// Load, N, held where it was recorded more slowly.
    pub load_n: Vec<f64>,
    /// Unbroken stretches with a load.
    pub segments: Vec<Range<usize>>,
    /// Mean temperature, °C.
    pub temperature_c: Option<f64>,
    /// Share of samples without δX.
    pub missing_share: f64,
}

/// An open log.
#[derive(Debug)]
pub struct Log<'m> {
    columns: Columns,
    mapping: &'m Mapping,
}

impl<'m> Log<'m> {
    /// Opens a log and reads its footer.
    ///
    /// # Errors
    /// When the file cannot be read, is empty, or is not whole Parquet.
    pub fn open(path: &Path, mapping: &'m Mapping) -> Result<Self, Error> {
        Ok(Self { columns: Columns::open(path)?, mapping })
    }

    /// Rows the footer declares.
    pub fn rows(&self) -> usize {
        self.columns.rows()
    }

    /// Names and types of all columns, for `check`.
    pub fn column_types(&self) -> Vec<(String, String)> {
        let kind =
            |name: &str| self.columns.data_type(name).map_or_else(|_| String::new(), ToString::to_string);
        self.columns.names().map(|name| (name.to_owned(), kind(name))).collect()
    }

    /// Which flight this is; `clock_start` stands in for a departure the log does not state.
    ///
    /// # Errors
    /// When tail or departure stand nowhere, cannot be read, or change within the log.
    pub fn identity(&self, timeline: &Timeline) -> Result<Identity, Error> {
        identity::read(&self.facts()?, &self.mapping.identity, timeline.start_utc)
            .map_err(|f| self.columns.error(f))
    }

    fn facts(&self) -> Result<Facts, Error> {
        let map = &self.mapping.identity;
        let mut facts: Facts = map.values.clone();
        if let Some(expression) = &map.path {
            let found = identity::from_path(self.columns.path(), expression);
            facts.extend(found.map_err(|f| self.columns.error(f))?);
        }
        for (fact, column) in &map.columns {
            // A column the log lacks may still be covered by metadata or path; what is missing in all is named later.
            if self.columns.has(column) {
                facts.extend(self.columns.constant(column, fact.as_str())?.map(|text| (*fact, text)));
            }
        }
        let stated = |(fact, key): (&Fact, &String)| Some((*fact, self.columns.metadata(key)?.to_owned()));
        facts.extend(map.metadata.iter().filter_map(stated));
        Ok(facts)
    }

    /// The actuators whose columns are here, in order of their names.
    ///
    /// `own` is the position of a log that holds one actuator and does not name it in its columns.
    ///
    /// # Errors
    /// [`Fault::NoPosition`] when no column fits; [`Fault::ColumnMissing`] or
    /// [`Fault::IdentityMissing`] in a log of one actuator.
    pub fn positions(&self, own: Option<&Position>) -> Result<Vec<PositionColumns>, Error> {
        let map = &self.mapping.channels;
        let needed = [&map.motor_position, &map.screw_position, &map.load];
        let open: Vec<Pattern<'_>> =
            needed.iter().map(|c| Pattern::new(&c.column)).filter(Pattern::is_open).collect();
        if open.is_empty() {
            return self.only_position(own);
        }
        let found: BTreeSet<&str> =
            open.iter().flat_map(|p| self.columns.names().filter_map(|name| p.position_in(name))).collect();
        let asked = |text: &&str| map.positions.is_empty() || map.positions.iter().any(|p| p == text);
        let named = found.into_iter().filter(asked).filter_map(|text| Position::new(text).ok());
        let all: Vec<PositionColumns> = named.map(|position| self.columns_of(position)).collect();
        if all.iter().any(|p| p.lacking.is_empty()) {
            return Ok(all);
        }
        let columns = self.columns.names().map(str::to_owned).collect();
        Err(self.columns.error(Fault::NoPosition { pattern: map.motor_position.column.clone(), columns }))
    }

    fn only_position(&self, own: Option<&Position>) -> Result<Vec<PositionColumns>, Error> {
        let Some(position) = own else {
            let looked = vec!["the names of columns (no `{position}` in them)".into()];
            return Err(self.columns.error(Fault::IdentityMissing { fact: "position", looked }));
        };
        let only = self.columns_of(position.clone());
        match only.lacking.first() {
            None => Ok(vec![only]),
            Some(column) => self.columns.data_type(column).map(|_| Vec::new()),
        }
    }

    fn columns_of(&self, position: Position) -> PositionColumns {
        let map = &self.mapping.channels;
        let name = |c: &ChannelMapping| Pattern::new(&c.column).column_for(position.as_str());
        let needed = [&map.motor_position, &map.screw_position, &map.load].map(name);
        let lacking = needed.iter().filter(|c| !self.columns.has(c)).cloned().collect();
        let temperature = map.temperature.as_ref().map(name).filter(|c| self.columns.has(c));
        let [motor, screw, load] = needed;
        PositionColumns { position, columns: [Some(motor), Some(screw), Some(load), temperature], lacking }
    }

    /// blake3 of the footer and the chunks of every column that the positions and the clock use.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn digest(&self, positions: &[PositionColumns]) -> Result<String, Error> {
        let mut names: Vec<String> =
            positions.iter().flat_map(|p| p.columns.iter().flatten().cloned()).collect();
        names.extend(self.mapping.clock.column.clone());
        names.extend(self.mapping.identity.columns.values().cloned());
        self.columns.digest(&names)
    }

    /// Puts the rows on one clock.
    ///
    /// # Errors
    /// When there is no clock, its unit is unknown, it stands still or runs backwards.
    pub fn timeline(&self) -> Result<Timeline, Error> {
        let map = &self.mapping.clock;
        match (&map.column, map.rate_hz) {
            (Some(column), rate_hz) => {
                let mut stamps = self.columns.stamps(column, map.unit)?;
                if stamps.is_local {
                    stamps.start_utc =
                        stamps.start_utc.and_then(|t| identity::from_local(t, &self.mapping.identity));
                }
                let max_back_s = map.max_back_s.unwrap_or(MAX_BACK_S);
                clock::align(&stamps, rate_hz, max_back_s).map_err(|f| self.columns.error(f))
            }
            (None, Some(rate_hz)) => Ok(clock::even(self.rows(), rate_hz)),
            (None, None) => Err(self.columns.error(Fault::NoClock)),
        }
    }

    /// Reads the channels of one actuator.
    ///
    /// # Errors
    /// When a column is missing, holds no numbers or no value, cannot be decoded, or is in a unit
    /// that this part cannot be brought to the screw from.
    pub fn actuator(
        &self,
        at: &PositionColumns,
        timeline: &Timeline,
        geometry: Geometry,
    ) -> Result<Actuator, Error> {
        let map = &self.mapping.channels;
        let [motor, screw, load, temperature] = &at.columns;
        let read = |column: &Option<String>, channel: &ChannelMapping| {
            let column = column.as_deref().unwrap_or(&channel.column);
            self.channel(column, channel, timeline, geometry)
        };
        let motor_m = read(motor, &map.motor_position)?;
        let mut dx_m = read(screw, &map.screw_position)?;
        dx_m.iter_mut().zip(&motor_m).for_each(|(screw, motor)| *screw -= motor);
        let mut load_n = read(load, &map.load)?;
        let longest = (HOLD_S / timeline.step_s).ceil() as usize;
        let segments = hold(&mut load_n, &timeline.segments, longest);
        let temperature_c = match (temperature, &map.temperature) {
            // A temperature helps to understand a gap; its absence must not cost one.
            (Some(column), Some(channel)) => {
                self.channel(column, channel, timeline, geometry).ok().and_then(|values| mean(&values))
            }
            _ => None,
        };
        let missing = dx_m.iter().filter(|y| y.is_nan()).count();
        let missing_share = missing as f64 / dx_m.len().max(1) as f64;
        Ok(Actuator {
            position: at.position.clone(),
            step_s: timeline.step_s,
            motor_m,
            dx_m,
            load_n,
            segments,
            temperature_c,
            missing_share,
        })
    }

    fn channel(
        &self,
        column: &str,
        map: &ChannelMapping,
        timeline: &Timeline,
        geometry: Geometry,
    ) -> Result<Vec<f64>, Error> {
        let si = to_si(column, map, geometry).map_err(|f| self.columns.error(f))?;
        let mut values = self.columns.numbers(column)?;
        if let Some(kept) = &timeline.kept {
            values = kept.iter().map(|&row| values[row]).collect();
        }
        if !map.missing.is_empty() {
            values.iter_mut().filter(|v| map.missing.contains(v)).for_each(|v| *v = f64::NAN);
        }
        if values.iter().all(|v| !v.is_finite()) {
            return Err(self
                .columns
                .error(Fault::AllMissing { column: column.to_owned(), rows: values.len() as u64 }));
        }
        if let Some(turn) = map.wraps_at {
            unwrap_turns(&mut values, turn);
        }
        for value in &mut values {
            *value = si.apply(*value);
        }
        Ok(values)
    }
}

/// One straight line from raw to SI.
#[derive(Debug, Clone, Copy)]
struct ToSi {
    scale: f64,
    offset: f64,
    factor: f64,
    shift: f64,
}

impl ToSi {
    /// An infinite reading is no reading.
    fn apply(self, raw: f64) -> f64 {
        let value = (raw * self.scale + self.offset) * self.factor + self.shift;
        if value.is_finite() { value } else { f64::NAN }
    }
}

fn to_si(column: &str, map: &ChannelMapping, geometry: Geometry) -> Result<ToSi, Fault> {
    let (unit_factor, shift) = map.unit.to_si();
    let lever = lever(map.unit, geometry).map_err(|wanted| Fault::UnitForPart {
        column: column.to_owned(),
        unit: map.unit.as_str(),
        wanted,
    })?;
    let gear = match map.unit.dimension() {
        Dimension::Torque => map.gear_ratio,
        Dimension::Angle => map.gear_ratio.recip(),
        _ => 1.0,
    };
    Ok(ToSi {
        scale: map.scale,
        offset: map.offset,
        factor: f64::from(map.sign) * unit_factor * lever * gear,
        shift,
    })
}

/// What brings the unit's dimension to the screw axis, or what would be wanted instead.
fn lever(unit: Unit, geometry: Geometry) -> Result<f64, &'static str> {
    let rotary = matches!(geometry, Geometry::Rotary { .. });
    match unit.dimension() {
        Dimension::Length if rotary => Err("an angle (deg, rad, rev): the part only turns"),
        Dimension::Force if rotary => Err("a torque (N.m, lbf.in, lbf.ft): the part only turns"),
        Dimension::Length | Dimension::Force | Dimension::Temperature => Ok(1.0),
        Dimension::Angle => geometry.metres_per_radian().ok_or("a length, or the part's `lead_m_per_rev`"),
        Dimension::Torque => {
            geometry.metres_per_radian().map(f64::recip).ok_or("a force, or the part's `lead_m_per_rev`")
        }
    }
}

/// Adds or takes turns so that no step exceeds half a turn; missing and infinite samples are passed over.
fn unwrap_turns(values: &mut [f64], turn: f64) {
    let (mut turns, mut before) = (0.0, f64::NAN);
    for value in values.iter_mut().filter(|v| v.is_finite()) {
        let raw = *value;
        if !f64::is_nan(before) {
            turns -= ((raw - before) / turn).round();
        }
        before = raw;
        *value = raw + turns * turn;
    }
}

/// Holds the last load over samples without one, and starts each segment at its first load.
///
/// A load that is recorded more slowly is held over a few of its own steps, or `longest` samples if that
/// is more; one that stays away longer has died, and the segment ends where it was last known.
fn hold(load_n: &mut [f64], segments: &[Range<usize>], longest: usize) -> Vec<Range<usize>> {
    let longest = longest.max(HOLD_STEPS * usual_step(load_n));
    let mut loaded = Vec::with_capacity(segments.len());
    for segment in segments {
        let mut known: Option<Range<usize>> = None;
        for i in segment.clone().filter(|&i| !load_n[i].is_nan()).collect::<Vec<_>>() {
            match &mut known {
                Some(span) if i - span.end <= longest => {
                    let last = load_n[span.end - 1];
                    load_n[span.end..i].fill(last);
                    span.end = i + 1;
                }
                before => {
                    loaded.extend(before.take());
                    known = Some(i..i + 1);
                }
            }
        }
        if let Some(span) = known {
            let end = segment.end.min(span.end + longest);
            let last = load_n[span.end - 1];
            load_n[span.end..end].fill(last);
            loaded.push(span.start..end);
        }
    }
    loaded
}

/// Samples from one known load to the next, as the median has it.
fn usual_step(load_n: &[f64]) -> usize {
    let known: Vec<usize> = (0..load_n.len()).filter(|&i| !load_n[i].is_nan()).collect();
    let mut steps: Vec<usize> = known.windows(2).map(|w| w[1] - w[0]).collect();
    let middle = steps.len() / 2;
    if steps.is_empty() { 1 } else { *steps.select_nth_unstable(middle).1 }
}

fn mean(values: &[f64]) -> Option<f64> {
    let (sum, count) = values.iter().filter(|v| !v.is_nan()).fold((0.0, 0_u64), |(s, n), v| (s + v, n + 1));
    (count > 0).then(|| sum / count as f64)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_slow_load_is_held_and_a_segment_waits_for_its_first() {
        let nan = f64::NAN;
        let mut load = [nan, 1.0, nan, 2.0, nan, nan];
        let segments = hold(&mut load, &[0..3, 3..5, 5..6], 2);
        assert_eq!(segments, [1..3, 3..5]);
        assert_eq!(load[1..5], [1.0, 1.0, 2.0, 2.0]);
    }

    /// By hand: a 5 mm lead turns 0.1 N·m into 0.1·2π/0.005 = 125.66 N, and 90° into 1.25 mm.
    #[test]
    fn angles_and_torques_come_to_the_screw_by_the_lead() {
        let geometry = Geometry::Linear { lead_m_per_rev: Some(0.005) };
        let angle = ChannelMapping { unit: Unit::Degree, ..ChannelMapping::default() };
        let torque = ChannelMapping { unit: Unit::NewtonMetre, sign: -1, ..ChannelMapping::default() };
        assert!((to_si("a", &angle, geometry).unwrap().apply(90.0) - 0.00125).abs() < 1e-15);
        assert!((to_si("t", &torque, geometry).unwrap().apply(0.1) + 125.663_706_143_591_7).abs() < 1e-9);
    }

    /// The load comes every other sample, so it is held over eight at most.
    #[test]
    fn a_load_that_died_ends_its_segment() {
        let mut load = [f64::NAN; 40];
        for i in [0, 2, 4, 6, 30, 32] {
            load[i] = i as f64;
        }
        let segments = hold(&mut load, &[0..20, 20..40], 3);
        assert_eq!(segments, [0..15, 30..40]);
        assert_eq!((load[5], load[14], load[33]), (4.0, 6.0, 32.0));
        assert!(load[15].is_nan());
    }

    #[test]
    fn a_length_on_a_part_that_only_turns_is_refused() {
        let fault =
            to_si("x", &ChannelMapping::default(), Geometry::Rotary { reference_radius_m: 0.1 }).unwrap_err();
        assert!(matches!(fault, Fault::UnitForPart { unit: "m", .. }));
    }

    proptest! {
        /// Wrapping loses only whole turns, and a resolver never moves half a turn in a sample.
        #[test]
        fn an_unwrapped_resolver_differs_from_the_truth_by_whole_turns(
            steps in proptest::collection::vec(-170.0_f64..170.0, 1..200), start in 0.0_f64..360.0,
        ) {
            let truth: Vec<f64> = steps.iter().scan(start, |x, s| { *x += s; Some(*x) }).collect();
            let mut values: Vec<f64> = truth.iter().map(|x| x.rem_euclid(360.0)).collect();
            unwrap_turns(&mut values, 360.0);
            let offset = values[0] - truth[0];
            prop_assert!((offset / 360.0 - (offset / 360.0).round()).abs() < 1e-9);
            for (v, t) in values.iter().zip(&truth) {
                prop_assert!((v - t - offset).abs() < 1e-7);
            }
        }
    }
}
