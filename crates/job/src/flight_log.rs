//! One flight log, from files to gap records.

use std::collections::{BTreeMap, BTreeSet};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use ingest::log::flight_rows;
use ingest::mapping::Output;
use ingest::mapping::column_pattern::nearest;
use ingest::{
    ActuatorChannels, ActuatorColumns, Channels, Identity, IdentityMapping, Log, LogFiles, Mapping,
};
use jiff::{SignedDuration, Timestamp};
use records::{
    Diagnostic, Flight, GapEstimate, GapRecord, Installation, Installations, PartNumber, Position, Provenance,
};

use crate::{Config, Part, estimate, panic};

/// Time zones and clocks that drift explain no more than this.
const MAX_AHEAD: SignedDuration = SignedDuration::from_hours(24);

/// An actuator of a log, and how its channels are read.
#[derive(Debug)]
pub struct Actuator {
    /// Its columns.
    pub columns: ActuatorColumns,
    mapping: Arc<Mapping>,
}

/// Which flight a log is and what it holds, before any channel is read.
#[derive(Debug)]
pub struct FlightLog<'c> {
    /// Its opened files.
    pub log: Log,
    /// Its name in records and diagnostics.
    pub display_name: String,
    config: &'c Config,
    installations: &'c Installations,
    /// Which flight it is.
    pub identity: Identity,
    all: Vec<Actuator>,
    /// blake3 of what will be read.
    pub digest: String,
}

impl<'c> FlightLog<'c> {
    /// Opens a log; `display_name` is its name in records and diagnostics.
    ///
    /// # Errors
    /// A diagnostic when the log cannot be read or identified.
    pub fn open(
        files: &LogFiles,
        display_name: &str,
        config: &'c Config,
        installations: &'c Installations,
    ) -> Result<Self, Diagnostic> {
        let in_log = |e: ingest::Error| e.diagnostic().in_file(display_name);
        let log = Log::open(files, config.base_mapping()).map_err(in_log)?;
        let identity = identity_of(&log, files, config).map_err(in_log)?;
        check_not_ahead(identity.flight.departure_utc, Timestamp::now())
            .map_err(|d| d.in_file(display_name))?;
        check_tail(&identity, display_name, config)?;
        let log = log.with_mapping(&config.mapping(&identity.flight.tail_number, None));
        let all = map_actuators(&log, &identity, config, installations).map_err(in_log)?;
        let used = used(&all);
        let digest = log.digest(&used).map_err(in_log)?;
        log.announce(&used);
        let display_name = display_name.to_owned();
        Ok(Self { log, display_name, config, installations, identity, all, digest })
    }

    /// Whether every page that is read carries a checksum.
    ///
    /// # Errors
    /// A diagnostic when a page header cannot be read.
    pub fn is_checked(&self) -> Result<bool, Diagnostic> {
        let checked = self.log.has_page_checksums(&used(&self.all));
        checked.map_err(|e| e.diagnostic().in_file(&self.display_name))
    }

    /// Names of the positions, in order.
    pub fn position_names(&self) -> Vec<Position> {
        self.all.iter().map(|at| at.columns.position.clone()).collect()
    }

    /// The actuators of the log. A position that lacks a channel counts only where a unit is installed:
    /// `battery_load` may fit a pattern without being an actuator.
    pub fn actuators(&self) -> impl Iterator<Item = &Actuator> {
        let tail = &self.identity.flight.tail_number;
        // Which columns a position has may depend on its part, so a position without a unit may lack some.
        let booked = |at: &Position| !self.installations.of_position(tail.as_str(), at.as_str()).is_empty();
        self.all.iter().filter(move |at| at.columns.lacking.is_empty() || booked(&at.columns.position))
    }

    /// The actuator in a position that the log had when its records were stored.
    ///
    /// # Errors
    /// A diagnostic when the log has no such position any more.
    pub fn actuator_at(&self, position: &str) -> Result<&Actuator, Diagnostic> {
        self.all.iter().find(|at| at.columns.position.as_str() == position).ok_or_else(|| {
            Diagnostic::new("no_position", format!("the log has no position {position} any more"))
                .in_file(&self.display_name)
        })
    }

    /// Estimates one actuator of the log; `of_run` is the provenance that all records of a run share.
    ///
    /// # Errors
    /// A diagnostic when the actuator cannot be used; the others of the log are not affected.
    pub fn record(&self, at: &Actuator, of_run: &Provenance) -> Result<GapRecord, Diagnostic> {
        let in_file = |diagnostic: Diagnostic| diagnostic.in_file(&self.display_name);
        let (installation, part) = self.unit(at).map_err(in_file)?;
        let (estimate, channels) = self.estimate(at, part).map_err(in_file)?;
        channels.into_iter().for_each(ActuatorChannels::recycle_buffers);
        Ok(GapRecord {
            flight: self.identity.flight.clone(),
            position: at.columns.position.clone(),
            part_number: installation.unit().0.clone(),
            serial_number: installation.unit().1.clone(),
            unit_hours: installation.unit_hours(self.identity.flight.tail_hours_end),
            estimate,
            provenance: Provenance {
                log_path: self.display_name.clone(),
                log_digest: self.digest.clone(),
                config_digest: self.config_digest(installation),
                ..of_run.clone()
            },
        })
    }

    /// Digest of the settings of a unit's estimate.
    pub fn config_digest(&self, installation: &Installation) -> String {
        self.config.digest(&self.identity.flight.tail_number, &installation.part_number).to_string()
    }

    /// The unit that sat in a position that day, and the settings of its part.
    ///
    /// # Errors
    /// A diagnostic when no unit is installed there, or the part is not configured.
    pub fn unit(&self, at: &Actuator) -> Result<(&'c Installation, &'c Part), Diagnostic> {
        let (flight, position) = (&self.identity.flight, &at.columns.position);
        let installation = self
            .installations
            .installed_at(&flight.tail_number, position, flight.departure_utc)
            .ok_or_else(|| no_installation(&self.identity, position, self.installations))?;
        Ok((installation, part_of(self.config, &installation.part_number)?))
    }

    /// Estimates one actuator as a given part, regardless of the installations table. Its channels are returned, too,
    /// unless the log lacks one of them.
    ///
    /// # Errors
    /// A diagnostic when its channels cannot be read.
    pub fn estimate(
        &self,
        at: &Actuator,
        part: &Part,
    ) -> Result<(GapEstimate, Option<ActuatorChannels>), Diagnostic> {
        if !at.columns.lacking.is_empty() {
            return Ok((GapEstimate::refused("channel_unmapped"), None));
        }
        let channels = self.channels(at, part)?;
        Ok((estimate::estimate(&channels, part, &self.config.document.estimate)?, Some(channels)))
    }

    /// Reads the channels of one actuator of a given part.
    ///
    /// # Errors
    /// A diagnostic when they cannot be read.
    pub fn channels(&self, at: &Actuator, part: &Part) -> Result<ActuatorChannels, Diagnostic> {
        let read = self.log.read_actuator(&at.columns, &at.mapping.channels, part.geometry);
        read.map_err(|e| e.diagnostic().in_file(&self.display_name))
    }
}

fn used(all: &[Actuator]) -> Vec<(&Channels, &ActuatorColumns)> {
    all.iter().map(|at| (&at.mapping.channels, &at.columns)).collect()
}

/// Passes the channels of every actuator of a log to `take`, all as those of one part. The log needs no identity.
///
/// # Errors
/// A diagnostic when the log or an actuator in it cannot be read, or when `take` fails.
pub fn read_as_part(
    files: &LogFiles,
    display_name: &str,
    config: &Config,
    number: &PartNumber,
    mut take: impl FnMut(ActuatorChannels, &Part) -> Result<(), Diagnostic>,
) -> Result<(), Diagnostic> {
    let part = part_of(config, number)?;
    let in_log = |e: ingest::Error| e.diagnostic().in_file(display_name);
    let log = Log::open(files, config.base_mapping()).map_err(in_log)?;
    let mut channels = config.base_mapping().channels.clone();
    if part.settings.output.is_locked() {
        channels.output = Output::Locked;
    }
    // A log of one actuator has no name for it here, but needs one to be asked by.
    let own = Position::new("actuator").map_err(|e| Diagnostic::new("empty_name", e))?;
    let mut positions = log.actuators(&channels, Some(&own)).map_err(in_log)?;
    positions.retain(|at| at.lacking.is_empty());
    let used: Vec<_> = positions.iter().map(|at| (&channels, at)).collect();
    log.announce(&used);
    for at in &positions {
        let read = log.read_actuator(at, &channels, part.geometry).map_err(in_log)?;
        take(read, part).map_err(|diagnostic| diagnostic.in_file(display_name))?;
    }
    Ok(())
}

/// The settings of a part number.
///
/// # Errors
/// A diagnostic when the configuration does not know it.
pub fn part_of<'c>(config: &'c Config, number: &PartNumber) -> Result<&'c Part, Diagnostic> {
    config.parts.get(number).ok_or_else(|| {
        let near = nearest(number.as_str(), config.parts.keys().map(PartNumber::as_str));
        let near = near.map(|near| format!("nearest: {near}; correct the installations table, or "));
        let hint =
            format!("{}add `[part.\"{number}\"]` to {}", near.unwrap_or_default(), config.file.display());
        let what = format!("part number {number} is installed, but not configured");
        Diagnostic::new("part_unknown", what).hint(hint)
    })
}

/// Why no unit has a log's channels. The text is the same for all logs of one cause, so that it is reported once.
fn no_installation(id: &Identity, position: &Position, installations: &Installations) -> Diagnostic {
    let (tail, at) = (&id.flight.tail_number, id.flight.departure_utc);
    let of_tail = installations.of_tail(tail);
    if of_tail.is_empty() {
        let near = nearest(tail.as_str(), installations.iter().map(|stay| stay.tail_number.as_str()));
        let near = near.map(|near| format!("nearest: {near}; ")).unwrap_or_default();
        let hint = format!("{near}compare the spelling in logs and table; then `freeplay run --retry`");
        let what = format!("the installations table does not know tail {tail}");
        return Diagnostic::new("tail_unknown", what).hint(hint);
    }
    let stays = installations.of_position(tail.as_str(), position.as_str());
    let day = |at: Timestamp| at.strftime("%Y-%m-%d %H:%M");
    let before = stays.iter().filter_map(|stay| stay.removed_utc).filter(|removed| *removed <= at).max();
    let after = stays.iter().map(|stay| stay.installed_utc).filter(|installed| *installed > at).min();
    let from = before.map(|removed| format!(" from {}", day(removed))).unwrap_or_default();
    let until = after.map(|installed| format!(" until {}", day(installed))).unwrap_or_default();
    let what = format!("no unit is booked in {position} of {tail}{from}{until}");
    let mut booked: Vec<&str> = of_tail.iter().map(|stay| stay.position.as_str()).collect();
    booked.dedup();
    let hint = format!(
        "the table has {} of {tail}; add the stay to it, then `freeplay run --retry`",
        booked.join(", ")
    );
    Diagnostic::new("unit_unknown", what).hint(hint)
}

/// The log-level digest of settings: of everything that can move the numbers of its records or its identity.
///
/// It covers how the aircraft's logs are read, and the settings of the part in each position. Serial numbers and hours are
/// bookkeeping, which is joined to stored records without the log.
pub fn config_digest(
    config: &Config,
    installations: &Installations,
    flight: &Flight,
    positions: &[Position],
) -> String {
    let mut hash = blake3::Hasher::new();
    let add = |hash: &mut blake3::Hasher, text: &str| {
        hash.update(text.as_bytes()).update(&[0]);
    };
    for position in positions {
        let installation = installations.installed_at(&flight.tail_number, position, flight.departure_utc);
        let digest = installation.map(|s| config.digest(&flight.tail_number, &s.part_number));
        add(&mut hash, position.as_str());
        add(&mut hash, &digest.unwrap_or_default());
    }
    hash.update(config.mapping_text(&flight.tail_number).as_bytes());
    // A flights table may supply the identity of a log: when its row changes, the log may be another flight.
    let (tail, id) = (flight.tail_number.as_str(), flight.flight_id.as_str());
    if let Some(row) = config.flights.of(tail, id, flight.departure_utc) {
        add(&mut hash, row.flight_id.as_str());
        add(&mut hash, &row.departure_utc.to_string());
    }
    hash.finalize().to_hex().to_string()
}

/// Replaces [`config_digest`] where a log has no identity: a digest of everything that can supply one.
pub fn digest_without_identity(config: &Config, installations: &Installations) -> String {
    let mut hash = blake3::Hasher::new();
    hash.update(&crate::METHOD_VERSION.to_le_bytes());
    // That an error is known makes no log another.
    let mut document = config.document.clone();
    document.logs.acknowledged_errors.clear();
    hash.update(serde_json::to_string(&document).unwrap_or_default().as_bytes());
    for installation in installations.iter() {
        hash.update(serde_json::to_string(installation).unwrap_or_default().as_bytes());
    }
    hash.update(config.flights.digest().as_bytes());
    hash.finalize().to_hex().to_string()
}

/// The paths of the flights in a file: its own, unless its rows name their flight.
///
/// # Errors
/// A diagnostic when the file cannot be read.
pub fn flights_in(
    path: &Path,
    display_name: &str,
    identity: &IdentityMapping,
) -> Result<Vec<PathBuf>, Diagnostic> {
    catch_panic(display_name, || {
        flight_rows::flights_in(path, identity).map_err(|e| e.diagnostic().in_file(display_name))
    })
}

/// Which flight a log or a file of a group is of, and of which actuator where it holds but one, without reading its
/// channels.
///
/// # Errors
/// A diagnostic when the file cannot be read, put on one clock or identified.
pub fn identify(
    files: &LogFiles,
    group: Option<&str>,
    display_name: &str,
    config: &Config,
) -> Result<(Flight, Option<Position>), Diagnostic> {
    catch_panic(display_name, || {
        let in_log = |e: ingest::Error| e.diagnostic().in_file(display_name);
        let base = config.base_mapping();
        let mapping = group.map_or_else(|| Arc::clone(base), |group| Arc::new(base.of_group(Some(group))));
        let log = Log::open(files, &mapping).map_err(in_log)?;
        let id = identity_of(&log, files, config).map_err(in_log)?;
        check_tail(&id, display_name, config)?;
        Ok((id.flight, id.position))
    })
}

/// A departure after the machine's clock is a wrong date in the log or a wrong clock; taken at its word it would move
/// the date of every assessment, and with it silence the fleet.
fn check_not_ahead(departure_utc: Timestamp, now: Timestamp) -> Result<(), Diagnostic> {
    if departure_utc.duration_since(now) <= MAX_AHEAD {
        return Ok(());
    }
    let what = format!("the departure {departure_utc} is after this machine's clock, {now:.0}");
    let hint = "fix the date in the log, `clock.unit` or `identity`, or the clock of this machine; then `freeplay run --retry`";
    Err(Diagnostic::new("departure_ahead", what).hint(hint))
}

/// A log may name only the tails that `logs.tails` allows for its folder.
fn check_tail(identity: &Identity, display_name: &str, config: &Config) -> Result<(), Diagnostic> {
    let tail = &identity.flight.tail_number;
    let Some(pattern) = config.document.logs.forbidden_by(display_name, tail) else { return Ok(()) };
    let what = format!("the log names tail {tail}, which `logs.tails` does not allow for `{pattern}`");
    let hint = "check who sent it; if it is right, add the tail to `logs.tails`";
    Err(Diagnostic::new("tail_not_allowed", what).in_file(display_name).hint(hint))
}

fn identity_of(log: &Log, files: &LogFiles, config: &Config) -> Result<Identity, ingest::Error> {
    let path = files.main.first().map_or(Path::new(""), PathBuf::as_path);
    let (path, _) = flight_rows::split_path(path, &config.document.identity);
    log.identity(|fields, departure| config.flights.facts(&path, fields, departure))
}

/// The actuators of a log, each as its aircraft and the part that sits there want it read.
fn map_actuators(
    log: &Log,
    id: &Identity,
    config: &Config,
    installations: &Installations,
) -> Result<Vec<Actuator>, ingest::Error> {
    let usual = config.mapping(&id.flight.tail_number, None);
    let found = log.actuators(&usual.channels, id.position.as_ref());
    let mut at: BTreeMap<Position, Actuator> = BTreeMap::new();
    let mut failed = None;
    let mapped = |columns: ActuatorColumns, mapping: &Arc<Mapping>| {
        (columns.position.clone(), Actuator { columns, mapping: Arc::clone(mapping) })
    };
    match found {
        Ok(found) => at.extend(found.into_iter().map(|columns| mapped(columns, &usual))),
        Err(error) => failed = Some(error),
    }
    let installed: BTreeSet<&PartNumber> = installations
        .units_on_tail(&id.flight.tail_number, id.flight.departure_utc)
        .map(|installation| &installation.part_number)
        .collect();
    for part in installed.into_iter().filter(|part| config.has_overrides(part)) {
        let mapping = config.mapping(&id.flight.tail_number, Some(part));
        let Ok(found) = log.actuators(&mapping.channels, id.position.as_ref()) else { continue };
        let sits = |p: &ActuatorColumns| {
            let installation =
                installations.installed_at(&id.flight.tail_number, &p.position, id.flight.departure_utc);
            installation.is_some_and(|installation| installation.part_number == *part)
        };
        at.extend(found.into_iter().filter(sits).map(|columns| mapped(columns, &mapping)));
    }
    match failed {
        Some(error) if at.is_empty() => Err(error),
        _ => Ok(at.into_values().collect()),
    }
}

/// The error of a log whose flight another log holds with other samples.
pub fn duplicate_flight(log: &str, owner: &str) -> Diagnostic {
    Diagnostic::new("duplicate_flight", format!("another log holds the same flight: {owner}")).in_file(log).hint(
        "if they are pieces of one flight, set `logs.pieces = true`; else remove one of them, or map an identity that \
         separates the flights. The stored log is used, or else the one whose name sorts first",
    )
}

/// Pieces of a flight depart within so long of each other: each may hold its own first instant as its departure.
pub const MAX_BETWEEN_PIECES: SignedDuration = SignedDuration::from_hours(12);

/// Whether two departures of one flight id may be those of pieces of one flight.
pub fn may_be_pieces(one: Timestamp, other: Timestamp) -> bool {
    one != other && one.duration_since(other).abs() <= MAX_BETWEEN_PIECES
}

/// The error of a log whose flight id another log has, with another departure close by: no piece is a flight.
pub fn pieces_undeclared(
    log: &str,
    departure: Timestamp,
    other: &str,
    other_departure: Timestamp,
) -> Diagnostic {
    let what = format!(
        "the flight departs at {departure} in this log and at {other_departure} in {other}, which has the same tail and flight id"
    );
    Diagnostic::new("pieces_undeclared", what).in_file(log).hint(
        "if they are pieces of one flight, set `logs.pieces = true`; if they are flights of their own, set \
         `logs.pieces = false`, or map a flight id that separates them. Until then none of them is stored anew",
    )
}

/// Runs work on one log; a panic becomes a diagnostic of code `panic`, with its message and location.
///
/// # Errors
/// The error of the work, or code `panic`.
pub fn catch_panic<T>(
    display_name: &str,
    work: impl FnOnce() -> Result<T, Diagnostic>,
) -> Result<T, Diagnostic> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|caught| {
        let message = format!("internal error while reading this log: {}", panic::describe(caught.as_ref()));
        Err(Diagnostic::new("panic", message)
            .in_file(display_name)
            .hint("the file is probably corrupt; please report this message with the file"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_departure_more_than_a_day_after_the_clock_is_an_error() {
        let [now, soon, wrong] = ["2026-03-01T12:00:00Z", "2026-03-02T11:00:00Z", "2062-03-01T12:00:00Z"]
            .map(|utc| utc.parse().unwrap());
        assert!(check_not_ahead(soon, now).is_ok());
        assert_eq!(check_not_ahead(wrong, now).unwrap_err().code, "departure_ahead");
    }
}
