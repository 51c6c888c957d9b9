//! Which flight a log is: from its metadata, its constant columns or its path, in that order.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::path::{Path, PathBuf};

use jiff::tz::{AmbiguousOffset, TimeZone};
use jiff::{SignedDuration, Timestamp, civil};
use percent_encoding::percent_decode_str;
use records::{Flight, FlightId, Position, TailNumber};

use crate::error::{Fault, identity_invalid, identity_missing};
use crate::mapping::{IdentityField, IdentityMapping};
use crate::time::clock::{DAY_S, TimeOrigin};

/// Identity of the flight of a log.
#[derive(Debug, Clone, PartialEq)]
pub struct Identity {
    /// The flight.
    pub flight: Flight,
    /// Position of the only actuator in the log, where its columns do not name it.
    pub position: Option<Position>,
}

/// The stamps of a log, from the earliest to the latest.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ClockSpan {
    pub(crate) origin: TimeOrigin,
    /// Earliest and latest stamp since the first one, s.
    pub(crate) earliest_s: f64,
    pub(crate) latest_s: f64,
}

impl ClockSpan {
    /// The earliest instant; `None` where the clock has none, or a local one without a mapped zone.
    pub(crate) fn start(&self, mapping: &IdentityMapping) -> Result<Option<Timestamp>, Fault> {
        let earliest = |first: Timestamp| first.checked_add(duration(self.earliest_s)).ok();
        match self.origin {
            TimeOrigin::Utc(first) => Ok(earliest(first)),
            TimeOrigin::Local(first) => {
                let zone = mapping.time_zone.as_deref();
                let Some((first, zone)) = earliest(first).zip(zone) else { return Ok(None) };
                let local = TimeZone::UTC.to_datetime(first);
                let skipped = |detail: String| invalid(IdentityField::DepartureUtc, &local, &detail);
                unambiguous(local, zone).map(Some).map_err(skipped)
            }
            TimeOrigin::Counted(_) | TimeOrigin::OfDay(_) | TimeOrigin::Start => Ok(None),
        }
    }
}

/// A local time of a zone as an instant; anything else as it is, as a local time that the zone has twice or never.
pub(crate) fn in_zone(origin: TimeOrigin, zone: Option<&str>) -> TimeOrigin {
    match (origin, zone) {
        (TimeOrigin::Local(local), Some(zone)) => {
            unambiguous(TimeZone::UTC.to_datetime(local), zone).map_or(origin, TimeOrigin::Utc)
        }
        _ => origin,
    }
}

fn duration(seconds: f64) -> SignedDuration {
    SignedDuration::try_from_secs_f64(seconds).unwrap_or_default()
}

/// The date of a departure that is written without a time of the day.
pub(crate) fn date_alone(text: &str, mapping: &IdentityMapping) -> Option<civil::Date> {
    let text = text.trim();
    let parsed = mapping.departure_format.as_ref().and_then(|f| jiff::fmt::strtime::parse(f, text).ok());
    match parsed {
        Some(parsed) if parsed.hour().is_some() || parsed.to_timestamp().is_ok() => None,
        Some(parsed) => parsed.to_date().ok(),
        None if text.contains([':', 'T', 't', ' ']) => None,
        None => text.parse().ok(),
    }
}

/// The latest first stamp of a clock that counts seconds from midnight, s: a flight may begin three hours into the next
/// day, and a clock that reads as HHMMSS lies above from ten o'clock on.
const MOST_OF_DAY_S: f64 = DAY_S + 12_000.0;

/// A departure of which the log names the date: by its absolute clock, or by one that counts from midnight.
pub(crate) fn departure_on(
    date: civil::Date,
    absolute: Option<Timestamp>,
    clock: Option<ClockSpan>,
    mapping: &IdentityMapping,
) -> Result<Timestamp, Fault> {
    let invalid = |detail: String| invalid(IdentityField::DepartureUtc, &date, &detail);
    if let Some(start) = absolute {
        // The zone of the date may not be known: 14 h to either side of UTC at most.
        let after_h =
            start.duration_since(TimeZone::UTC.to_timestamp(date.into()).unwrap_or(start)).as_hours();
        if (-14..24 + 14).contains(&after_h) {
            return Ok(start);
        }
        return Err(invalid(format!("the log begins on another day, at {start:.0}: see `clock.epoch`")));
    }
    let Some(ClockSpan { origin: TimeOrigin::OfDay(first_s), earliest_s, .. }) = clock else {
        let detail = "a date without a time of the day: several flights of a day would be one. Add the time to the log or to the flights table, or set `clock.epoch = \"midnight\"` if the clock counts the seconds of the day";
        return Err(invalid(detail.into()));
    };
    if first_s >= MOST_OF_DAY_S {
        let what = format!("its clock begins {first_s} s after midnight");
        return Err(invalid(format!("{what}: one that reads as HHMMSS does not count seconds")));
    }
    let local =
        date.to_datetime(civil::Time::midnight()) + duration((first_s + earliest_s).rem_euclid(DAY_S));
    let name = mapping.time_zone.as_deref();
    let name = name.ok_or_else(|| invalid("its time zone is not given: set `identity.time_zone`".into()))?;
    unambiguous(local, name).map_err(invalid)
}

/// The departure that lies the flight hours, or else the length of the log, before the landing.
pub(crate) fn departure_before(
    landing: &str,
    facts: &IdentityFields,
    clock: Option<ClockSpan>,
    mapping: &IdentityMapping,
) -> Result<Timestamp, Fault> {
    let invalid = |detail: &str| invalid(IdentityField::LandingUtc, &landing, &detail);
    if date_alone(landing, mapping).is_some() {
        return Err(invalid("a date without a time of the day"));
    }
    let stated_h =
        hours(IdentityField::FlightHours, facts.get(&IdentityField::FlightHours).map(|h| h.trim()))?;
    let length_s = stated_h.map(|h| 3600.0 * h).or(clock.map(|clock| clock.latest_s - clock.earliest_s));
    let length_s = length_s.ok_or_else(|| invalid("the log has neither `flight_hours` nor a clock"))?;
    let landed = instant(landing.trim(), mapping)?;
    landed.checked_sub(duration(length_s)).map_err(|e| invalid(&e.to_string()))
}

fn invalid(fact: IdentityField, found: &dyn Display, detail: &dyn Display) -> Fault {
    identity_invalid(fact.as_str(), found, detail)
}

/// Facts as text, before they are read.
pub type IdentityFields = BTreeMap<IdentityField, String>;

/// The facts that the path's named groups hold.
pub(crate) fn from_path(path: &Path, expression: &str) -> Result<IdentityFields, Fault> {
    let regex = regex::Regex::new(expression);
    let regex = regex.map_err(|e| identity_invalid("path expression", &expression, &e))?;
    // The same log must be the same flight wherever the command was typed, and on whichever system.
    let whole = absolute(path);
    let text = whole.to_string_lossy().replace('\\', "/");
    let Some(groups) = regex.captures(&text) else { return Ok(IdentityFields::new()) };
    let named = |fact: &IdentityField| Some((*fact, groups.name(fact.as_str())?.as_str().to_owned()));
    let mut facts: IdentityFields = IdentityField::ALL.iter().filter_map(named).collect();
    if let Some(date) = groups.name("departure_date") {
        let time = groups.name("departure_time").map(|time| format!("T{}", time.as_str()));
        let departure = [date.as_str(), &time.unwrap_or_default()].concat();
        facts.entry(IdentityField::DepartureUtc).or_insert(departure);
    }
    Ok(facts)
}

/// The whole path; an address is whole as it is.
pub(crate) fn absolute(path: &Path) -> PathBuf {
    if object_io::is_address(path) {
        return path.to_owned();
    }
    std::path::absolute(path).unwrap_or_else(|_| path.to_owned())
}

/// Names and values of folders called `name=value`, as Hive partitions are, the outermost first.
pub(crate) fn hive_folders(path: &Path) -> impl Iterator<Item = (&str, String)> {
    let folders = path.parent().into_iter().flat_map(Path::components);
    let named = folders.filter_map(|part| part.as_os_str().to_str()?.split_once('='));
    named.map(|(name, value)| (name, percent_decode_str(value).decode_utf8_lossy().into_owned()))
}

/// The value of the innermost folder called `name=value`.
pub fn folder_value(path: &Path, name: &str) -> Option<String> {
    hive_folders(path).filter(|(own, _)| *own == name).last().map(|(_, value)| value)
}

/// The facts that those folders hold; the innermost wins.
pub(crate) fn from_hive_path(path: &Path, folders: &BTreeMap<IdentityField, String>) -> IdentityFields {
    let whole = absolute(path);
    let stated = |(fact, name): (&IdentityField, &String)| Some((*fact, folder_value(&whole, name)?));
    // Hive's own word for a null.
    let is_value = |(_, value): &(IdentityField, String)| value != "__HIVE_DEFAULT_PARTITION__";
    folders.iter().filter_map(stated).filter(is_value).collect()
}

/// The facts of a flight at an instant, with the registration where a logger calls the aircraft otherwise.
pub(crate) fn registered(
    facts: &IdentityFields,
    mapping: &IdentityMapping,
    at: Option<Timestamp>,
) -> IdentityFields {
    let mut facts = facts.clone();
    let day = at.map(|at| TimeZone::UTC.to_datetime(at).date());
    if let Some(tail) = facts.get_mut(&IdentityField::TailNumber) {
        let alias = mapping.tail_aliases.iter().find(|alias| alias.is_of(tail.trim(), day));
        alias.into_iter().for_each(|alias| tail.clone_from(&alias.tail_number));
    }
    facts
}

/// Reads the facts of a flight that departs at an instant.
pub(crate) fn read(
    facts: &IdentityFields,
    mapping: &IdentityMapping,
    departure: Option<Timestamp>,
) -> Result<Identity, Fault> {
    let facts = registered(facts, mapping, departure);
    let text = |fact: IdentityField| facts.get(&fact).map(|t| t.trim()).filter(|t| !t.is_empty());
    let tail = text(IdentityField::TailNumber).ok_or_else(|| missing(IdentityField::TailNumber, mapping))?;
    let departure_utc = departure.ok_or_else(|| missing(IdentityField::DepartureUtc, mapping))?;
    let flight = text(IdentityField::FlightId)
        .map_or_else(|| departure_utc.strftime("%Y%m%dT%H%M%SZ").to_string(), str::to_owned);
    let of = |fact: IdentityField| {
        let start = format!("{:.40}…", text(fact).unwrap_or_default());
        move |e: records::ids::IdError| invalid(fact, &start, &e)
    };
    let flight = Flight {
        tail_number: TailNumber::new(tail).map_err(of(IdentityField::TailNumber))?,
        flight_id: FlightId::new(flight).map_err(of(IdentityField::FlightId))?,
        departure_utc,
        flight_hours: hours(IdentityField::FlightHours, text(IdentityField::FlightHours))?,
        tail_hours_end: hours(IdentityField::TailHoursEnd, text(IdentityField::TailHoursEnd))?,
    };
    let position = text(IdentityField::Position).map(Position::new).transpose();
    Ok(Identity { flight, position: position.map_err(of(IdentityField::Position))? })
}

fn missing(fact: IdentityField, mapping: &IdentityMapping) -> Fault {
    let looked: [Option<String>; 4] = [
        mapping.metadata.get(&fact).map(|key| format!("metadata `{key}`")),
        mapping.columns.get(&fact).map(|column| format!("column `{column}`")),
        mapping.path.as_ref().map(|expression| {
            // Groups of a date and a time stand for a departure.
            let stem = fact.as_str().strip_suffix("utc").unwrap_or(fact.as_str());
            let lacks = format!(", which has no group `{}`", fact.as_str());
            let has_group = expression.contains(&format!("<{stem}"));
            format!("path by `{expression}`{}", if has_group { "" } else { &lacks })
        }),
        mapping.folders.get(&fact).map(|name| format!("folder `{name}=…`")),
    ];
    identity_missing(fact.as_str(), &looked.into_iter().flatten().collect::<Vec<_>>())
}

/// Longest flight that a log may state, h: almost twice the longest scheduled one.
pub(crate) const LONGEST_FLIGHT_H: f64 = 36.0;

fn hours(fact: IdentityField, text: Option<&str>) -> Result<Option<f64>, Fault> {
    let Some(text) = text else { return Ok(None) };
    match text.parse::<f64>() {
        Ok(h) if fact == IdentityField::FlightHours && h > LONGEST_FLIGHT_H => {
            let detail =
                format!("no flight takes more than {LONGEST_FLIGHT_H} h: give hours, not minutes or seconds");
            Err(invalid(fact, &text, &detail))
        }
        Ok(h) if h.is_finite() && h >= 0.0 => Ok(Some(h)),
        _ => Err(invalid(fact, &text, &"hours are a number of at least 0")),
    }
}

/// Reads a departure. A zone or offset in the text wins; else the mapped zone; else it is refused.
pub(crate) fn instant(text: &str, mapping: &IdentityMapping) -> Result<Timestamp, Fault> {
    let invalid = |detail: String| invalid(IdentityField::DepartureUtc, &text, &detail);
    let local = match &mapping.departure_format {
        Some(format) => {
            let other = |_| invalid(format!("it does not fit `departure_format` = \"{format}\""));
            let parsed = jiff::fmt::strtime::parse(format, text).map_err(other)?;
            if let Ok(instant) = parsed.to_timestamp() {
                return Ok(instant);
            }
            parsed.to_datetime().map_err(other)?
        }
        None => match text.parse::<Timestamp>() {
            Ok(instant) => return Ok(instant),
            Err(_) => text.parse::<civil::DateTime>().map_err(|_| {
                invalid(
                    "expected a time such as 2026-11-19T04:13:00Z; set `departure_format` for other forms"
                        .into(),
                )
            })?,
        },
    };
    let name = mapping.time_zone.as_deref();
    let name =
        name.ok_or_else(|| invalid("it names no time zone, and `identity.time_zone` is not given".into()))?;
    unambiguous(local, name).map_err(invalid)
}

/// The instant of a local time, where the zone has it once.
fn unambiguous(local: civil::DateTime, zone_name: &str) -> Result<Timestamp, String> {
    let found = zone(zone_name)?.into_ambiguous_zoned(local);
    let is = match found.offset() {
        AmbiguousOffset::Unambiguous { .. } => {
            return found.compatible().map(|t| t.timestamp()).map_err(|e| e.to_string());
        }
        AmbiguousOffset::Gap { .. } => "does not exist",
        AmbiguousOffset::Fold { .. } => "exists twice",
    };
    Err(format!(
        "at a change of the clocks the local time {local} {is} in {zone_name}; log the departure in UTC or with its offset"
    ))
}

/// A time zone by its name.
///
/// # Errors
/// When no zone is called so.
pub fn zone(name: &str) -> Result<TimeZone, String> {
    TimeZone::get(name).map_err(|e| e.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mapping(format: Option<&str>, zone: Option<&str>) -> IdentityMapping {
        IdentityMapping {
            departure_format: format.map(Into::into),
            time_zone: zone.map(Into::into),
            ..IdentityMapping::default()
        }
    }

    #[test]
    fn a_date_in_a_folder_and_a_time_in_the_name_of_the_file_are_a_departure() {
        let expression = r"(?<tail_number>N\w+)/(?<departure_date>[\d-]+)/(?<departure_time>\d{4})\.parquet$";
        let facts = from_path(Path::new("/logs/N412FP/2026-11-19/0413.parquet"), expression).unwrap();
        let mapping = mapping(Some("%Y-%m-%dT%H%M"), Some("UTC"));
        let at = instant(&facts[&IdentityField::DepartureUtc], &mapping).unwrap();
        let found = read(&facts, &mapping, Some(at)).unwrap().flight;
        assert_eq!([found.tail_number.as_str(), found.flight_id.as_str()], ["N412FP", "20261119T041300Z"]);
        assert_eq!(found.departure_utc.to_string(), "2026-11-19T04:13:00Z");
    }

    /// Istanbul keeps UTC+3 all year since 2016. Berlin, 2026: clocks go from 02:00 to 03:00 on March 29, and from 03:00 back
    /// to 02:00 on October 25.
    #[test]
    fn a_local_departure_needs_a_zone_that_has_it_once_and_takes_it() {
        let (istanbul, berlin) = (Some("Europe/Istanbul"), Some("Europe/Berlin"));
        for (text, zone, wanted) in [
            ("2026-07-01T03:00:00", istanbul, "2026-07-01T00:00:00Z"),
            ("2026-07-01T03:00:00+02:00", istanbul, "2026-07-01T01:00:00Z"),
            ("2026-10-25T03:30:00", berlin, "2026-10-25T02:30:00Z"),
        ] {
            assert_eq!(instant(text, &mapping(None, zone)).unwrap().to_string(), wanted);
        }
        for (local, zone, why) in [
            ("2026-07-01T03:00:00", None, "names no time zone"),
            ("2026-03-29T02:30:00", berlin, "does not exist"),
            ("2026-10-25T02:30:00", berlin, "exists twice"),
        ] {
            let there = mapping(None, zone);
            let fault = instant(local, &there).unwrap_err();
            assert!(fault.0.message.contains(why), "{fault:?}");
            let origin = TimeOrigin::Local(format!("{local}Z").parse().unwrap());
            let start = ClockSpan { origin, earliest_s: 0.0, latest_s: 1.0 }.start(&there);
            assert_eq!(start.is_ok_and(|start| start.is_none()), zone.is_none());
        }
    }
}
