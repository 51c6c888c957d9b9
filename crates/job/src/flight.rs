//! One flight, from log to records: the room where all floors below meet.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use fleet::{
    Complaint, Estimate, Flight, GapRecord, Installation, Installations, PartNumber, Position, Provenance,
};
use ingest::{Actuator, Identity, Log, PositionColumns};
use jiff::Timestamp;

use crate::config::Config;
use crate::estimate;
use crate::part::Part;

/// What a run writes on everything it makes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Stamp {
    /// The run.
    pub run_id: String,
    /// The version of Freeplay.
    pub program_version: String,
    /// When the record is made.
    pub processed_utc: Timestamp,
}

/// Which flight a log is and what it holds, before any channel is read.
#[derive(Debug)]
pub struct Opened<'c> {
    log: Log<'c>,
    shown: String,
    timeline: ingest::Timeline,
    /// Which flight it is.
    pub identity: Identity,
    /// Its actuators.
    pub positions: Vec<PositionColumns>,
    /// blake3 of what will be read.
    pub digest: String,
}

impl<'c> Opened<'c> {
    /// Opens a log; `shown` is its name in records and complaints.
    ///
    /// # Errors
    /// A complaint when the log cannot be read, put on one clock or identified.
    pub fn open(path: &Path, shown: &str, config: &'c Config) -> Result<Self, Complaint> {
        let complain = |e: ingest::Error| e.complaint().in_file(shown);
        let log = Log::open(path, &config.mapping).map_err(complain)?;
        let timeline = log.timeline().map_err(complain)?;
        let identity = log.identity(&timeline).map_err(complain)?;
        let positions = log.positions(identity.position.as_ref()).map_err(complain)?;
        let digest = log.digest(&positions).map_err(complain)?;
        Ok(Self { log, shown: shown.to_owned(), timeline, identity, positions, digest })
    }

    /// Names of the positions, in order.
    pub fn position_names(&self) -> Vec<Position> {
        self.positions.iter().map(|p| p.position.clone()).collect()
    }

    /// The flight, as records name it.
    pub fn flight(&self) -> Flight {
        flight_of(&self.identity)
    }

    /// The actuators of the log. A position that lacks a channel is one only where a unit is booked:
    /// `battery_load` may fit a pattern without being an actuator.
    pub fn actuators(&self, installations: &Installations) -> impl Iterator<Item = &PositionColumns> {
        let id = &self.identity;
        let booked = |at: &Position| installations.at(&id.tail_number, at, id.departure_utc).is_some();
        self.positions.iter().filter(move |at| at.lacking.is_empty() || booked(&at.position))
    }

    /// Estimates every actuator of the log that was installed that day.
    ///
    /// An actuator that cannot be used becomes a complaint; the others go on.
    pub fn records(
        &self,
        config: &Config,
        installations: &Installations,
        stamp: &Stamp,
    ) -> (Vec<GapRecord>, Vec<Complaint>) {
        let (mut records, mut complaints) = (Vec::new(), Vec::new());
        for at in self.actuators(installations) {
            match self.record(at, config, installations, stamp) {
                Ok(record) => records.push(record),
                Err(complaint) => complaints.push(complaint.in_file(&self.shown)),
            }
        }
        (records, complaints)
    }

    fn record(
        &self,
        at: &PositionColumns,
        config: &Config,
        installations: &Installations,
        stamp: &Stamp,
    ) -> Result<GapRecord, Complaint> {
        let (stay, part) = self.unit(at, config, installations)?;
        let estimate = self.estimate(at, part, config)?;
        Ok(GapRecord {
            flight: self.flight(),
            position: at.position.clone(),
            part_number: stay.part_number.clone(),
            serial_number: stay.serial_number.clone(),
            unit_hours: stay.unit_hours(self.identity.tail_hours_end),
            estimate,
            provenance: Provenance {
                log_path: self.shown.clone(),
                log_digest: self.digest.clone(),
                config_digest: config.digest(&stay.part_number),
                program_version: stamp.program_version.clone(),
                run_id: stamp.run_id.clone(),
                processed_utc: stamp.processed_utc,
            },
        })
    }

    /// The unit that sat in a position that day, and the settings of its part.
    ///
    /// # Errors
    /// A complaint when nobody is booked there, or the part is not configured.
    pub fn unit<'u>(
        &self,
        at: &PositionColumns,
        config: &'u Config,
        installations: &'u Installations,
    ) -> Result<(&'u Installation, &'u Part), Complaint> {
        let id = &self.identity;
        let stay = installations
            .at(&id.tail_number, &at.position, id.departure_utc)
            .ok_or_else(|| nobody_installed(id, &at.position, installations))?;
        Ok((stay, part_of(config, &stay.part_number)?))
    }

    /// Estimates one actuator as a given part, whoever is booked there.
    ///
    /// # Errors
    /// A complaint when its channels cannot be read.
    pub fn estimate(
        &self,
        at: &PositionColumns,
        part: &Part,
        config: &Config,
    ) -> Result<Estimate, Complaint> {
        if !at.lacking.is_empty() {
            return Ok(Estimate::refused("channel_unmapped"));
        }
        let actuator = self.channels(at, part)?;
        estimate::estimate(&actuator, part, &config.document.estimate)
    }

    /// Reads the channels of one actuator of a given part.
    ///
    /// # Errors
    /// A complaint when they cannot be read.
    pub fn channels(&self, at: &PositionColumns, part: &Part) -> Result<Actuator, Complaint> {
        let read = self.log.actuator(at, &self.timeline, part.geometry);
        read.map_err(|e| e.complaint().in_file(&self.shown))
    }

    /// The clock of the log.
    pub fn timeline(&self) -> &ingest::Timeline {
        &self.timeline
    }

    /// Names and types of all columns.
    pub fn column_types(&self) -> Vec<(String, String)> {
        self.log.column_types()
    }
}

/// Estimates every actuator of a log that says nothing of its flight, as one part.
///
/// # Errors
/// A complaint when the log cannot be read or put on one clock.
pub fn anonymous(
    path: &Path,
    shown: &str,
    config: &Config,
    part: &Part,
) -> Result<Vec<(Position, Estimate)>, Complaint> {
    let mut found = Vec::new();
    each_anonymous(path, shown, config, part, |channels| {
        found.push((
            channels.position.clone(),
            estimate::estimate(channels, part, &config.document.estimate)?,
        ));
        Ok(())
    })?;
    Ok(found)
}

/// Hands over the channels of every actuator of a log that says nothing of its flight, as one part.
pub(crate) fn each_anonymous(
    path: &Path,
    shown: &str,
    config: &Config,
    part: &Part,
    mut take: impl FnMut(&Actuator) -> Result<(), Complaint>,
) -> Result<(), Complaint> {
    let complain = |e: ingest::Error| e.complaint().in_file(shown);
    let log = Log::open(path, &config.mapping).map_err(complain)?;
    let timeline = log.timeline().map_err(complain)?;
    // A log of one actuator has no name for it here, but needs one to be asked by.
    let own = Position::new("actuator").map_err(|e| Complaint::new("empty_name", e))?;
    let positions = log.positions(Some(&own)).map_err(complain)?;
    for at in positions.iter().filter(|at| at.lacking.is_empty()) {
        let channels = log.actuator(at, &timeline, part.geometry).map_err(complain)?;
        take(&channels).map_err(|complaint| complaint.in_file(shown))?;
    }
    Ok(())
}

/// The settings of a part number.
///
/// # Errors
/// A complaint when the configuration does not know it.
pub fn part_of<'c>(config: &'c Config, number: &PartNumber) -> Result<&'c Part, Complaint> {
    config.parts.get(number).ok_or_else(|| {
        Complaint::new("part_unknown", format!("part number {number} is installed, but not configured"))
            .hint(format!("add `[part.\"{number}\"]` to {}", config.file.display()))
    })
}

fn nobody_installed(id: &Identity, position: &Position, installations: &Installations) -> Complaint {
    let (tail, at) = (&id.tail_number, id.departure_utc);
    if installations.knows_tail(tail) {
        let what = format!("no unit is booked in {position} of {tail} on {at}");
        Complaint::new("unit_unknown", what)
            .hint("add its stay to the installations table, then `freeplay run --retry`")
    } else {
        let what = format!("the installations table does not know tail {tail}");
        Complaint::new("tail_unknown", what)
            .hint("is the tail spelled alike in logs and table? Then `freeplay run --retry`")
    }
}

/// The log-level digest of settings: of every unit that sat in one of its positions that day.
///
/// It changes when a part's settings change, or another serial number is booked, and with nothing else.
pub fn config_digest(
    config: &Config,
    installations: &Installations,
    flight: &Flight,
    positions: &[Position],
) -> String {
    let mut hash = blake3::Hasher::new();
    for position in positions {
        let stay = installations.at(&flight.tail_number, position, flight.departure_utc);
        // The whole stay, its hours included: they stand in the record too.
        let stay_text = stay.map(|s| serde_json::to_string(s).unwrap_or_default());
        let digest = stay.map(|s| config.digest(&s.part_number));
        for text in [Some(position.as_str()), stay_text.as_deref(), digest.as_deref()] {
            hash.update(text.unwrap_or_default().as_bytes());
            hash.update(&[0]);
        }
    }
    hash.update(serde_json::to_string(&config.mapping).unwrap_or_default().as_bytes());
    hash.finalize().to_hex().to_string()
}

/// Stands in for [`config_digest`] where a log could not be identified: of everything that might mend it.
pub fn unidentified_digest(config: &Config, installations: &Installations) -> String {
    let mut hash = blake3::Hasher::new();
    hash.update(&crate::METHOD_VERSION.to_le_bytes());
    hash.update(serde_json::to_string(&config.document).unwrap_or_default().as_bytes());
    for stay in installations.iter() {
        hash.update(serde_json::to_string(stay).unwrap_or_default().as_bytes());
    }
    hash.finalize().to_hex().to_string()
}

/// Which flight a log is, without reading its channels.
///
/// # Errors
/// A complaint when the log cannot be read, put on one clock or identified.
pub fn identify(path: &Path, shown: &str, config: &Config) -> Result<Flight, Complaint> {
    caught(shown, || {
        let complain = |e: ingest::Error| e.complaint().in_file(shown);
        let log = Log::open(path, &config.mapping).map_err(complain)?;
        let id = log.identity(&log.timeline().map_err(complain)?).map_err(complain)?;
        Ok(flight_of(&id))
    })
}

fn flight_of(id: &Identity) -> Flight {
    Flight {
        tail_number: id.tail_number.clone(),
        flight_id: id.flight_id.clone(),
        departure_utc: id.departure_utc,
        flight_hours: id.flight_hours,
        tail_hours_end: id.tail_hours_end,
    }
}

/// Does something with one log; a panic in it is a complaint like any other.
///
/// # Errors
/// What the work complains of, or code `panic`.
pub fn caught<T>(shown: &str, work: impl FnOnce() -> Result<T, Complaint>) -> Result<T, Complaint> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<&str>().copied();
        let text =
            text.or_else(|| panic.downcast_ref::<String>().map(String::as_str)).unwrap_or("no message");
        let what = format!("reading this log failed in a way that should not happen: {text}");
        Err(Complaint::new("panic", what)
            .in_file(shown)
            .hint("the file is probably damaged; please report it with the file"))
    })
}
