//! One flight log: its identity, its actuators, and their channels in SI on one clock.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use jiff::Timestamp;
use jiff::tz::TimeZone;
use records::Position;

use crate::channel::si_conversion::Geometry;
use crate::channel::stats::span;
use crate::error::{Error, ErrorKind};
use crate::io::digest::Digest;
use crate::log::assemble::{RawChannels, assemble, mean};
use crate::log::channel_reader::{self, Channel, ChannelSampling, TimeBaseKey};
use crate::log::flight_rows::split_path;
use crate::log::identity::{self, ClockSpan, Identity, IdentityFields};
use crate::log::normalized::Normalized;
use crate::log::row_table::{RowTable, SampleSelector};
use crate::log::selection::SampleSelection;
use crate::log::types::{ActuatorChannels, ActuatorColumns, LogFiles};
use crate::mapping::column_pattern::ColumnPattern;
use crate::mapping::{ChannelMapping, Channels, IdentityField, IdentityMapping, Mapping, Role, SampleFilter};
use crate::parquet::log_file::LogFile;
use crate::time::clock::TimeOrigin;
use crate::time::zero_order_hold::zero_order_hold;

/// An open log.
#[derive(Debug)]
pub struct Log {
    /// The main log, and the files of each group that has some.
    tables: BTreeMap<Option<String>, RowTable>,
    mapping: Arc<Mapping>,
    normalized: Option<Normalized>,
    /// What the conditions left of the actuator before: most ask the same of every one.
    selected: Mutex<Option<(SelectionKey, SampleSelection)>>,
}

/// Cache key of a sample selection: the filters, the samples and timestamps they apply to, and their clock.
#[derive(Debug, PartialEq)]
struct SelectionKey {
    when: Vec<SampleFilter>,
    of: Vec<(SampleSelector, Option<String>)>,
    group: Option<String>,
    clock: TimeBaseKey,
}

impl Log {
    /// Opens the files of a log and reads their footers.
    ///
    /// # Errors
    /// When a file cannot be read, is empty, or is not whole Parquet.
    pub fn open(files: &LogFiles, mapping: &Arc<Mapping>) -> Result<Self, Error> {
        let main = (None, files.main.as_slice());
        let groups = mapping.groups.keys().map(|name| {
            let files = files.groups.get(name).map(Vec::as_slice).unwrap_or_default();
            (Some(name.clone()), files)
        });
        let mut tables = BTreeMap::new();
        for (group, paths) in std::iter::once(main).chain(groups).filter(|(_, paths)| !paths.is_empty()) {
            let (clock, layout, identity) = mapping.of_group(group.as_deref());
            let open = |path: &PathBuf| {
                let (path, flight_rows) = split_path(path, identity);
                LogFile::open(&path).map(|file| file.of_flight(flight_rows))
            };
            let files = paths.iter().map(open).collect::<Result<Vec<_>, _>>()?;
            tables.insert(group, RowTable::new(files, clock.clone(), layout.clone()));
        }
        let Some(main) = tables.get(&None) else {
            return Err(Error::new(Path::new(""), std::io::Error::from(std::io::ErrorKind::NotFound).into()));
        };
        let normalized = Normalized::of(&main.files[0])?;
        let mut log = Self { tables, mapping: Arc::clone(mapping), normalized, selected: Mutex::new(None) };
        log.order_pieces()?;
        Ok(log)
    }

    /// The same open files, read by another mapping of the same kinds of files.
    #[must_use]
    pub fn with_mapping(mut self, mapping: &Arc<Mapping>) -> Self {
        for (group, table) in &mut self.tables {
            let (clock, layout, _) = mapping.of_group(group.as_deref());
            table.remap(clock, layout);
        }
        Self { mapping: Arc::clone(mapping), selected: Mutex::new(None), ..self }
    }

    /// The table of the main log.
    fn main(&self) -> &RowTable {
        &self.tables[&None]
    }

    /// Pieces of a flight follow each other in time, whatever their files are called.
    fn order_pieces(&mut self) -> Result<(), Error> {
        for sheet in self.tables.values_mut() {
            let Some(column) = sheet.clock.column.clone() else { continue };
            if sheet.files.len() < 2 {
                continue;
            }
            let mut starts = Vec::with_capacity(sheet.files.len());
            for file in std::mem::take(&mut sheet.files) {
                let (clock, layout) = (sheet.clock.clone(), sheet.layout.clone());
                let alone = RowTable::new(vec![file], clock, layout);
                let stamps = alone.stamps(&SampleSelector::every_row(&column), None)?;
                starts.push((stamps.origin, alone.files));
            }
            let first = starts[0].0;
            let since = |origin: &TimeOrigin| origin.since(first).unwrap_or(0.0);
            starts.sort_by(|a, b| since(&a.0).total_cmp(&since(&b.0)));
            sheet.files = starts.into_iter().flat_map(|(_, files)| files).collect();
        }
        Ok(())
    }

    /// Rows the footers of the main log declare.
    pub fn rows(&self) -> usize {
        self.main().rows()
    }

    /// Names and types of all columns, for `check`.
    pub fn column_types(&self) -> Vec<(String, String)> {
        let leaves = self.main().files.iter().flat_map(LogFile::leaves);
        leaves.map(|leaf| (leaf.name.clone(), leaf.kind.to_string())).collect()
    }

    /// Whether every page of the columns of these actuators carries a checksum.
    ///
    /// # Errors
    /// When a page header cannot be read.
    pub fn has_page_checksums(&self, used: &[(&Channels, &ActuatorColumns)]) -> Result<bool, Error> {
        for (sheet, leaves) in self.leaves(used) {
            for file in &sheet.files {
                let names: Vec<&str> = leaves.iter().map(String::as_str).filter(|l| file.has(l)).collect();
                if !file.has_page_checksums(&names)? {
                    return Ok(false);
                }
            }
        }
        Ok(true)
    }

    /// Which flight this is; `known` fills what the log itself leaves open, from what it holds and from the first instant
    /// of its clock. That instant is read only where the log holds no departure and `known` finds no flight without it.
    ///
    /// # Errors
    /// When tail or departure stand nowhere, cannot be read, or change within the log.
    pub fn identity(
        &self,
        known: impl Fn(&IdentityFields, Option<Timestamp>) -> IdentityFields,
    ) -> Result<Identity, Error> {
        if let Some(normalized) = &self.normalized {
            let own = IdentityMapping::default();
            return identity::read(&normalized.facts, &own, None).map_err(|f| self.main().error(f));
        }
        let mapping = &self.mapping.identity;
        let known =
            |facts: &IdentityFields, start| known(&identity::registered(facts, mapping, start), start);
        let fail = |fault| self.main().error(fault);
        let mut facts = facts(self.main(), mapping)?;
        let date =
            facts.get(&IdentityField::DepartureUtc).and_then(|text| identity::date_alone(text, mapping));
        if date.is_some() {
            // A day has several flights: the time comes from the flights table, or from the clock.
            facts.remove(&IdentityField::DepartureUtc);
        }
        // Adds what the flights table knows; its departure, an instant or a date, is not in the form of the log's.
        let fill = |facts: &mut IdentityFields, mut found: IdentityFields| {
            let departure = found.remove(&IdentityField::DepartureUtc);
            for (fact, text) in found {
                facts.entry(fact).or_insert(text);
            }
            departure.filter(|_| !facts.contains_key(&IdentityField::DepartureUtc))
        };
        let instant = |text: Option<String>| text?.parse::<Timestamp>().ok();
        // Of several flights of one id, the one near noon of the date is that of the date.
        let noon = date.and_then(|date| date.at(12, 0, 0, 0).to_zoned(TimeZone::UTC).ok());
        let found = known(&facts, noon.map(|noon| noon.timestamp()));
        let of_table = fill(&mut facts, found);
        let date = of_table.as_ref().and_then(|text| text.parse().ok()).or(date);
        let departure = instant(of_table);
        if departure.is_some() || facts.contains_key(&IdentityField::DepartureUtc) {
            return identity::read(&facts, mapping, departure).map_err(fail);
        }
        let clock = self.clock_span()?;
        let absolute = clock.and_then(|clock| clock.start(mapping)).transpose().map_err(fail)?;
        let mut start = match (date, facts.get(&IdentityField::LandingUtc)) {
            (Some(date), _) => Some(identity::departure_on(date, absolute, clock, mapping).map_err(fail)?),
            (None, Some(landing)) if absolute.is_none() => {
                Some(identity::departure_before(landing, &facts, clock, mapping).map_err(fail)?)
            }
            _ => absolute,
        };
        if start.is_some() {
            let found = known(&facts, start);
            start = instant(fill(&mut facts, found)).or(start);
        }
        identity::read(&facts, mapping, start).map_err(fail)
    }

    /// The earliest and the latest stamp of the log, if it has a time column.
    fn clock_span(&self) -> Result<Option<ClockSpan>, Error> {
        let table = self.main();
        let column = table.clock.column.as_ref().filter(|column| table.files[0].has(column));
        let Some(column) = column else { return Ok(None) };
        let stamps = table.stamps(&SampleSelector::every_row(column), None)?;
        let (earliest_s, latest_s) = span(&stamps.seconds);
        Ok((earliest_s <= latest_s).then_some(ClockSpan { origin: stamps.origin, earliest_s, latest_s }))
    }

    /// The sheet that holds a channel.
    fn sheet(&self, map: &ChannelMapping) -> Option<&RowTable> {
        self.tables.get(&map.group)
    }

    /// What channels may be called in the sheet of one.
    fn names_for(&self, map: &ChannelMapping) -> Result<Arc<BTreeSet<String>>, Error> {
        self.sheet(map).map_or_else(|| Ok(Arc::default()), RowTable::names)
    }

    /// The actuators whose columns are here, in order of their names.
    ///
    /// `own` is the position of a log that holds one actuator and does not name it in its columns.
    ///
    /// # Errors
    /// `ErrorKind::NoPosition` when no column fits; `ErrorKind::ColumnMissing` or
    /// `ErrorKind::IdentityMissing` in a log of one actuator.
    pub fn actuators(
        &self,
        channels: &Channels,
        own: Option<&Position>,
    ) -> Result<Vec<ActuatorColumns>, Error> {
        if self.normalized.is_some() {
            let of = |position: &Position| ActuatorColumns {
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
    fn no_position(&self, channels: &Channels, partly: &[ActuatorColumns]) -> Result<Error, Error> {
        let mut fewest = (usize::MAX, &channels.motor_position);
        for map in Role::NEEDED.iter().filter_map(|role| channels.of(*role)) {
            let name = |at: &ActuatorColumns| column_at(&map.column, &at.position);
            let count = partly.iter().filter(|at| !at.lacking.contains(&name(at))).count();
            if count < fewest.0 {
                fewest = (count, map);
            }
        }
        let (pattern, columns) =
            (fewest.1.column.clone(), self.names_for(fewest.1)?.iter().cloned().collect());
        Ok(self.main().error(ErrorKind::NoPosition { pattern, columns }))
    }

    /// The positions that rows or names speak of; none when neither can.
    fn position_names(&self, channels: &Channels) -> Result<Option<BTreeSet<String>>, Error> {
        if let Some(found) = self.main().row_positions()? {
            return Ok(Some(found));
        }
        let (mut is_open, mut found) = (false, BTreeSet::new());
        for map in Role::NEEDED.iter().filter_map(|role| channels.of(*role)).flat_map(ChannelMapping::choices)
        {
            let pattern = ColumnPattern::new(&map.column);
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
    ) -> Result<Vec<ActuatorColumns>, Error> {
        let Some(position) = own else {
            let looked = vec!["the names of columns (no `{position}` in them)".into()];
            return Err(self.main().error(ErrorKind::IdentityMissing { fact: "position", looked }));
        };
        let only = self.columns_of(channels, position.clone())?;
        match only.lacking.first() {
            None => Ok(vec![only]),
            Some(column) => Err(self.main().lacks(column)),
        }
    }

    fn columns_of(&self, channels: &Channels, position: Position) -> Result<ActuatorColumns, Error> {
        let mut columns = [None, None, None, None];
        let mut lacking = Vec::new();
        for (slot, role) in columns.iter_mut().zip(Role::ALL) {
            let Some(map) = channels.of(role) else {
                if role == Role::Screw && !channels.output.is_locked() {
                    lacking.push("`channel.screw_position`, which is not mapped".to_owned());
                }
                continue;
            };
            let first = self.present(map, &position)?.into_iter().next();
            let name = column_at(&map.column, &position);
            if first.is_none() && role != Role::Temperature {
                // A group without a file is no lack of this actuator, and neither is a struct in a number's place.
                self.sheet_of(map)?.check_no_struct(&name, &*self.names_for(map)?)?;
                lacking.push(name.clone());
            }
            *slot = first.map(|(_, name)| name).or((role != Role::Temperature).then_some(name));
        }
        Ok(ActuatorColumns { position, columns, lacking })
    }

    /// A channel and its alternatives, as far as the log has them, with their names here.
    fn present<'c>(
        &self,
        map: &'c ChannelMapping,
        position: &Position,
    ) -> Result<Vec<(&'c ChannelMapping, String)>, Error> {
        let mut found = Vec::new();
        for choice in map.choices() {
            let name = column_at(&choice.column, position);
            if self.names_for(choice)?.contains(&name) {
                found.push((choice, name));
            }
        }
        Ok(found)
    }

    /// The leaves that these actuators need, sheet by sheet.
    fn leaves(&self, used: &[(&Channels, &ActuatorColumns)]) -> Vec<(&RowTable, BTreeSet<String>)> {
        let mut found: Vec<_> = self.tables.values().map(|sheet| (sheet, BTreeSet::new())).collect();
        self.each_use(used, |sheet, _, samples| {
            let of_sheet = found.iter_mut().find(|(other, _)| std::ptr::eq(*other, sheet));
            of_sheet.into_iter().for_each(|(_, leaves)| leaves.extend(sheet.leaves_of(samples)));
        });
        found
    }

    /// Announces the samples of actuators that will be read. Where rows belong to actuators or channels, one pass
    /// over the files then gathers the rows of all of them.
    ///
    /// # Errors
    /// When channels are named by a column, and it cannot be read.
    pub fn announce(&self, used: &[(&Channels, &ActuatorColumns)]) -> Result<(), Error> {
        for table in self.tables.values().filter(|table| table.layout.name_column.is_some()) {
            table.names()?;
        }
        self.each_use(used, |sheet, position, samples| sheet.announce(samples, position));
        Ok(())
    }

    /// Hands over the samples that these actuators need, with their table and their position.
    fn each_use(
        &self,
        used: &[(&Channels, &ActuatorColumns)],
        mut take: impl FnMut(&RowTable, &str, &SampleSelector),
    ) {
        for (channels, at) in used {
            let position = at.position.as_str();
            let named = |column: &String| column_at(column, &at.position);
            let conditions: Vec<ChannelMapping> = channels.when.iter().map(ChannelMapping::from).collect();
            let maps = Role::ALL.iter().filter_map(|role| channels.of(*role));
            for map in maps.flat_map(ChannelMapping::choices).chain(&conditions) {
                let Some(sheet) = self.sheet(map) else { continue };
                let samples = sheet.samples(&named(&map.column), position);
                take(sheet, position, &samples);
                if let Some(valid) = &map.valid_column {
                    take(sheet, position, &sheet.samples(&named(valid), position));
                }
                // The channel's own stamps lie in the rows of the channel.
                if let Some(time) = &map.time_column {
                    take(sheet, position, &SampleSelector { leaf: named(time), ..samples });
                }
            }
        }
    }

    /// blake3 of the footers and the chunks of every column that the positions, the clock and the
    /// identity use.
    ///
    /// # Errors
    /// When a file cannot be read.
    pub fn digest(&self, used: &[(&Channels, &ActuatorColumns)]) -> Result<String, Error> {
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
    pub fn read_actuator(
        &self,
        at: &ActuatorColumns,
        channels: &Channels,
        geometry: Geometry,
    ) -> Result<ActuatorChannels, Error> {
        if let Some(normalized) = &self.normalized {
            return normalized.read_actuator(&self.main().files[0], at.position.clone(), geometry);
        }
        let read = self.read_channels(ChannelRequest { at, channels, geometry });
        for sheet in self.tables.values() {
            sheet.release(at.position.as_str());
        }
        read
    }

    fn read_channels(&self, sought: ChannelRequest<'_>) -> Result<ActuatorChannels, Error> {
        let ChannelRequest { at, channels, .. } = sought;
        let ReferenceChannel { channel: motor, master, selection, mut flags } = self.motor(sought)?;
        let read = |role: Role, from: &SampleSelection| self.follower(role, sought, &master, from);
        let output_locked = channels.output.is_locked();
        let (screw, screw_flags) = if output_locked {
            (selection.cut(vec![0.0; motor.values.len()].into()), Vec::new())
        } else {
            read(Role::Screw, &selection)?
        };
        let (load, load_flags) = read(Role::Load, &selection)?;
        // The mean of the flight, whatever counts of it.
        let whole = SampleSelection::whole(&master.line);
        let temperature = channels.temperature.as_ref().and_then(|_| read(Role::Temperature, &whole).ok());
        let temperature_c = temperature.and_then(|(read, _)| mean(&read.values));
        flags.extend(screw_flags.into_iter().chain(load_flags));
        let read =
            RawChannels { motor, screw, load, is_relative: channels.is_relative(), output_locked, selection };
        Ok(assemble(at.position.clone(), read, &master.line, temperature_c, flags))
    }

    /// The segments of the motor's clock in which every sample filter holds; cached for equal keys.
    fn selected(
        &self,
        sought: ChannelRequest<'_>,
        master: &ChannelSampling<'_>,
    ) -> Result<SampleSelection, Error> {
        let ChannelRequest { at, channels, .. } = sought;
        if channels.when.is_empty() {
            return Ok(SampleSelection::whole(&master.line));
        }
        let position = at.position.as_str();
        let named = |column: &String| column_at(column, &at.position);
        let of = |when: &SampleFilter| {
            let samples = self.sheet_of(&ChannelMapping::from(when))?.samples(&named(&when.column), position);
            Ok((samples, when.time_column.as_ref().map(named)))
        };
        let asked = SelectionKey {
            when: channels.when.clone(),
            of: channels.when.iter().map(of).collect::<Result<_, Error>>()?,
            group: master.map.group.clone(),
            clock: master.clock_key(),
        };
        let mut before = self.selected.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, selection)) = before.as_ref().filter(|(known, _)| *known == asked) {
            return Ok(selection.clone());
        }
        let selection = self.select(sought, master)?;
        *before = Some((asked, selection.clone()));
        Ok(selection)
    }

    fn select(
        &self,
        sought: ChannelRequest<'_>,
        master: &ChannelSampling<'_>,
    ) -> Result<SampleSelection, Error> {
        let ChannelRequest { at, channels, geometry } = sought;
        let line = &master.line;
        let mut segments = line.segments.clone();
        for condition in &channels.when {
            let map = ChannelMapping::from(condition);
            let name = column_at(&map.column, &at.position);
            let sheet = self.sheet_of(&map)?;
            if !self.names_for(&map)?.contains(&name) {
                return Err(sheet.lacks(&name));
            }
            // A state stands until the next one comes, as a slow load does.
            let position = at.position.as_str();
            let own = ChannelSampling::new(sheet, &map, &name, position);
            let Channel { mut values, .. } = channel_reader::follow(master, own, Role::Load, geometry, None)?;
            zero_order_hold(&mut values, &line.segments, line.step_s);
            segments = condition.within(&values, &segments, line.step_s);
        }
        Ok(SampleSelection::of(segments, line))
    }

    /// The motor position, whose clock all other channels follow.
    fn motor<'c>(&'c self, sought: ChannelRequest<'c>) -> Result<ReferenceChannel<'c>, Error> {
        let ChannelRequest { at, channels, geometry } = sought;
        let read = |map: &'c ChannelMapping, name: &str| {
            let sheet = self.sheet_of(map)?;
            let master = ChannelSampling::new(sheet, map, name, at.position.as_str()).with_clock()?;
            if !channels.when.is_empty() {
                // Conditions ask for memory by the rows that a footer declares: its pages must hold as many.
                master.check_rows()?;
            }
            let selection = self.selected(sought, &master)?;
            let read = selection.cut(master.own(geometry, selection.wanted())?);
            Ok((read, selection.apart, (master, selection)))
        };
        let (channel, (master, selection), flags) = self.first_alive(Role::Motor, sought, read)?;
        self.check_one_flight(&master)?;
        Ok(ReferenceChannel { channel, master, selection, flags })
    }

    /// Whether the motor's clock is that of one flight, where no column names the flight of each row.
    fn check_one_flight(&self, sampling: &ChannelSampling<'_>) -> Result<(), Error> {
        let identity = &self.mapping.identity;
        let fields = [IdentityField::FlightId, IdentityField::DepartureUtc];
        // Where a file holds many flights, a flight number may come again on another day.
        if !identity.by_row && fields.iter().any(|field| identity.columns.contains_key(field)) {
            return Ok(());
        }
        let (sheet, map) = (sampling.sheet, sampling.map);
        let column = map.time_column.as_ref().or(sheet.clock.column.as_ref()).map_or("", String::as_str);
        sampling.line.check_one_flight(&sheet.clock, column).map_err(|fault| sheet.error(fault))
    }

    /// A channel on the motor's clock, and its flags.
    fn follower(
        &self,
        role: Role,
        sought: ChannelRequest<'_>,
        master: &ChannelSampling<'_>,
        selection: &SampleSelection,
    ) -> Result<(Channel, Vec<String>), Error> {
        let read = |map: &ChannelMapping, name: &str| {
            let own = ChannelSampling::new(self.sheet_of(map)?, map, name, sought.at.position.as_str());
            let read = channel_reader::follow(master, own, role, sought.geometry, selection.wanted())?;
            Ok((selection.cut(read), selection.apart, ()))
        };
        self.first_alive(role, sought, read).map(|(channel, (), flags)| (channel, flags))
    }

    /// The first of redundant channels that is alive, else the first one, with what `read` gave beside it, and a flag
    /// where it is not the first. `read` gives a channel, how many of its samples no filter left, and the rest.
    fn first_alive<'c, T>(
        &self,
        role: Role,
        sought: ChannelRequest<'c>,
        read: impl Fn(&'c ChannelMapping, &str) -> Result<(Channel, usize, T), Error>,
    ) -> Result<(Channel, T, Vec<String>), Error> {
        let ChannelRequest { at, channels, .. } = sought;
        let map = channels.of(role).unwrap_or(&channels.motor_position);
        let choices = self.present(map, &at.position)?;
        let mut found = None;
        for (k, (map, name)) in choices.iter().enumerate() {
            let (channel, apart, rest) = read(map, name)?;
            let is_alive = choices.len() == 1 || channel_reader::lives(&channel.values, apart);
            if is_alive || found.is_none() {
                found = Some((channel, apart, rest, k));
            }
            if is_alive {
                break;
            }
        }
        let Some((mut channel, apart, rest, k)) = found else {
            let name = column_at(&map.column, &at.position);
            return Err(self.sheet(map).unwrap_or(self.main()).lacks(&name));
        };
        let counted = channel.values.len() - apart;
        if (counted > 0 || apart == 0) && !channel.values.iter().any(|v| v.is_finite()) {
            let (column, rows) = (choices[k].1.clone(), counted as u64);
            return Err(self.main().error(ErrorKind::AllMissing { column, rows }));
        }
        channel.column = Some(choices[k].1.clone());
        let flags = if k == 0 { Vec::new() } else { vec![format!("{}_alternative", role.as_str())] };
        Ok((channel, rest, flags))
    }

    fn sheet_of(&self, map: &ChannelMapping) -> Result<&RowTable, Error> {
        self.sheet(map).ok_or_else(|| {
            self.main().error(ErrorKind::GroupMissing { group: map.group.clone().unwrap_or_default() })
        })
    }
}

/// The actuator that is read: its columns, how its channels are read, and what its angles turn.
#[derive(Clone, Copy)]
struct ChannelRequest<'c> {
    at: &'c ActuatorColumns,
    channels: &'c Channels,
    geometry: Geometry,
}

/// The motor position's values, their sampling, the selected samples, and quality flags.
struct ReferenceChannel<'c> {
    channel: Channel,
    master: ChannelSampling<'c>,
    selection: SampleSelection,
    flags: Vec<String>,
}

/// The column of a pattern at a position.
fn column_at(pattern: &str, position: &Position) -> String {
    ColumnPattern::new(pattern).column_for(position.as_str())
}

/// Identity fields in the files of a row table.
fn facts(sheet: &RowTable, map: &IdentityMapping) -> Result<IdentityFields, Error> {
    let first = &sheet.files[0];
    let mut facts: IdentityFields = map.values.clone();
    facts.extend(identity::from_hive_path(first.path(), &map.folders));
    if let Some(expression) = &map.path {
        facts.extend(identity::from_path(first.path(), expression).map_err(|f| sheet.error(f))?);
    }
    for (fact, column) in &map.columns {
        // A column the log lacks may still be covered by another source; what is missing in all is named later.
        facts.extend(sheet.constant(column, fact.as_str())?.map(|text| (*fact, text)));
    }
    let stated = |(fact, key): (&IdentityField, &String)| Some((*fact, first.metadata_field(key)?));
    facts.extend(map.metadata.iter().filter_map(stated));
    Ok(facts)
}

/// Identity fields in a file of a group, from which its main log is found.
///
/// # Errors
/// As [`Log::open`] and [`Log::identity`].
pub fn companion_identity(
    path: &Path,
    mapping: &Mapping,
    group: &str,
    known: impl Fn(&IdentityFields, Option<Timestamp>) -> IdentityFields,
) -> Result<Identity, Error> {
    let (clock, layout, identity) = mapping.of_group(Some(group));
    let (clock, layout, identity) = (clock.clone(), layout.clone(), identity.clone());
    let alone = Mapping { identity, clock, layout, ..Mapping::default() };
    Log::open(&LogFiles::one(path), &Arc::new(alone))?.identity(known)
}
