//! A first mapping, guessed from the names in a log for a person to confirm.
//!
//! Names of flight parameters consist of words: a channel, a unit, a position. Words that name a
//! channel or a unit are recognised; the remaining words that differ
//! between columns of one channel are the position. A person confirms every inferred mapping.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use arrow::datatypes::DataType;

use crate::error::Error;
use crate::mapping::column_pattern::PLACEHOLDER;
use crate::mapping::units::{Dimension, Unit};
use crate::mapping::{IdentityField, Role};
use crate::parquet::log_file::LogFile;

/// What a log seems to offer.
#[derive(Debug, Clone, PartialEq)]
pub struct InferredMapping {
    /// The time column, and its unit where the name holds one; timestamp types need none.
    pub clock: Option<(String, Option<&'static str>)>,
    /// Channel → its column with `{position}` in it, and its unit where the name holds one.
    pub channels: BTreeMap<Role, (String, Option<Unit>)>,
    /// The positions found.
    pub positions: BTreeSet<String>,
    /// Facts that the footer's metadata holds: fact → key.
    pub metadata: BTreeMap<IdentityField, String>,
    /// The tail that the footer names.
    pub tail: Option<String>,
    /// Columns that hold numbers and were not understood.
    pub others: Vec<String>,
}

/// Forms of a departure in a file name, and their `strftime` patterns; the longest first.
const DEPARTURES: [(&str, &str); 9] = [
    (r"\d{4}-\d\d-\d\dT\d\d-\d\d-\d\d", "%Y-%m-%dT%H-%M-%S"),
    (r"\d{4}-\d\d-\d\d_\d\d-\d\d-\d\d", "%Y-%m-%d_%H-%M-%S"),
    (r"\d{4}-\d\d-\d\d_\d{6}", "%Y-%m-%d_%H%M%S"),
    (r"\d{4}-\d\d-\d\d_\d{4}", "%Y-%m-%d_%H%M"),
    (r"\d{8}T\d{6}Z", "%Y%m%dT%H%M%SZ"),
    (r"\d{8}T\d{6}", "%Y%m%dT%H%M%S"),
    (r"\d{8}_\d{6}", "%Y%m%d_%H%M%S"),
    (r"\d{8}_\d{4}", "%Y%m%d_%H%M"),
    (r"\d{14}", "%Y%m%d%H%M%S"),
];

/// An expression and a departure format for logs that lie as `TAIL/…departure….parquet`, if this one seems to.
pub fn path_identity(path: &Path) -> Option<(String, &'static str)> {
    let name = path.file_name()?.to_str()?;
    let fits = |form: &str| {
        let alone = format!(r"^(?:.*\D)?{form}(?:\D.*)?$");
        regex::Regex::new(&alone).is_ok_and(|regex| regex.is_match(name))
    };
    let (form, format) = DEPARTURES.iter().find(|(form, _)| fits(form))?;
    Some((format!(r"(?<tail_number>[^/]+)/[^/]*?(?<departure_utc>{form})[^/]*\.parquet$"), format))
}

/// Looks at one log.
///
/// # Errors
/// When it cannot be opened.
pub fn propose(path: &Path) -> Result<InferredMapping, Error> {
    let file = LogFile::open(path)?;
    let names: Vec<&str> =
        file.leaves().iter().filter(|l| l.kind.is_numeric()).map(|l| l.name.as_str()).collect();
    let instant = |kind: &DataType| matches!(kind, DataType::Timestamp(..));
    let stamps = file.leaves().iter().find(|leaf| instant(&leaf.kind));
    let clock = match stamps {
        Some(leaf) => Some((leaf.name.clone(), None)),
        None => names.iter().find(|name| is_time(name)).map(|name| ((*name).to_owned(), time_unit(name))),
    };
    let is_clock = |name: &str| clock.as_ref().is_some_and(|(column, _)| column == name);
    let guesses: Vec<ParsedName> =
        names.iter().filter(|n| !is_clock(n)).filter_map(|n| ParsedName::of(n)).collect();
    let (channels, positions) = choose(&guesses);
    let mapped = |name: &&str| {
        positions
            .iter()
            .any(|p| channels.values().any(|(pattern, _)| pattern.replace(PLACEHOLDER, p) == **name))
            || channels.values().any(|(pattern, _)| pattern == *name)
    };
    let others = names.iter().filter(|n| !is_clock(n) && !mapped(n)).map(|n| (*n).to_owned()).collect();
    let metadata = metadata(&file);
    let tail = metadata.get(&IdentityField::TailNumber).and_then(|key| file.metadata(key)).map(str::to_owned);
    Ok(InferredMapping { clock, channels, positions, metadata, tail, others })
}

/// A name's words: cut at what is no letter or digit, and where a capital follows a small letter.
fn words(name: &str) -> Vec<(usize, &str)> {
    let mut found = Vec::new();
    let mut start = None;
    let mut before = ' ';
    for (at, c) in name.char_indices().chain(std::iter::once((name.len(), ' '))) {
        let is_cut = !c.is_alphanumeric() || (c.is_uppercase() && before.is_lowercase());
        if let (true, Some(from)) = (is_cut, start) {
            found.push((from, &name[from..at]));
            start = None;
        }
        if c.is_alphanumeric() && start.is_none() {
            start = Some(at);
        }
        before = c;
    }
    found
}

const TIMES: [&str; 9] = ["time", "t", "timestamp", "stamp", "elapsed", "tick", "ticks", "clock", "utc"];

fn is_time(name: &str) -> bool {
    words(name).iter().any(|(_, word)| TIMES.contains(&word.to_lowercase().as_str()))
}

fn time_unit(name: &str) -> Option<&'static str> {
    let units = [("s", "s"), ("sec", "s"), ("seconds", "s"), ("ms", "ms"), ("us", "us"), ("ns", "ns")];
    let word = words(name).last()?.1.to_lowercase();
    units.iter().find(|(said, _)| *said == word).map(|(_, unit)| *unit)
}

const ROLES: [(Role, &[&str]); 4] = [
    (Role::Motor, &["motor", "mot", "mtr", "resolver", "rotor", "input", "drive"]),
    (Role::Screw, &["screw", "nut", "ram", "lvdt", "output", "stroke", "rod", "joint"]),
    (Role::Load, &["load", "force", "frc", "torque", "trq", "loadcell"]),
    (Role::Temperature, &["temp", "temperature"]),
];

/// Words without information.
const FILLERS: [&str; 8] = ["position", "pos", "angle", "displacement", "cell", "sensor", "meas", "value"];

fn unit_of(word: &str) -> Option<Unit> {
    let known = [
        ("mm", Unit::Millimetre),
        ("um", Unit::Micrometre),
        ("m", Unit::Metre),
        ("in", Unit::Inch),
        ("inch", Unit::Inch),
        ("deg", Unit::Degree),
        ("rad", Unit::Radian),
        ("rev", Unit::Revolution),
        ("n", Unit::Newton),
        ("kn", Unit::Kilonewton),
        ("dan", Unit::Decanewton),
        ("lbf", Unit::PoundForce),
        ("nm", Unit::NewtonMetre),
        ("degc", Unit::Celsius),
        ("degf", Unit::Fahrenheit),
        ("c", Unit::Celsius),
        ("k", Unit::Kelvin),
    ];
    known.iter().find(|(said, _)| *said == word).map(|(_, unit)| *unit)
}

/// One column, understood.
#[derive(Debug, Clone, PartialEq)]
struct ParsedName {
    role: Role,
    pattern: String,
    position: Option<String>,
    unit: Option<Unit>,
}

impl ParsedName {
    fn of(name: &str) -> Option<Self> {
        let words: Vec<(usize, &str, String)> =
            words(name).into_iter().map(|(at, word)| (at, word, word.to_lowercase())).collect();
        let says = |known: &[&str], word: &str| known.contains(&word);
        let (at, role) = words.iter().enumerate().find_map(|(at, (_, _, word))| {
            ROLES.iter().find(|(_, known)| says(known, word)).map(|(role, _)| (at, *role))
        })?;
        let fits = |unit: &Unit| match role {
            Role::Motor | Role::Screw => matches!(unit.dimension(), Dimension::Length | Dimension::Angle),
            Role::Load => matches!(unit.dimension(), Dimension::Force | Dimension::Torque),
            Role::Temperature => unit.dimension() == Dimension::Temperature,
        };
        let last = words.len() - 1;
        let unit = if last == at { None } else { unit_of(&words[last].2).filter(fits) };
        let is_place =
            |i: &usize| *i != at && !(unit.is_some() && *i == last) && !says(&FILLERS, &words[*i].2);
        let place: Vec<usize> = (0..words.len()).filter(is_place).collect();
        let run = place.windows(2).all(|w| w[1] == w[0] + 1);
        let (Some(&first), Some(&end)) = (place.first(), place.last()) else {
            return Some(Self { role, pattern: name.to_owned(), position: None, unit });
        };
        let span = words[first].0..words[end].0 + words[end].1.len();
        let position = run.then(|| name[span.clone()].to_owned())?;
        let pattern = format!("{}{PLACEHOLDER}{}", &name[..span.start], &name[span.end..]);
        Some(Self { role, pattern, position: Some(position), unit })
    }
}

type BestPatterns = (BTreeMap<Role, (String, Option<Unit>)>, BTreeSet<String>);

/// The places where a pattern fits a column, and its unit.
type PatternMatches<'g> = (BTreeSet<&'g str>, Option<Unit>);

/// The pattern of each channel that fits most columns, and the positions that all of them know.
fn choose(guesses: &[ParsedName]) -> BestPatterns {
    let mut patterns: BTreeMap<(Role, &str), PatternMatches<'_>> = BTreeMap::new();
    for guess in guesses {
        let (places, unit) = patterns.entry((guess.role, &guess.pattern)).or_default();
        places.extend(guess.position.as_deref());
        *unit = guess.unit;
    }
    let mut best: BTreeMap<Role, (&str, &BTreeSet<&str>, Option<Unit>)> = BTreeMap::new();
    for ((role, pattern), (places, unit)) in &patterns {
        let is_better = best.get(role).is_none_or(|(_, others, _)| places.len() > others.len());
        if is_better {
            best.insert(*role, (pattern, places, *unit));
        }
    }
    let mut needed = Role::NEEDED.iter().filter_map(|role| best.get(role)).map(|(_, places, _)| *places);
    let first = needed.next().cloned().unwrap_or_default();
    let shared = needed.fold(first, |all, places| all.intersection(places).copied().collect());
    let channels =
        best.iter().map(|(role, (pattern, _, unit))| (*role, ((*pattern).to_owned(), *unit))).collect();
    (channels, shared.into_iter().map(str::to_owned).collect())
}

/// Keys of the footer that sound like facts.
fn metadata(file: &LogFile) -> BTreeMap<IdentityField, String> {
    let sounds: [(IdentityField, &[&str]); 5] = [
        (IdentityField::TailNumber, &["tail_number", "tail", "registration", "reg", "ac_reg", "aircraft"]),
        (IdentityField::FlightId, &["flight_id", "flight", "flight_number", "leg", "flight_no"]),
        (
            IdentityField::DepartureUtc,
            &["departure_utc", "departure", "takeoff_utc", "off_block_utc", "start_utc", "date_utc"],
        ),
        (IdentityField::FlightHours, &["flight_hours", "block_hours"]),
        (IdentityField::TailHoursEnd, &["tail_hours_end", "total_hours", "airframe_hours"]),
    ];
    let keys = file.metadata_keys();
    let found = |(fact, known): &(IdentityField, &[&str])| {
        let key = known.iter().find_map(|k| keys.iter().find(|key| key.to_lowercase() == **k))?;
        Some((*fact, (*key).to_owned()))
    };
    sounds.iter().filter_map(found).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn inferred(name: &str) -> Option<(Role, String, Option<String>, Option<Unit>)> {
        ParsedName::of(name).map(|g| (g.role, g.pattern, g.position, g.unit))
    }

    #[test]
    fn names_of_several_houses_are_understood() {
        let place = |text: &str| Some(text.to_owned());
        let cases = [
            (
                "aileron_left_motor_deg",
                Role::Motor,
                "{position}_motor_deg",
                place("aileron_left"),
                Some(Unit::Degree),
            ),
            (
                "AIL_L.SCREW_POS.mm",
                Role::Screw,
                "{position}.SCREW_POS.mm",
                place("AIL_L"),
                Some(Unit::Millimetre),
            ),
            ("loadElevatorRight", Role::Load, "load{position}", place("ElevatorRight"), None),
            ("ELV_L.MOT_POS_RAD", Role::Motor, "{position}.MOT_POS_RAD", place("ELV_L"), Some(Unit::Radian)),
            ("load_n", Role::Load, "load_n", None, Some(Unit::Newton)),
            ("resolver angle rudder", Role::Motor, "resolver angle {position}", place("rudder"), None),
        ];
        for (name, role, pattern, position, unit) in cases {
            assert_eq!(inferred(name), Some((role, pattern.to_owned(), position, unit)), "{name}");
        }
        assert_eq!(inferred("airspeed_kt"), None);
    }

    #[test]
    fn a_departure_in_a_name_is_found_with_its_form() {
        for (path, departure, format) in [
            ("d/N412FP/FLT_2026-09-10_1307.parquet", "2026-09-10_1307", "%Y-%m-%d_%H%M"),
            ("d/TC-JRA/20261119T041300Z_0413.parquet", "20261119T041300Z", "%Y%m%dT%H%M%SZ"),
            ("d/TC-JRA/QAR20261119_041300.parquet", "20261119_041300", "%Y%m%d_%H%M%S"),
        ] {
            let (expression, found) = path_identity(Path::new(path)).unwrap();
            let regex = regex::Regex::new(&expression).unwrap();
            let facts = regex.captures(path).unwrap();
            assert_eq!((&facts["departure_utc"], found), (departure, format), "{expression}");
            assert_eq!(&facts["tail_number"], path.split('/').nth(1).unwrap());
        }
        assert_eq!(path_identity(Path::new("d/N412FP/flight 7.parquet")), None);
    }

    #[test]
    fn the_sample_fleet_is_understood_whole() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../sample-data/logs/N412FP");
        let log = std::fs::read_dir(folder).unwrap().flatten().next().unwrap().path();
        let found = propose(&log).unwrap();
        assert_eq!(found.clock, Some(("time_s".to_owned(), Some("s"))));
        assert_eq!(found.channels[&Role::Screw], ("{position}_screw_mm".to_owned(), Some(Unit::Millimetre)));
        let positions: Vec<&str> = found.positions.iter().map(String::as_str).collect();
        assert_eq!(positions, ["aileron_left", "aileron_right", "elevator_left", "elevator_right"]);
        assert_eq!((found.metadata.len(), found.others.len()), (5, 0));
        assert_eq!(found.tail.as_deref(), Some("N412FP"));
    }
}
