//! Sources of a flight's identity: names of columns, metadata keys, folders, and forms of paths.

use std::cell::RefCell;
use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use regex::Regex;

use crate::infer::column_names::{place_in, words};
use crate::log::identity::hive_folders;
use crate::mapping::IdentityField;

/// Names of a field of the identity, in small letters, the most common first.
const SOUNDS: [(IdentityField, &str); 6] = [
    (
        IdentityField::TailNumber,
        "tail_number tail tail_no registration reg aircraft_registration aircraft airplane ac msn",
    ),
    (IdentityField::FlightId, "flight_id flight_leg_id flight flight_number flight_no flt_no flt leg sortie"),
    (
        IdentityField::DepartureUtc,
        "departure_utc departure departure_time dep_time takeoff_utc takeoff take_off_utc take_off_time off_time off_block_utc off_block off start_utc start_time t0 \
         date_utc flight_date date",
    ),
    (IdentityField::Position, "position actuator actuator_position surface"),
    (
        IdentityField::FlightHours,
        "flight_hours flight_duration_h duration_h flight_time_h block_hours flight_h",
    ),
    (
        IdentityField::TailHoursEnd,
        "tail_hours_end tail_hours total_hours airframe_hours aircraft_hours total_time_h",
    ),
];

/// Words of which the name of a fact may consist: one or more of the first list, and any of the second (`FLIGHT LEG NBR`,
/// `AircraftReg`).
const WORDS: [(IdentityField, &str, &str); 4] = [
    (IdentityField::TailNumber, "tail registration reg aircraft ac msn", "number no nbr num id ident code"),
    (IdentityField::FlightId, "flight flt leg sortie", "number no nbr num id ident"),
    (IdentityField::DepartureUtc, "departure dep takeoff", "time utc date datetime"),
    (IdentityField::Position, "position actuator surface", "name id"),
];

/// The fact that a name sounds like, and how far behind the best known name of that fact.
fn rank_of(name: &str) -> Option<(IdentityField, usize)> {
    let name = name.replace('/', "");
    let words: Vec<String> = words(&name).iter().map(|(_, word)| word.to_lowercase()).collect();
    let plain = words.join("_");
    let known = SOUNDS.iter().find_map(|(fact, known)| Some((*fact, place_in(known, &plain)?)));
    let consists_of = |first: &str, others: &str| {
        words.len() > 1
            && words.iter().any(|word| place_in(first, word).is_some())
            && words.iter().all(|word| [first, others].iter().any(|list| place_in(list, word).is_some()))
    };
    let composed = || WORDS.iter().find(|(_, first, others)| consists_of(first, others));
    known.or_else(|| composed().map(|(fact, ..)| (*fact, usize::MAX)))
}

pub(super) fn fact_of(name: &str) -> Option<IdentityField> {
    rank_of(name).map(|(fact, _)| fact)
}

/// The source of each fact among names with their sources, such as columns or metadata keys; the best known name first.
pub(super) fn facts_of<'n>(
    names: impl DoubleEndedIterator<Item = (&'n str, &'n str)>,
) -> BTreeMap<IdentityField, String> {
    let mut ranked: Vec<_> =
        names.rev().filter_map(|(name, source)| Some((rank_of(name)?, source))).collect();
    // The last name of a fact is the one that remains: the best known, and of equal ones the first.
    ranked.sort_by_key(|((_, rank), _)| std::cmp::Reverse(*rank));
    ranked.into_iter().map(|((fact, _), source)| (fact, source.to_owned())).collect()
}

/// Whether a text is an instant of ISO 8601, with a time zone or without; a date alone is none.
pub(super) fn is_instant(text: &str) -> bool {
    text.parse::<jiff::Timestamp>().is_ok()
        || (text.contains(':') && text.parse::<jiff::civil::DateTime>().is_ok())
}

/// Folders called `name=value` whose names sound like facts.
pub(super) fn folders(path: &Path) -> BTreeMap<IdentityField, String> {
    let fact = |name: &str, value: &str| {
        if is_instant(value) { Some(IdentityField::DepartureUtc) } else { fact_of(name) }
    };
    hive_folders(path).filter_map(|(name, value)| Some((fact(name, &value)?, name.to_owned()))).collect()
}

/// Forms of a departure in a file name, and their `strftime` patterns; the longest first.
const DEPARTURES: [(&str, &str); 21] = [
    (r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d", "%Y-%m-%dT%H:%M:%S"),
    (r"\d{4}-\d\d-\d\dT\d\d-\d\d-\d\d", "%Y-%m-%dT%H-%M-%S"),
    (r"\d{4}-\d\d-\d\d_\d\d-\d\d-\d\d", "%Y-%m-%d_%H-%M-%S"),
    (r"\d{4}-\d\d-\d\d-\d\d-\d\d-\d\d", "%Y-%m-%d-%H-%M-%S"),
    (r"\d{4}_\d\d_\d\d_\d{6}", "%Y_%m_%d_%H%M%S"),
    (r"\d{4}-\d\d-\d\dT\d{6}", "%Y-%m-%dT%H%M%S"),
    (r"\d{4}-\d\d-\d\d_\d{6}", "%Y-%m-%d_%H%M%S"),
    (r"\d{4}-\d\d-\d\d_\d{4}", "%Y-%m-%d_%H%M"),
    (r"\d{4}-\d\d-\d\d \d{4}", "%Y-%m-%d %H%M"),
    (r"\d{8}T\d{6}Z", "%Y%m%dT%H%M%SZ"),
    (r"\d{8}T\d{6}", "%Y%m%dT%H%M%S"),
    (r"\d{8}T\d{4}", "%Y%m%dT%H%M"),
    (r"\d{8}_\d{6}", "%Y%m%d_%H%M%S"),
    (r"\d{8}-\d{6}", "%Y%m%d-%H%M%S"),
    (r"\d{8}_\d{4}", "%Y%m%d_%H%M"),
    (r"\d\d[A-Za-z]{3}\d{4}_\d{4}", "%d%b%Y_%H%M"),
    (r"\d{14}", "%Y%m%d%H%M%S"),
    (r"\d{12}", "%Y%m%d%H%M"),
    // The clock has the time of the day.
    (r"\d{4}-\d\d-\d\d", "%Y-%m-%d"),
    (r"20\d\d[01]\d[0-3]\d", "%Y%m%d"),
    (r"\d\d[A-Za-z]{3}20\d\d", "%d%b%Y"),
];

/// Forms of a day and of a time that lie in a folder and in a file name.
const DAYS: [(&str, &str); 3] =
    [(r"\d{4}-\d\d-\d\d", "%Y-%m-%d"), (r"\d{8}", "%Y%m%d"), (r"20\d\d/\d\d/\d\d", "%Y/%m/%d")];
const TIMES: [(&str, &str); 4] =
    [(r"\d\d-\d\d-\d\d", "%H-%M-%S"), (r"\d{6}", "%H%M%S"), (r"\d\d-\d\d", "%H-%M"), (r"\d{4}", "%H%M")];

/// Forms of tail numbers, the surest first: one that a flight number such as `TK1923` does not have, letters with digits,
/// five letters.
const TAILS: [&str; 3] = [
    r"(?:[A-Z]{1,2}-[A-Z]{3,4}|N\d{1,4}[A-Z]{1,2}|\d[A-Z]-[A-Z]{3})",
    r"(?:[A-Z]{1,2}-[A-Z0-9]{2,6}|[A-Z]{1,2}\d[A-Z0-9]{0,5}|\d\d-(?:[03-9]\d{3}|\d{5}))",
    "[A-Z]{5}",
];
/// Pattern of an aircraft type, which is no tail number.
const AIRCRAFT_TYPE: &str = r"(?:A[23]\d\d|B7\d\d|E1\d\d|AT[47]\d|CRJ\d)[A-Z]?[_ -]?";
/// The name of any log.
const ANY_LOG: &str = r"[^/]*\.parquet";
/// Pattern of the name of a piece, such as `part-000.parquet`; its folder is the flight.
const PIECE: &str = r"(?i)^(?:part|piece|chunk|segment|seg)[_ -]?\d";
/// Folders between that of the tail and the log, at most.
const MOST_FOLDERS: usize = 4;

/// An expression for logs whose path holds tail, departure or both, if this one seems to, and the form of the departure:
/// `TAIL/…departure….parquet`, `TAIL/POSITION/…departure….parquet`, `TAIL_departure.parquet`, `departure_TAIL.parquet`,
/// `TAIL/departure/….parquet`, `TAIL/day/time.parquet`, `TAIL/FLIGHT/part-0….parquet` or `TAIL/….parquet`. Where `with_position`, the path holds the
/// position as [`path_position`] finds it.
pub fn path_identity(path: &Path, with_position: bool) -> Option<(String, Option<String>)> {
    let name = path.file_name()?.to_str()?;
    let folder = |up: usize| path.ancestors().nth(up).and_then(Path::file_name)?.to_str();
    let place_end = place_end();
    let is_place = with_position && fits(&format!("^{place_end}$"), name);
    let end = if is_place { &place_end } else { ANY_LOG };
    let (departure, format, taken) = path_departure(path, name, end);
    let is = |up: usize, form: &str| folder(up).is_some_and(|text| fits(&format!("^(?:.*=)?{form}$"), text));
    let in_folder = |up: usize| {
        let below = match up - taken - 1 {
            1 if with_position && !is_place && taken == 0 => format!("(?<position>{PLACE})/"),
            folders @ 1.. if taken == 0 && is_piece(path) => {
                format!("{}(?<flight_id>[^/]+)/", "[^/]+/".repeat(folders - 1))
            }
            folders => "[^/]+/".repeat(folders),
        };
        format!("(?<tail_number>[^/=]+)/{below}{departure}")
    };
    let tail = TAILS.iter().enumerate().find_map(|(rank, form)| {
        let mut folders =
            (taken + 1..=taken + MOST_FOLDERS).filter(|up| is(*up, form) && !is(*up, AIRCRAFT_TYPE));
        // Folders of flights look like those of tails that are not sure, and lie in them.
        let folder = if rank == 0 { folders.next() } else { folders.next_back() };
        folder.map(in_folder).or_else(|| tail_in_name(name, form, rank == 0, &departure))
    });
    // A name with a digit that is no date may be a tail too; `logs` is none.
    let may_be_tail =
        |text: &str| text.contains(|c: char| c.is_ascii_digit()) && !fits(r"(?:19|20)\d\d|^\d\d?$", text);
    let expression = match tail {
        Some(expression) => expression,
        None if format.is_none() => return None,
        None if folder(taken + 1).is_some_and(may_be_tail) => in_folder(taken + 1),
        None => departure,
    };
    Some((format!("{expression}$"), format))
}

/// An expression for names that hold a tail of this form and a departure, if this one does: the tail begins the name or
/// follows a type of aircraft (`A320_N412FP`) or a recorder (`QAR-N412FP`); one that is sure may be anywhere, and needs no
/// departure.
fn tail_in_name(name: &str, tail: &str, is_sure: bool, departure: &str) -> Option<String> {
    let others = if is_sure { "[^/]*[_ =-]" } else { &format!("{AIRCRAFT_TYPE}|[A-Za-z]{{3,}}[_ -]") };
    let before = format!("(?:{others})?(?<tail_number>{tail})[_ ;-]");
    let Some((form, _)) = known_departure(name) else {
        let is_here = is_sure && departure == ANY_LOG && fits(&format!("^{before}{ANY_LOG}$"), name);
        return is_here.then(|| format!("{before}{departure}"));
    };
    if fits(&format!("^{before}[^/]*?{form}"), name) {
        return Some(format!("{before}{departure}"));
    }
    let after =
        format!(r"(?<departure_utc>{form})[^/]*?[_ =-](?<tail_number>{tail})(?:[_ ;-][^/]*)?\.parquet");
    (is_sure && fits(&format!("{after}$"), name)).then_some(after)
}

/// The form of a departure that stands alone in a name: no digit is beside it.
fn known_departure(name: &str) -> Option<&'static (&'static str, &'static str)> {
    DEPARTURES.iter().find(|(form, _)| fits(&alone(form), name))
}

fn alone(form: &str) -> String {
    format!(r"^(?:.*\D)?{form}(?:\D.*)?$")
}

/// An expression for the end of a path from its departure on, the form of the departure if the path seems to hold one, and
/// how many folders the expression takes. The departure is in the name of a log, in folders of a day and the name, or in the
/// folder; `end` ends a name.
fn path_departure(path: &Path, name: &str, end: &str) -> (String, Option<String>, usize) {
    let folder = path.parent().and_then(Path::file_name).and_then(|folder| folder.to_str());
    let days = path.parent().and_then(Path::to_str).unwrap_or_default();
    let day = DAYS.iter().find(|(form, _)| fits(&format!("(?:^|/){form}$"), days));
    let time = TIMES.iter().find(|(form, _)| fits(&alone(form), name));
    if let Some((form, format)) = known_departure(name) {
        (format!(r"[^/]*?(?<departure_utc>{form}){end}"), Some((*format).to_owned()), 0)
    } else if let Some(((day, days), (time, times))) = day.zip(time) {
        let parts = format!(r"(?<departure_date>{day})/[^/]*?(?<departure_time>{time})[^/]*\.parquet");
        (parts, Some(format!("{days}T{times}")), 1 + day.matches('/').count())
    } else if let Some((form, format)) = folder.and_then(known_departure) {
        (format!(r"[^/]*?(?<departure_utc>{form})[^/]*/{end}"), Some((*format).to_owned()), 1)
    } else {
        (end.to_owned(), None, 0)
    }
}

/// The tail number in a path of one of the forms that [`path_identity`] knows.
pub fn path_tail(path: &Path) -> Option<String> {
    captured(&path_identity(path, false)?.0, path.to_str()?, "tail_number")
}

/// Pattern of a position in a path.
const PLACE: &str = "[A-Za-z]+(?:[_ -][A-Za-z]+)*";

/// The end of a file name that is a position.
fn place_end() -> String {
    format!(r"(?:[^/]*?[_ -])??(?<position>{PLACE})\.parquet")
}

/// The position in a path and the expression that finds it: the end of the file name, or the folder below that of the
/// tail, if they have no digits.
pub fn path_position(path: &Path) -> Option<(String, String)> {
    let below_tail = format!(r"(?:^|/)(?:{})/(?<position>{PLACE})/[^/]*\.parquet$", TAILS.join("|"));
    [format!("(?:^|/){}$", place_end()), below_tail]
        .into_iter()
        .find_map(|expression| Some((captured(&expression, path.to_str()?, "position")?, expression)))
}

/// Whether a log's name says that it is a piece of a flight.
pub fn is_piece(path: &Path) -> bool {
    path.file_name().and_then(|name| name.to_str()).is_some_and(|name| fits(PIECE, name))
}

fn captured(expression: &str, text: &str, group: &str) -> Option<String> {
    Some(compiled(expression)?.captures(text)?.name(group)?.as_str().to_owned())
}

fn fits(expression: &str, text: &str) -> bool {
    compiled(expression).is_some_and(|regex| regex.is_match(text))
}

thread_local! {
    /// Compiling an expression takes a hundred times longer than matching it, and a fleet has thousands of logs.
    static COMPILED: RefCell<HashMap<String, Option<Regex>>> = RefCell::default();
}

fn compiled(expression: &str) -> Option<Regex> {
    COMPILED.with_borrow_mut(|known| {
        known.entry(expression.to_owned()).or_insert_with(|| Regex::new(expression).ok()).clone()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tails_departures_and_positions_in_paths_are_found_with_their_forms() {
        let paths: Vec<&str> = include_str!("../../tests/data/paths.txt").lines().skip(1).collect();
        assert!(paths.len() > 20);
        for line in paths {
            let [path, wanted, format] = line.split('|').collect::<Vec<_>>().try_into().unwrap();
            let position = path_position(Path::new(path)).map(|(position, _)| position);
            let (expression, found) = path_identity(Path::new(path), position.is_some()).unwrap();
            let found = found.unwrap_or_default();
            let groups = Regex::new(&expression).unwrap().captures(path).unwrap();
            let facts: Vec<&str> = groups.iter().skip(1).flatten().map(|group| group.as_str()).collect();
            assert_eq!((facts.join(" ").as_str(), found.as_str()), (wanted, format), "{expression}");
            assert_eq!(position.as_deref(), groups.name("position").map(|group| group.as_str()), "{path}");
        }
        assert_eq!(path_identity(Path::new("logs/flight 7.parquet"), false), None);
        let tail = |path: &str| path_tail(Path::new(path));
        assert_eq!(tail("d/N412FP/rudder_l/20261119T041300Z.parquet").as_deref(), Some("N412FP"));
        assert_ne!(tail("d/FDR-20261119_0413.parquet").as_deref(), Some("FDR"));
    }

    #[test]
    fn facts_are_known_by_their_usual_names() {
        let names =
            ["Tail", "tail_number", "flight_duration_h", "motor.position", "value"].map(|name| (name, name));
        let found = facts_of(names.into_iter().chain([("tail_hours", "attrs.tail_hours")]));
        assert_eq!(found.len(), 3, "a channel in a struct is no place of an actuator");
        assert_eq!(found[&IdentityField::TailNumber], "tail_number");
        assert_eq!(found[&IdentityField::FlightHours], "flight_duration_h");
        assert_eq!(found[&IdentityField::TailHoursEnd], "attrs.tail_hours");
        for (name, fact) in [
            ("tailNumber", IdentityField::TailNumber),
            ("A/C Reg", IdentityField::TailNumber),
            ("flight-leg", IdentityField::FlightId),
            ("DEP_TIME", IdentityField::DepartureUtc),
            ("AircraftReg", IdentityField::TailNumber),
            ("TakeOffTime", IdentityField::DepartureUtc),
            ("FLIGHT LEG NBR", IdentityField::FlightId),
            ("SurfaceName", IdentityField::Position),
        ] {
            assert_eq!(fact_of(name), Some(fact), "{name}");
        }
        assert_eq!(["aircraft_type", "flight_phase", "dep"].map(fact_of), [None; 3]);
    }
}
