//! One flight log: its identity, its actuators, and their channels in SI on one clock.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use jiff::Timestamp;
use jiff::tz::TimeZone;
use records::Position;

use crate::channel::si_conversion::Geometry;
use crate::channel::stats::span;
use crate::error::{self, Error, Fault};
use crate::log::assemble::{assemble, mean};
use crate::log::channel_reader::{Channel, ChannelSampling};
use crate::log::flight_rows::split_path;
use crate::log::identity::{self, ClockSpan, Identity, IdentityFields, LONGEST_FLIGHT_H};
use crate::log::normalized;
use crate::log::row_table::{RowTable, SampleSelector};
use crate::log::selection::SampleSelection;
use crate::log::types::{ActuatorChannels, ActuatorColumns, LogFiles};
use crate::mapping::column_pattern::{PLACEHOLDER, column_for, position_in};
use crate::mapping::{ChannelMapping, Channels, IdentityField, IdentityMapping, Mapping, Role};
use crate::parquet::log_file::LogFile;
use crate::time::clock::TimeOrigin;
use crate::time::zero_order_hold::zero_order_hold;

/// An open log.
#[derive(Debug)]
pub struct Log {
    /// The main log, and the files of each group that has some.
    tables: BTreeMap<Option<String>, RowTable>,
    mapping: Arc<Mapping>,
    /// Identity fields of a normalized log.
    normalized: Option<IdentityFields>,
    /// Selected samples of the previous actuator, with the conditions as text: most actuators have the same.
    selected: Mutex<Option<(String, SampleSelection)>>,
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
            let own = mapping.of_group(group.as_deref());
            let open = |path: &PathBuf| {
                let (path, flight_rows) = split_path(path, &own.identity);
                let mut file = LogFile::open(&path)?;
                file.flight_rows = flight_rows;
                Ok(file)
            };
            let files = paths.iter().map(open).collect::<Result<Vec<_>, _>>()?;
            tables.insert(group, RowTable::new(files, own));
        }
        let Some(main) = tables.get(&None) else {
            return Err(Fault::from(io::Error::from(io::ErrorKind::NotFound)).in_file(Path::new("")));
        };
        let normalized = normalized::facts(&main.files[0])?;
        let mut log = Self { tables, mapping: Arc::clone(mapping), normalized, selected: Mutex::new(None) };
        log.order_pieces()?;
        Ok(log)
    }

    /// The same open files, read by another mapping of the same kinds of files.
    #[must_use]
    pub fn with_mapping(mut self, mapping: &Arc<Mapping>) -> Self {
        for (group, table) in &mut self.tables {
            let own = mapping.of_group(group.as_deref());
            *table = RowTable::new(std::mem::take(&mut table.files), own);
        }
        Self { mapping: Arc::clone(mapping), selected: Mutex::new(None), ..self }
    }

    fn main(&self) -> &RowTable {
        &self.tables[&None]
    }

    /// Pieces of a flight follow each other in time, whatever their files are called.
    fn order_pieces(&mut self) -> Result<(), Error> {
        for table in self.tables.values_mut() {
            let Some(column) = table.clock.column.clone() else { continue };
            if table.files.len() < 2 {
                continue;
            }
            let mut starts = Vec::with_capacity(table.files.len());
            for file in std::mem::take(&mut table.files) {
                let alone = table.alone(file);
                let stamps = alone.stamps(&SampleSelector::every_row(&column), None)?;
                starts.push((stamps.origin, alone.files));
            }
            let first = starts[0].0;
            let since = |origin: &TimeOrigin| origin.since(first).unwrap_or(0.0);
            starts.sort_by(|a, b| since(&a.0).total_cmp(&since(&b.0)));
            table.files = starts.into_iter().flat_map(|(_, files)| files).collect();
        }
        Ok(())
    }

    /// Rows the footers of the main log declare.
    pub fn rows(&self) -> usize {
        self.main().rows()
    }

    /// Names and types of all columns, for `check`.
    pub fn column_types(&self) -> Vec<(String, String)> {
        let leaves = self.main().files.iter().flat_map(|file| &file.leaves);
        leaves.map(|leaf| (leaf.name.clone(), leaf.kind.to_string())).collect()
    }

    /// Whether every page of the columns of these actuators carries a checksum.
    ///
    /// # Errors
    /// When a page header cannot be read.
    pub fn has_page_checksums(&self, used: &[(&Channels, &ActuatorColumns)]) -> Result<bool, Error> {
        for (table, leaves) in self.leaves(used) {
            for file in &table.files {
                let names: Vec<&str> = leaves.iter().map(String::as_str).filter(|l| file.has(l)).collect();
                if !file.has_page_checksums(&names)? {
                    return Ok(false);
                }
            }
        }
        Ok(true)
    }

    /// Which flight this is; `known` fills what the log itself leaves open, from the other fields and the departure, which
    /// may be the first instant of its clock. That instant is read only where the log holds no departure and `known` finds
    /// no flight without it.
    ///
    /// # Errors
    /// When tail or departure stand nowhere, cannot be read, or change within the log.
    pub fn identity(
        &self,
        known: impl Fn(&IdentityFields, Option<Timestamp>) -> IdentityFields,
    ) -> Result<Identity, Error> {
        let fail = |fault: Fault| self.main().error(fault);
        if let Some(facts) = &self.normalized {
            let departure = facts.get(&IdentityField::DepartureUtc).and_then(|text| text.parse().ok());
            return identity::read(facts, &IdentityMapping::default(), departure).map_err(fail);
        }
        let mapping = &self.mapping.identity;
        let mut facts = facts(self.main(), mapping)?;
        let stated = facts.remove(&IdentityField::DepartureUtc).filter(|text| !text.trim().is_empty());
        // A day has several flights: the time of a date comes from the flights table, or from the clock.
        let mut date = stated.as_ref().and_then(|text| identity::date_alone(text, mapping));
        let stated = stated.filter(|_| date.is_none());
        let mut departure =
            stated.map(|text| identity::instant(text.trim(), mapping)).transpose().map_err(fail)?;
        // Adds what the flights table knows; returns the departure that it states.
        let fill = |facts: &mut IdentityFields, at: Option<Timestamp>| {
            let mut found = known(&identity::registered(facts, mapping, at), at);
            let departure = found.remove(&IdentityField::DepartureUtc);
            found.append(facts);
            *facts = found;
            departure
        };
        // Of several flights of one id, the one near noon of the date is that of the date.
        let noon = date.and_then(|date| TimeZone::UTC.to_timestamp(date.at(12, 0, 0, 0)).ok());
        let of_table = fill(&mut facts, departure.or(noon));
        if departure.is_none() {
            departure = of_table.as_ref().and_then(|text| text.parse().ok());
            date = of_table.and_then(|text| text.parse().ok()).or(date);
        }
        if departure.is_none() {
            let clock = self.clock_span()?;
            let absolute = clock.map_or(Ok(None), |clock| clock.start(mapping)).map_err(fail)?;
            departure = match (date, facts.get(&IdentityField::LandingUtc)) {
                (Some(date), _) => {
                    Some(identity::departure_on(date, absolute, clock, mapping).map_err(fail)?)
                }
                (None, Some(landing)) if absolute.is_none() => {
                    Some(identity::departure_before(landing, &facts, clock, mapping).map_err(fail)?)
                }
                _ => absolute,
            };
            if departure.is_some() {
                let of_table = fill(&mut facts, departure);
                departure = of_table.and_then(|text| text.parse().ok()).or(departure);
            }
        }
        identity::read(&facts, mapping, departure).map_err(fail)
    }

    /// The earliest and the latest stamp of the log, if it has a time column: of the rows around its middle one up to the next
    /// leap by more than a flight, since a recorder that was not set yet stamps rows years before.
    fn clock_span(&self) -> Result<Option<ClockSpan>, Error> {
        let table = self.main();
        let column = table.clock.column.as_ref().filter(|column| table.files[0].has(column));
        let Some(column) = column else { return Ok(None) };
        let stamps = table.stamps(&SampleSelector::every_row(column), None)?;
        let (before, after) = stamps.seconds.split_at(stamps.seconds.len() / 2);
        let middle_s = after.iter().copied().find(|s| !s.is_nan()).unwrap_or(f64::NAN);
        let mut last_s = middle_s;
        let mut is_near = |s: &f64| {
            let is_far = (s - last_s).abs() > 3600.0 * LONGEST_FLIGHT_H;
            last_s = if s.is_nan() { last_s } else { *s };
            !is_far
        };
        let from = before.len() - before.iter().rev().take_while(|s| is_near(s)).count();
        is_near(&middle_s);
        let until = before.len() + after.iter().take_while(|s| is_near(s)).count();
        let (earliest_s, latest_s) = span(&stamps.seconds[from..until]);
        Ok((earliest_s <= latest_s).then_some(ClockSpan { origin: stamps.origin, earliest_s, latest_s }))
    }

    fn table(&self, map: &ChannelMapping) -> Option<&RowTable> {
        self.tables.get(&map.group)
    }

    /// What channels may be called in the table of one.
    fn names_for(&self, map: &ChannelMapping) -> Result<Arc<BTreeSet<String>>, Error> {
        self.table(map).map_or_else(|| Ok(Arc::default()), RowTable::names)
    }

    /// The actuators whose columns are here, in order of their names.
    ///
    /// `own` is the position of a log that holds one actuator and does not name it in its columns.
    ///
    /// # Errors
    /// `no_position` when no column fits; `column_missing` or `identity_missing` in a log of one actuator.
    pub fn actuators(
        &self,
        channels: &Channels,
        own: Option<&Position>,
    ) -> Result<Vec<ActuatorColumns>, Error> {
        if self.normalized.is_some() {
            let of = |position: &Position| ActuatorColumns {
                position: position.clone(),
                columns: normalized::COLUMNS.map(|name| Some(name.to_owned())),
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
        let fitting = |map: &&ChannelMapping| {
            let is_here =
                |at: &&ActuatorColumns| !at.lacking.contains(&column_for(&map.column, at.position.as_str()));
            partly.iter().filter(is_here).count()
        };
        let needed = Role::NEEDED.iter().filter_map(|role| channels.of(*role));
        let fewest = needed.min_by_key(fitting).unwrap_or(&channels.motor_position);
        let columns: Vec<String> = self.names_for(fewest)?.iter().cloned().collect();
        Ok(self.main().error(error::no_position(&fewest.column, &columns)))
    }

    /// The positions that rows or names speak of; none when neither can.
    fn position_names(&self, channels: &Channels) -> Result<Option<BTreeSet<String>>, Error> {
        if let Some(column) = &self.main().layout.position_column {
            return Ok(Some(self.main().texts(column)?.as_ref().clone()));
        }
        let (mut is_open, mut found) = (false, BTreeSet::new());
        for map in Role::NEEDED.iter().filter_map(|role| channels.of(*role)).flat_map(ChannelMapping::choices)
        {
            if map.column.contains(PLACEHOLDER) {
                is_open = true;
                let names = self.names_for(map)?;
                let positions = names.iter().filter_map(|name| position_in(&map.column, name));
                found.extend(positions.map(str::to_owned));
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
            let looked = ["the names of columns (no `{position}` in them)".to_owned()];
            return Err(self.main().error(error::identity_missing("position", &looked)));
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
            let name = column_for(&map.column, position.as_str());
            if first.is_none() && role != Role::Temperature {
                // A group without a file is no lack of this actuator, and neither is a struct in a number's place.
                self.table_of(map)?.check_no_struct(&name, &*self.names_for(map)?)?;
                lacking.push(name.clone());
            }
            *slot = first.map(|own| own.column().to_owned()).or((role != Role::Temperature).then_some(name));
        }
        Ok(ActuatorColumns { position, columns, lacking })
    }

    /// A channel and its alternatives, as far as the log has them.
    fn present<'c>(
        &'c self,
        map: &'c ChannelMapping,
        position: &Position,
    ) -> Result<Vec<ChannelSampling<'c>>, Error> {
        let mut found = Vec::new();
        for choice in map.choices() {
            let Some(table) = self.table(choice) else { continue };
            let own = ChannelSampling::new(table, choice, position.as_str());
            if table.names()?.contains(own.column()) {
                found.push(own);
            }
        }
        Ok(found)
    }

    /// The leaves that these actuators need, table by table.
    fn leaves(&self, used: &[(&Channels, &ActuatorColumns)]) -> Vec<(&RowTable, BTreeSet<String>)> {
        let mut found: Vec<_> = self.tables.values().map(|table| (table, BTreeSet::new())).collect();
        self.each_use(used, |own, _| {
            for (_, leaves) in found.iter_mut().filter(|(table, _)| std::ptr::eq(*table, own.table)) {
                leaves.extend(own.selectors().flat_map(|samples| own.table.leaves_of(&samples)));
            }
        });
        found
    }

    /// Announces the samples of actuators that will be read. Where rows belong to actuators or channels, one pass
    /// over the files then gathers the rows of all of them.
    pub fn announce(&self, used: &[(&Channels, &ActuatorColumns)]) {
        self.each_use(used, |own, position| {
            // No row group has rows of a channel that the log lacks.
            if own.table.names().is_ok_and(|names| names.contains(own.column())) {
                own.selectors().for_each(|samples| own.table.announce(&samples, position));
            }
        });
    }

    /// Hands over the channels and conditions of these actuators, each with its position.
    fn each_use(
        &self,
        used: &[(&Channels, &ActuatorColumns)],
        mut take: impl FnMut(&ChannelSampling<'_>, &str),
    ) {
        for (channels, at) in used {
            let conditions: Vec<ChannelMapping> = channels.when.iter().map(ChannelMapping::from).collect();
            let maps = Role::ALL.iter().filter_map(|role| channels.of(*role));
            for map in maps.flat_map(ChannelMapping::choices).chain(&conditions) {
                if let Some(table) = self.table(map) {
                    let position = at.position.as_str();
                    take(&ChannelSampling::new(table, map, position), position);
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
        let mut hash = blake3::Hasher::new();
        for (table, mut leaves) in self.leaves(used) {
            leaves.extend(self.mapping.identity.columns.values().cloned());
            if self.normalized.is_some() {
                leaves.extend(normalized::COLUMNS.map(str::to_owned));
            }
            let names: Vec<&str> = leaves.iter().map(String::as_str).collect();
            for file in &table.files {
                file.feed(&names, &mut hash)?;
            }
        }
        Ok(hash.finalize().to_hex().to_string())
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
        if self.normalized.is_some() {
            return normalized::read_actuator(&self.main().files[0], at.position.clone(), geometry);
        }
        let read = ActuatorReader { log: self, at, channels, geometry }.read();
        self.tables.values().for_each(|table| table.partition.release(at.position.as_str()));
        read
    }

    fn table_of(&self, map: &ChannelMapping) -> Result<&RowTable, Error> {
        self.table(map).ok_or_else(|| {
            let group = map.group.as_deref().unwrap_or_default();
            let message = format!("no file of group `{group}` belongs to this flight");
            let hint =
                "check that the file has arrived and has the same tail and flight (see `freeplay check`)";
            self.main().error(Fault::new("group_missing", message, hint))
        })
    }
}

/// An actuator that is read: its columns, how its channels are read, and what its angles turn.
#[derive(Clone, Copy)]
struct ActuatorReader<'c> {
    log: &'c Log,
    at: &'c ActuatorColumns,
    channels: &'c Channels,
    geometry: Geometry,
}

impl<'c> ActuatorReader<'c> {
    fn read(self) -> Result<ActuatorChannels, Error> {
        let geometry = self.geometry;
        let (motor, (master, selection)) = self.first_alive(Role::Motor, |own| {
            let master = own.with_clock()?;
            if !self.channels.when.is_empty() {
                // Conditions ask for memory by the rows that a footer declares: its pages must hold as many.
                master.check_rows()?;
            }
            let selection = self.selected(&master)?;
            let read = master.clone().follow(&master, Role::Motor, geometry, selection.wanted())?;
            Ok((selection.cut(read), (master, selection)))
        })?;
        self.check_one_flight(&master)?;
        let follower = |role: Role, selection: &SampleSelection| {
            self.first_alive(role, |own| {
                own.follow(&master, role, geometry, selection.wanted()).map(|read| (selection.cut(read), ()))
            })
        };
        let screw = if self.channels.output.is_locked() {
            selection.cut(vec![0.0; motor.values.len()].into())
        } else {
            follower(Role::Screw, &selection)?.0
        };
        let load = follower(Role::Load, &selection)?.0;
        // The mean of the flight, whatever counts of it.
        let whole = SampleSelection::whole(&master.base);
        let temperature = self.channels.temperature.as_ref();
        let temperature = temperature.and_then(|_| follower(Role::Temperature, &whole).ok());
        let temperature_c = temperature.and_then(|(read, ())| mean(&read.values));
        let (position, read) = (self.at.position.clone(), [motor, screw, load]);
        Ok(assemble(position, read, self.channels, selection, &master.base, temperature_c))
    }

    /// Reads redundant channels until one is alive, and returns it as `read` gave it; the first channel where none is alive.
    fn first_alive<T>(
        self,
        role: Role,
        read: impl Fn(ChannelSampling<'c>) -> Result<(Channel, T), Error>,
    ) -> Result<(Channel, T), Error> {
        let map = self.channels.of(role).unwrap_or(&self.channels.motor_position);
        let choices = self.log.present(map, &self.at.position)?;
        let (count, mut found) = (choices.len(), None);
        for (k, own) in choices.into_iter().enumerate() {
            let name = own.column().to_owned();
            let (mut channel, rest) = read(own)?;
            let is_alive = count == 1 || channel.is_alive();
            if is_alive || found.is_none() {
                (channel.column, channel.is_alternative) = (Some(name), k > 0);
                found = Some((channel, rest));
            }
            if is_alive {
                break;
            }
        }
        let Some((channel, rest)) = found else {
            let name = column_for(&map.column, self.at.position.as_str());
            return Err(self.log.table(map).unwrap_or(self.log.main()).lacks(&name));
        };
        let counted = channel.values.len() - channel.excluded;
        if (counted > 0 || channel.excluded == 0) && !channel.values.iter().any(|v| v.is_finite()) {
            let column = channel.column.unwrap_or_default();
            return Err(self.log.main().error(error::channel_empty(&column, counted)));
        }
        Ok((channel, rest))
    }

    /// The segments of the motor's clock in which every sample filter holds.
    fn selected(self, master: &ChannelSampling<'_>) -> Result<SampleSelection, Error> {
        let (base, filters) = (&master.base, &self.channels.when);
        if filters.is_empty() {
            return Ok(SampleSelection::whole(base));
        }
        let maps: Vec<ChannelMapping> = filters.iter().map(ChannelMapping::from).collect();
        let sampled = |map| {
            let table = self.log.table_of(map)?;
            let own = ChannelSampling::new(table, map, self.at.position.as_str());
            if table.names()?.contains(own.column()) { Ok(own) } else { Err(table.lacks(own.column())) }
        };
        let conditions = maps.iter().map(sampled).collect::<Result<Vec<_>, _>>()?;
        let samples: Vec<_> = conditions.iter().map(|own| (&own.samples, &own.time_column)).collect();
        let key = format!("{:?}", (filters, samples, master.clock_key()));
        let mut before = self.log.selected.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, selection)) = before.as_ref().filter(|(known, _)| *known == key) {
            return Ok(selection.clone());
        }
        let mut segments = base.segments.clone();
        for (filter, own) in filters.iter().zip(conditions) {
            // A state stands until the next one comes, as a slow load does.
            let mut values = own.follow(master, Role::Load, self.geometry, None)?.values;
            zero_order_hold(&mut values, &base.segments, base.step_s);
            segments = filter.within(&values, &segments, base.step_s);
        }
        let selection = SampleSelection::of(segments, base);
        *before = Some((key, selection.clone()));
        Ok(selection)
    }

    /// Whether the motor's clock is that of one flight, where no column names the flight of each row.
    fn check_one_flight(self, master: &ChannelSampling<'_>) -> Result<(), Error> {
        let identity = &self.log.mapping.identity;
        let fields = [IdentityField::FlightId, IdentityField::DepartureUtc];
        // Where a file holds many flights, a flight number may come again on another day.
        if !identity.by_row && fields.iter().any(|field| identity.columns.contains_key(field)) {
            return Ok(());
        }
        let (table, map) = (master.table, master.map);
        let column = map.time_column.as_ref().or(table.clock.column.as_ref()).map_or("", String::as_str);
        let checked = master.base.check_one_flight(&table.clock);
        checked.map_err(|fault| table.error(fault.column(column)))
    }
}

/// Identity fields in the files of a row table.
fn facts(table: &RowTable, map: &IdentityMapping) -> Result<IdentityFields, Error> {
    let first = &table.files[0];
    let mut facts: IdentityFields = map.values.clone();
    facts.extend(identity::from_hive_path(&first.path, &map.folders));
    if let Some(expression) = &map.path {
        facts.extend(identity::from_path(&first.path, expression).map_err(|f| table.error(f))?);
    }
    for (fact, column) in &map.columns {
        // A column the log lacks may still be covered by another source; what is missing in all is named later.
        facts.extend(table.constant(column, fact.as_str())?.map(|text| (*fact, text)));
    }
    let stated = |(fact, key): (&IdentityField, &String)| Some((*fact, first.metadata_field(key)?));
    facts.extend(map.metadata.iter().filter_map(stated));
    Ok(facts)
}
