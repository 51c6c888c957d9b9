//! One flight log: its identity, its actuators, and their channels in SI on one clock.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use jiff::Timestamp;
use records::Position;

use crate::channel::{self, Channel, ClockKey, Follower, Sampling};
use crate::clock::{Origin, Repairs, Timeline};
use crate::condition::Condition;
use crate::digest::Digest;
use crate::error::{Error, Fault};
use crate::file::LogFile;
use crate::hold::{hold, with_samples};
use crate::identity::{self, Facts, Identity};
use crate::normal::Normalized;
use crate::pattern::Pattern;
use crate::quality::{self, Quality};
use crate::scan::{Scan, Span};
use crate::schema::{ChannelMapping, Channels, Fact, Mapping, Role};
use crate::screw::Geometry;
use crate::sheet::{Samples, Sheet};
use crate::spare;
use crate::wanted::Wanted;

/// The files of one flight log: usually one.
#[derive(Debug, Clone, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Files {
    /// The main log, in one piece or in several.
    pub main: Vec<PathBuf>,
    /// Files of other kinds, by the name of their group.
    pub groups: BTreeMap<String, Vec<PathBuf>>,
}

impl Files {
    /// A log that is one file.
    pub fn one(path: impl Into<PathBuf>) -> Self {
        Self { main: vec![path.into()], groups: BTreeMap::new() }
    }

    /// Every file, the main log first.
    pub fn all(&self) -> impl Iterator<Item = &PathBuf> {
        self.main.iter().chain(self.groups.values().flatten())
    }
}

/// The columns of one actuator in one log.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PositionColumns {
    /// Its place.
    pub position: Position,
    /// The channels that make it, as mapped: motor position, screw position, load, temperature. Of
    /// redundant ones the first that the log has.
    pub columns: [Option<String>; 4],
    /// Mapped channels that the log lacks, without which this actuator cannot be estimated.
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
    /// Samples that no condition leaves: NaN in every channel.
    pub apart: usize,
    /// Share of the other samples without δX.
    pub missing_share: f64,
    /// What each channel looked like before anything was made of it: motor, screw, load.
    pub quality: [Quality; 3],
    /// Doubts about the channels: stable codes.
    pub flags: Vec<String>,
    /// What had to be mended in the clock.
    pub repairs: Repairs,
}

impl Actuator {
    /// What δX looks like.
    pub fn dx_quality(&self) -> Quality {
        Quality::of(&self.dx_m, self.step_s, self.apart)
    }

    /// Leaves the memory of its channels to the next actuator that this thread reads.
    pub fn reuse(self) {
        [self.motor_m, self.dx_m, self.load_n].into_iter().for_each(spare::give);
    }
}

/// An open log.
#[derive(Debug)]
pub struct Log {
    main: Sheet,
    groups: BTreeMap<String, Sheet>,
    mapping: Arc<Mapping>,
    normalized: Option<Normalized>,
    names: OnceLock<BTreeSet<String>>,
    /// What the conditions left of the actuator before: most ask the same of every one.
    selected: Mutex<Option<(Asked, Selection)>>,
}

/// Conditions, which samples and stamps of this log they were asked of, and the clock they were asked on.
#[derive(Debug, PartialEq)]
struct Asked {
    when: Vec<Condition>,
    of: Vec<(Samples, Option<String>)>,
    group: Option<String>,
    clock: ClockKey,
}

impl Log {
    /// Opens the files of a log and reads their footers.
    ///
    /// # Errors
    /// When a file cannot be read, is empty, or is not whole Parquet.
    pub fn open(files: &Files, mapping: &Arc<Mapping>) -> Result<Self, Error> {
        let open = |paths: &[PathBuf]| paths.iter().map(|p| LogFile::open(p)).collect::<Result<Vec<_>, _>>();
        let (clock, layout) = (mapping.clock.clone(), mapping.layout.clone());
        let main = Sheet::new(open(&files.main)?, clock, layout);
        let mut groups = BTreeMap::new();
        for (name, group) in &mapping.groups {
            let paths = files.groups.get(name).map(Vec::as_slice).unwrap_or_default();
            if !paths.is_empty() {
                let clock = group.clock.as_ref().unwrap_or(&mapping.clock).clone();
                groups.insert(name.clone(), Sheet::new(open(paths)?, clock, group.layout.clone()));
            }
        }
        let Some(first) = main.files.first() else {
            let source = std::io::Error::from(std::io::ErrorKind::NotFound);
            return Err(Error::new(Path::new(""), Fault::Unreadable { source }));
        };
        let normalized = Normalized::of(first)?;
        let mapping = Arc::clone(mapping);
        let (names, selected) = (OnceLock::new(), Mutex::new(None));
        let mut log = Self { main, groups, mapping, normalized, names, selected };
        log.order_pieces()?;
        Ok(log)
    }

    /// The same open files, read by another mapping of the same kinds of files.
    #[must_use]
    pub fn remapped(mut self, mapping: &Arc<Mapping>) -> Self {
        self.main.remap(&mapping.clock, &mapping.layout);
        for (name, sheet) in &mut self.groups {
            if let Some(group) = mapping.groups.get(name) {
                sheet.remap(group.clock.as_ref().unwrap_or(&mapping.clock), &group.layout);
            }
        }
        self.mapping = Arc::clone(mapping);
        (self.names, self.selected) = (OnceLock::new(), Mutex::new(None));
        self
    }

    /// Pieces of a flight follow each other in time, whatever their files are called.
    fn order_pieces(&mut self) -> Result<(), Error> {
        for sheet in std::iter::once(&mut self.main).chain(self.groups.values_mut()) {
            let Some(column) = sheet.clock.column.clone() else { continue };
            if sheet.files.len() < 2 {
                continue;
            }
            let mut starts = Vec::with_capacity(sheet.files.len());
            for file in std::mem::take(&mut sheet.files) {
                let (clock, layout) = (sheet.clock.clone(), sheet.layout.clone());
                let alone = Sheet::new(vec![file], clock, layout);
                let samples = Samples { leaf: column.clone(), rows: Vec::new() };
                let stamps = alone.stamps(&samples, None)?;
                starts.push((stamps.origin, alone.files));
            }
            let first = starts[0].0;
            let since = |origin: &Origin| origin.since(first).unwrap_or(0.0);
            starts.sort_by(|a, b| since(&a.0).total_cmp(&since(&b.0)));
            sheet.files = starts.into_iter().flat_map(|(_, files)| files).collect();
        }
        Ok(())
    }

    /// Rows the footers of the main log declare.
    pub fn rows(&self) -> usize {
        self.main.rows()
    }

    /// Whether this is a log that Freeplay itself wrote with `normalize`.
    pub fn is_normalized(&self) -> bool {
        self.normalized.is_some()
    }

    /// Names and types of all columns, for `check`.
    pub fn column_types(&self) -> Vec<(String, String)> {
        let leaves = self.main.files.iter().flat_map(LogFile::leaves);
        leaves.map(|leaf| (leaf.name.clone(), leaf.kind.to_string())).collect()
    }

    /// Whether every page of the columns of these actuators carries a checksum.
    ///
    /// # Errors
    /// When a page header cannot be.
    pub fn is_checked(&self, used: &[(&Channels, &PositionColumns)]) -> Result<bool, Error> {
        for (sheet, leaves) in self.leaves(used) {
            for file in &sheet.files {
                let names: Vec<&str> = leaves.iter().map(String::as_str).filter(|l| file.has(l)).collect();
                if !file.is_checked(&names)? {
                    return Ok(false);
                }
            }
        }
        Ok(true)
    }

    /// Which flight this is; `known` fills what the log itself leaves open.
    ///
    /// # Errors
    /// When tail or departure stand nowhere, cannot be read, or change within the log.
    pub fn identity(&self, known: impl Fn(&Facts) -> Facts) -> Result<Identity, Error> {
        if let Some(normalized) = &self.normalized {
            let own = crate::schema::IdentityMapping::default();
            return identity::read(&normalized.facts, &own, None).map_err(|f| self.main.error(f));
        }
        let mut facts = facts(&self.main, &self.mapping.identity)?;
        for (fact, text) in known(&facts) {
            facts.entry(fact).or_insert(text);
        }
        let start = if facts.contains_key(&Fact::DepartureUtc) { None } else { self.start_utc()? };
        identity::read(&facts, &self.mapping.identity, start).map_err(|f| self.main.error(f))
    }

    /// The first instant of an absolute clock.
    ///
    /// # Errors
    /// When the time column cannot be read.
    pub fn start_utc(&self) -> Result<Option<Timestamp>, Error> {
        let Some(column) = &self.main.clock.column else { return Ok(None) };
        if !self.main.files[0].has(column) {
            return Ok(None);
        }
        let every_row = Samples { leaf: column.clone(), rows: Vec::new() };
        let stamps = self.main.stamps(&every_row, None)?;
        let earliest = stamps.seconds.iter().copied().filter(|s| !s.is_nan()).fold(f64::INFINITY, f64::min);
        let later = |start: Timestamp| start.checked_add(channel::duration(earliest)).ok();
        Ok(match stamps.origin {
            Origin::Utc(start) => later(start),
            Origin::Local(start) => {
                later(start).and_then(|local| identity::from_local(local, &self.mapping.identity))
            }
            Origin::Counted(_) | Origin::Start => None,
        })
    }

    /// The sheet that holds a channel.
    fn sheet(&self, map: &ChannelMapping) -> Option<&Sheet> {
        map.group.as_ref().map_or(Some(&self.main), |name| self.groups.get(name))
    }

    /// What channels may be called in the sheet of one.
    fn names_for(&self, map: &ChannelMapping) -> Result<BTreeSet<String>, Error> {
        if map.group.is_some() {
            return self.sheet(map).map_or_else(|| Ok(BTreeSet::new()), Sheet::names);
        }
        if self.names.get().is_none() {
            let names = self.main.names()?;
            return Ok(self.names.get_or_init(|| names).clone());
        }
        Ok(self.names.get().cloned().unwrap_or_default())
    }

    /// The actuators whose columns are here, in order of their names.
    ///
    /// `own` is the position of a log that holds one actuator and does not name it in its columns.
    ///
    /// # Errors
    /// [`Fault::NoPosition`] when no column fits; [`Fault::ColumnMissing`] or
    /// [`Fault::IdentityMissing`] in a log of one actuator.
    pub fn positions(
        &self,
        channels: &Channels,
        own: Option<&Position>,
    ) -> Result<Vec<PositionColumns>, Error> {
        if self.normalized.is_some() {
            let of = |position: &Position| PositionColumns {
                position: position.clone(),
                columns: Normalized::COLUMNS.map(|name| Some(name.to_owned())),
                lacking: Vec::new(),
            };
            return Ok(own.map(of).into_iter().collect());
        }
        let Some(found) = self.position_names(channels)? else { return self.only_position(channels, own) };
        let asked = |text: &String| channels.positions.is_empty() || channels.positions.contains(text);
        let named = found.into_iter().filter(asked).filter_map(|text| Position::new(text).ok());
        let all = named.map(|p| self.columns_of(channels, p)).collect::<Result<Vec<_>, _>>()?;
        if all.iter().any(|p| p.lacking.is_empty()) {
            return Ok(all);
        }
        Err(self.no_position(channels, &all)?)
    }

    /// Names the channel that is not there: none of its columns fits, or it is lacking where others are.
    fn no_position(&self, channels: &Channels, partly: &[PositionColumns]) -> Result<Error, Error> {
        let mut fewest = (usize::MAX, &channels.motor_position);
        for map in Role::NEEDED.iter().filter_map(|role| channels.of(*role)) {
            let name = |at: &PositionColumns| Pattern::new(&map.column).column_for(at.position.as_str());
            let count = partly.iter().filter(|at| !at.lacking.contains(&name(at))).count();
            if count < fewest.0 {
                fewest = (count, map);
            }
        }
        let (pattern, columns) = (fewest.1.column.clone(), self.names_for(fewest.1)?.into_iter().collect());
        Ok(self.main.error(Fault::NoPosition { pattern, columns }))
    }

    /// The positions that rows or names speak of; none when neither can.
    fn position_names(&self, channels: &Channels) -> Result<Option<BTreeSet<String>>, Error> {
        if let Some(found) = self.main.row_positions()? {
            return Ok(Some(found));
        }
        let (mut is_open, mut found) = (false, BTreeSet::new());
        for map in Role::NEEDED.iter().filter_map(|role| channels.of(*role)).flat_map(ChannelMapping::choices)
        {
            let pattern = Pattern::new(&map.column);
            if pattern.is_open() {
                is_open = true;
                let names = self.names_for(map)?;
                found.extend(names.iter().filter_map(|name| pattern.position_in(name)).map(str::to_owned));
            }
        }
        Ok(is_open.then_some(found))
    }

    fn only_position(
        &self,
        channels: &Channels,
        own: Option<&Position>,
    ) -> Result<Vec<PositionColumns>, Error> {
        let Some(position) = own else {
            let looked = vec!["the names of columns (no `{position}` in them)".into()];
            return Err(self.main.error(Fault::IdentityMissing { fact: "position", looked }));
        };
        let only = self.columns_of(channels, position.clone())?;
        match only.lacking.first() {
            None => Ok(vec![only]),
            Some(column) => Err(self.main.lacks(column)),
        }
    }

    fn columns_of(&self, channels: &Channels, position: Position) -> Result<PositionColumns, Error> {
        let mut columns = [None, None, None, None];
        let mut lacking = Vec::new();
        for (slot, role) in columns.iter_mut().zip(Role::ALL) {
            let Some(map) = channels.of(role) else { continue };
            let first = self.present(map, &position)?.into_iter().next();
            let name = Pattern::new(&map.column).column_for(position.as_str());
            if first.is_none() && role != Role::Temperature {
                lacking.push(name.clone());
            }
            *slot = first.map(|(_, name)| name).or((role != Role::Temperature).then_some(name));
        }
        Ok(PositionColumns { position, columns, lacking })
    }

    /// A channel and its alternatives, as far as the log has them, with their names here.
    fn present<'c>(
        &self,
        map: &'c ChannelMapping,
        position: &Position,
    ) -> Result<Vec<(&'c ChannelMapping, String)>, Error> {
        let mut found = Vec::new();
        for choice in map.choices() {
            let name = Pattern::new(&choice.column).column_for(position.as_str());
            if self.names_for(choice)?.contains(&name) {
                found.push((choice, name));
            }
        }
        Ok(found)
    }

    /// The leaves that these actuators need, sheet by sheet.
    fn leaves(&self, used: &[(&Channels, &PositionColumns)]) -> Vec<(&Sheet, BTreeSet<String>)> {
        let sheets =
            std::iter::once((None, &self.main)).chain(self.groups.iter().map(|(n, s)| (Some(n.as_str()), s)));
        let needed = |(group, sheet): (Option<&str>, &Sheet)| {
            let mut leaves = BTreeSet::new();
            for (channels, at) in used {
                let conditions: Vec<ChannelMapping> = channels.when.iter().map(Condition::channel).collect();
                let maps = Role::ALL.iter().filter_map(|role| channels.of(*role));
                let maps = maps.flat_map(ChannelMapping::choices).chain(&conditions);
                for map in maps.filter(|m| m.group.as_deref() == group) {
                    let named = |column: &String| Pattern::new(column).column_for(at.position.as_str());
                    for name in std::iter::once(&map.column).chain(&map.valid_column).map(named) {
                        leaves.extend(sheet.leaves_of(&sheet.samples(&name, at.position.as_str())));
                    }
                    leaves.extend(map.time_column.iter().map(named));
                }
            }
            leaves
        };
        sheets.map(|(group, sheet)| (sheet, needed((group, sheet)))).collect()
    }

    /// blake3 of the footers and the chunks of every column that the positions, the clock and the
    /// identity use.
    ///
    /// # Errors
    /// When a file cannot be read.
    pub fn digest(&self, used: &[(&Channels, &PositionColumns)]) -> Result<String, Error> {
        let mut digest = Digest::new();
        for (sheet, mut leaves) in self.leaves(used) {
            leaves.extend(self.mapping.identity.columns.values().cloned());
            if self.normalized.is_some() {
                leaves.extend(Normalized::COLUMNS.map(str::to_owned));
            }
            let names: Vec<&str> = leaves.iter().map(String::as_str).collect();
            for file in &sheet.files {
                file.feed(&names, &mut digest)?;
            }
        }
        Ok(digest.end())
    }

    /// Reads the channels of one actuator.
    ///
    /// # Errors
    /// When a column is missing, holds no numbers or no value, cannot be decoded, or is in a unit
    /// that this part cannot be brought to the screw from; when clocks cannot be brought together.
    pub fn actuator(
        &self,
        at: &PositionColumns,
        channels: &Channels,
        geometry: Geometry,
    ) -> Result<Actuator, Error> {
        if let Some(normalized) = &self.normalized {
            return normalized.actuator(&self.main.files[0], at.position.clone(), geometry);
        }
        let sought = Sought { at, channels, geometry };
        let Lead { channel: motor, master, selection, mut flags } = self.motor(sought)?;
        let read = |role: Role, from: &Selection| self.follower(role, sought, &master, from);
        let (screw, screw_flags) = read(Role::Screw, &selection)?;
        let (load, load_flags) = read(Role::Load, &selection)?;
        // The mean of the flight, whatever counts of it.
        let whole = Selection::whole(&master.0.line);
        let temperature = channels.temperature.as_ref().and_then(|_| read(Role::Temperature, &whole).ok());
        flags.extend(screw_flags.into_iter().chain(load_flags));
        let read = Read { motor, screw, load, is_relative: channels.is_relative(), selection };
        let temperature_c = temperature.and_then(|(read, _)| mean(&read.values));
        Ok(finish(at.position.clone(), read, &master.0.line, temperature_c, flags))
    }

    /// The stretches of the motor's clock in which every condition holds; as before, where the same was asked.
    fn selected(&self, sought: Sought<'_>, master: &Master<'_, '_>) -> Result<Selection, Error> {
        let Sought { at, channels, .. } = sought;
        if channels.when.is_empty() {
            return Ok(Selection::whole(&master.0.line));
        }
        let position = at.position.as_str();
        let named = |column: &String| Pattern::new(column).column_for(position);
        let of = |when: &Condition| {
            let samples = self.sheet_of(&when.channel())?.samples(&named(&when.column), position);
            Ok((samples, when.time_column.as_ref().map(named)))
        };
        let asked = Asked {
            when: channels.when.clone(),
            of: channels.when.iter().map(of).collect::<Result<_, Error>>()?,
            group: master.1.group.clone(),
            clock: master.0.clock_key(master.1),
        };
        let mut before = self.selected.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, selection)) = before.as_ref().filter(|(known, _)| *known == asked) {
            return Ok(selection.clone());
        }
        let selection = self.select(sought, master)?;
        *before = Some((asked, selection.clone()));
        Ok(selection)
    }

    fn select(&self, sought: Sought<'_>, master: &Master<'_, '_>) -> Result<Selection, Error> {
        let Sought { at, channels, geometry } = sought;
        let line = &master.0.line;
        let mut segments = line.segments.clone();
        for condition in &channels.when {
            let map = condition.channel();
            let name = Pattern::new(&map.column).column_for(at.position.as_str());
            let sheet = self.sheet_of(&map)?;
            if !self.names_for(&map)?.contains(&name) {
                return Err(sheet.lacks(&name));
            }
            // A state stands until the next one comes, as a slow load does.
            let position = at.position.as_str();
            let one = Follower { sheet, map: &map, name: &name, position, role: Role::Load };
            let Channel { mut values, .. } =
                channel::follow(&master.0, master.1, &one, geometry, Wanted::ALL)?;
            hold(&mut values, &line.segments, line.step_s);
            segments = condition.within(&values, &segments, line.step_s);
        }
        Ok(Selection::of(segments, line))
    }

    /// The motor position, whose clock all other channels follow.
    fn motor<'c>(&self, sought: Sought<'c>) -> Result<Lead<'_, 'c>, Error> {
        let Sought { at, channels, geometry } = sought;
        let mut found: Option<Lead<'_, 'c>> = None;
        let choices = self.present_or_lacking(Role::Motor, at, channels)?;
        let is_only = choices.len() == 1;
        for (k, (map, name)) in choices.into_iter().enumerate() {
            let sampling = Sampling::new(self.sheet_of(map)?, map, &name, at.position.as_str())?;
            let master = (sampling, map);
            if !channels.when.is_empty() {
                // Conditions ask for memory by the rows that a footer declares: its pages must hold as many.
                master.0.check_rows()?;
            }
            let selection = self.selected(sought, &master)?;
            let read = selection.cut(master.0.own(map, geometry, selection.wanted())?);
            let lives = is_only || channel::lives(&read.values, selection.apart);
            if lives || found.is_none() {
                let flags = alternative(Role::Motor, k);
                found = Some(Lead { channel: read, master, selection, flags });
            }
            if lives {
                break;
            }
        }
        let lead = found.ok_or_else(|| self.main.lacks(&channels.motor_position.column))?;
        self.not_empty(&lead.channel.values, lead.master.0.column(), &lead.selection)?;
        Ok(lead)
    }

    /// A channel on the motor's clock.
    fn follower(
        &self,
        role: Role,
        sought: Sought<'_>,
        master: &Master<'_, '_>,
        selection: &Selection,
    ) -> Result<(Channel, Vec<String>), Error> {
        let Sought { at, channels, geometry } = sought;
        let mut found: Option<(Channel, usize)> = None;
        let mut column = String::new();
        let choices = self.present_or_lacking(role, at, channels)?;
        let is_only = choices.len() == 1;
        for (k, (map, name)) in choices.into_iter().enumerate() {
            let sheet = self.sheet_of(map)?;
            let one = Follower { sheet, map, name: &name, position: at.position.as_str(), role };
            let read = channel::follow(&master.0, master.1, &one, geometry, selection.wanted())?;
            let read = selection.cut(read);
            let lives = is_only || channel::lives(&read.values, selection.apart);
            if lives || found.is_none() {
                column = name;
                found = Some((read, k));
            }
            if lives {
                break;
            }
        }
        let (read, k) = found.unwrap_or_else(|| (Vec::new().into(), 0));
        self.not_empty(&read.values, &column, selection)?;
        Ok((read, alternative(role, k)))
    }

    fn present_or_lacking<'c>(
        &self,
        role: Role,
        at: &PositionColumns,
        channels: &'c Channels,
    ) -> Result<Vec<(&'c ChannelMapping, String)>, Error> {
        let map = channels.of(role).unwrap_or(&channels.motor_position);
        let found = self.present(map, &at.position)?;
        if found.is_empty() {
            let name = Pattern::new(&map.column).column_for(at.position.as_str());
            return Err(self.sheet(map).unwrap_or(&self.main).lacks(&name));
        }
        Ok(found)
    }

    fn sheet_of(&self, map: &ChannelMapping) -> Result<&Sheet, Error> {
        self.sheet(map).ok_or_else(|| {
            self.main.error(Fault::GroupMissing { group: map.group.clone().unwrap_or_default() })
        })
    }

    /// Whether a column holds a value where it counts, if it counts anywhere.
    fn not_empty(&self, values: &[f64], column: &str, selection: &Selection) -> Result<(), Error> {
        let counted = values.len() - selection.apart;
        if (counted == 0 && selection.apart > 0) || values.iter().any(|v| v.is_finite()) {
            return Ok(());
        }
        let (column, rows) = (column.to_owned(), counted as u64);
        Err(self.main.error(Fault::AllMissing { column, rows }))
    }
}

/// The actuator that is read: its columns, how its channels are read, and what its angles turn.
#[derive(Clone, Copy)]
struct Sought<'c> {
    at: &'c PositionColumns,
    channels: &'c Channels,
    geometry: Geometry,
}

/// How the motor position lies in time, and by which mapping it is read.
type Master<'s, 'c> = (Sampling<'s>, &'c ChannelMapping);

/// The motor position's values, how they lie in time, what counts of them, and doubts about them.
struct Lead<'s, 'c> {
    channel: Channel,
    master: Master<'s, 'c>,
    selection: Selection,
    flags: Vec<String>,
}

/// The stretches of the motor's clock that count.
#[derive(Debug, Clone)]
pub(crate) struct Selection {
    segments: Vec<Range<usize>>,
    /// Samples that no condition leaves.
    apart: usize,
}

impl Selection {
    /// All that is unbroken.
    pub(crate) fn whole(line: &Timeline) -> Self {
        Self { segments: line.segments.clone(), apart: 0 }
    }

    fn of(segments: Vec<Range<usize>>, line: &Timeline) -> Self {
        let samples = line.kept.as_ref().map_or(line.rows, Vec::len);
        let apart = samples - segments.iter().map(Range::len).sum::<usize>();
        Self { segments, apart }
    }

    fn wanted(&self) -> Wanted<'_> {
        if self.apart == 0 { Wanted::ALL } else { Wanted::of(&self.segments) }
    }

    /// Takes out what does not count, so that nothing is made of it however the file lies in pages.
    fn cut(&self, mut channel: Channel) -> Channel {
        if self.apart == 0 {
            return channel;
        }
        let mut counted = 0;
        for segment in &self.segments {
            channel.values[counted..segment.start].fill(f64::NAN);
            counted = segment.end;
        }
        channel.values[counted..].fill(f64::NAN);
        channel.seen = None;
        channel
    }
}

/// What a sheet's files say of their flight.
fn facts(sheet: &Sheet, map: &crate::schema::IdentityMapping) -> Result<Facts, Error> {
    let first = &sheet.files[0];
    let mut facts: Facts = map.values.clone();
    facts.extend(identity::from_folders(first.path(), &map.folders));
    if let Some(expression) = &map.path {
        facts.extend(identity::from_path(first.path(), expression).map_err(|f| sheet.error(f))?);
    }
    for (fact, column) in &map.columns {
        // A column the log lacks may still be covered by another source; what is missing in all is named later.
        facts.extend(sheet.constant(column, fact.as_str())?.map(|text| (*fact, text)));
    }
    let stated = |(fact, key): (&Fact, &String)| Some((*fact, first.metadata(key)?.to_owned()));
    facts.extend(map.metadata.iter().filter_map(stated));
    Ok(facts)
}

/// What a file of a group says of its flight, so that it finds its main log.
///
/// # Errors
/// As [`Log::open`] and [`Log::identity`].
pub fn identity_of_file(
    path: &Path,
    mapping: &Mapping,
    group: &str,
    known: impl Fn(&Facts) -> Facts,
) -> Result<Identity, Error> {
    let settings = mapping.groups.get(group);
    let identity = settings.and_then(|g| g.identity.clone()).unwrap_or_else(|| mapping.identity.clone());
    let clock = settings.and_then(|g| g.clock.clone()).unwrap_or_else(|| mapping.clock.clone());
    let layout = settings.map(|g| g.layout.clone()).unwrap_or_default();
    let alone = Mapping { identity, clock, layout, ..Mapping::default() };
    Log::open(&Files::one(path), &Arc::new(alone))?.identity(known)
}

fn alternative(role: Role, choice: usize) -> Vec<String> {
    if choice == 0 { Vec::new() } else { vec![format!("{}_alternative", role.as_str())] }
}

/// Channels as read, on one clock.
pub(crate) struct Read {
    pub(crate) motor: Channel,
    pub(crate) screw: Channel,
    pub(crate) load: Channel,
    pub(crate) is_relative: bool,
    pub(crate) selection: Selection,
}

/// Looks at the channels, leaves out what a frozen one claims, and makes δX.
pub(crate) fn finish(
    position: Position,
    read: Read,
    line: &Timeline,
    temperature_c: Option<f64>,
    mut flags: Vec<String>,
) -> Actuator {
    let Read { motor, screw, load, is_relative, selection } = read;
    let Selection { segments, apart, .. } = selection;
    let quality = [&motor, &screw, &load].map(|read| {
        let seen = read.seen.unwrap_or_else(|| Scan::of(&read.values));
        Quality::seen(&read.values, &seen, line.step_s, apart)
    });
    let (mut motor_m, mut dx_m, mut load_n) = (motor.values, screw.values, load.values);
    flags.extend(quality::doubts(&quality, line.step_s));
    if !is_relative {
        let longest = quality[0].longest_run.max(quality[1].longest_run);
        flags.extend(quality::thaw(&mut motor_m, &mut dx_m, longest, line.step_s));
    }
    let (travel_m, missing) = relative(&motor_m, &mut dx_m, is_relative);
    flags.extend(quality::coarse(&quality, travel_m));
    flags.extend(quality::load_froze(&load_n, &motor_m, quality[2].longest_run, line.step_s));
    let is_whole = quality[2].missing_share == 0.0;
    let segments = if is_whole { with_samples(&segments) } else { hold(&mut load_n, &segments, line.step_s) };
    Actuator {
        position,
        step_s: line.step_s,
        missing_share: (missing - apart) as f64 / (dx_m.len() - apart).max(1) as f64,
        apart,
        motor_m,
        dx_m,
        load_n,
        segments,
        temperature_c,
        quality,
        flags,
        repairs: line.repairs,
    }
}

/// Makes δX of the screw's position, or leaves it where it is one already; NaN where the motor's is missing. Returns its
/// travel, m, and how many samples are missing.
fn relative(motor_m: &[f64], screw_m: &mut [f64], is_relative: bool) -> (f64, usize) {
    const BATCH: usize = 4096;
    let (mut span, mut missing) = (Span::NONE, 0);
    for (screw_m, motor_m) in screw_m.chunks_mut(BATCH).zip(motor_m.chunks(BATCH)) {
        let pairs = screw_m.iter_mut().zip(motor_m);
        if is_relative {
            pairs.filter(|(_, motor)| motor.is_nan()).for_each(|(dx, _)| *dx = f64::NAN);
        } else {
            pairs.for_each(|(screw, motor)| *screw -= motor);
        }
        span.take(screw_m);
        missing += screw_m.iter().filter(|dx| dx.is_nan()).count();
    }
    (span.length(), missing)
}

fn mean(values: &[f64]) -> Option<f64> {
    let (sum, count) = values.iter().filter(|v| !v.is_nan()).fold((0.0, 0_u64), |(s, n), v| (s + v, n + 1));
    (count > 0).then(|| sum / count as f64)
}
