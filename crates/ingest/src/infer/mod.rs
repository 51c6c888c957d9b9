//! A first mapping, guessed from the names and the shape of a log, for a person to confirm.
//!
//! Names of flight parameters consist of words: a channel, a unit, a position. Words that name a channel or a unit are
//! recognised; the remaining words that differ between columns of one channel are the position. Columns of names and
//! of positions show a long layout. A person confirms every inferred mapping.

mod column_names;
mod identity_sources;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;

use arrow::datatypes::DataType;

use crate::channel::stats::span;
use crate::error::Error;
use crate::infer::column_names::{ParsedName, has_word_of, is_of_day, is_time, place_in, time_unit, unit_of};
use crate::infer::identity_sources::{fact_of, facts_of, folders, is_instant};
use crate::log::row_partition::DistinctTexts;
use crate::log::row_table::{RowTable, SampleSelector};
use crate::mapping::column_pattern::PLACEHOLDER;
use crate::mapping::units::{TimeUnit, Unit, from_symbol};
use crate::mapping::{Epoch, IdentityField, Layout, Mapping, Role};
use crate::parquet::leaf_columns::LeafColumn;
use crate::parquet::log_file::LogFile;
use crate::time::clock::DAY_S;
use crate::time::timestamps::EXCEL_ZERO;

pub use crate::log::identity::folder_value;
pub use identity_sources::{is_piece, path_identity, path_position, path_tail};

/// The mapping that is inferred from a log.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct InferredMapping {
    /// The time column, and its unit where the name holds one; timestamp types need none.
    pub clock: Option<(String, Option<&'static str>)>,
    /// What the time column counts from, in its unit.
    pub epoch: Epoch,
    /// Channel → its columns with `{position}` in them, best first, each with its unit where the log names it.
    pub channels: BTreeMap<Role, Vec<(String, Option<Unit>)>>,
    /// The value at which the motor position starts again.
    pub motor_wraps_at: Option<f64>,
    /// How the rows are laid out.
    pub layout: Layout,
    /// The positions found.
    pub positions: BTreeSet<String>,
    /// Facts that the footer's metadata holds: fact → key.
    pub metadata: BTreeMap<IdentityField, String>,
    /// Facts that columns hold: fact → column.
    pub columns: BTreeMap<IdentityField, String>,
    /// Whether those columns name more than one flight.
    pub by_row: bool,
    /// Facts that folders called `name=value` hold: fact → name.
    pub folders: BTreeMap<IdentityField, String>,
    /// The tails that the log names.
    pub tails: BTreeSet<String>,
    /// Columns that hold numbers and were not understood.
    pub others: Vec<String>,
}

impl InferredMapping {
    /// The best column of a channel, and its unit where the log names it.
    pub fn channel(&self, role: Role) -> Option<&(String, Option<Unit>)> {
        self.channels.get(&role)?.first()
    }
}

/// Names of columns that name the channel of a row, and words in the names of those that hold its value.
const NAME_COLUMNS: &str =
    "parameter parameter_name param name channel channel_name signal signal_name mnemonic label variable tag";
const VALUE_WORDS: &str = "value val reading data measurement sample v";
/// Words in the names of columns that name the position of a row, beyond those of a fact.
const POSITION_WORDS: &str = "unit location ema servo actuator side surface lru";

/// Looks at one log.
///
/// # Errors
/// When it, or a column of texts in it, cannot be read.
pub fn propose(path: &Path) -> Result<InferredMapping, Error> {
    let table = RowTable::new(vec![LogFile::open(path)?], Mapping::default());
    let file = &table.files[0];
    let mut leaves = file.leaves.clone();
    for leaf in leaves.iter_mut().filter(|leaf| file.holds_numbers(&leaf.name)) {
        leaf.kind = DataType::Float64;
    }
    let metadata_names = file.metadata_names();
    let mut metadata = facts_of(metadata_names.iter().map(|(name, key)| (name.as_str(), key.as_str())));
    metadata.remove(&IdentityField::Position);
    let constant = |name: &str| table.constant(name, "fact").ok().flatten();
    let (columns, by_row) = identity_columns(&table, &metadata);
    let layout = layout(&table, &leaves, &columns)?;
    let numeric: Vec<&LeafColumn> = leaves.iter().filter(|leaf| leaf.kind.is_numeric()).collect();
    let is_identity = |name: &str| columns.values().any(|column| column == name);
    let epoch_of_texts = |name: &str| {
        // A column of stamps has as many texts as rows: the statistics of its first rows show one without reading them.
        let stated =
            file.text_bounds(name, 0).map(|bounds| String::from_utf8_lossy(bounds.least).into_owned());
        let text = stated.or_else(|| table.texts(name).ok()?.first().cloned());
        let is_of_day = |text: &str| text.contains(':') && text.parse::<jiff::civil::Time>().is_ok();
        match text? {
            text if is_instant(&text) => Some(Epoch::None),
            text if is_of_day(&text) => Some(Epoch::Midnight),
            _ => None,
        }
    };
    let is_fact = |name: &str| is_identity(name) || fact_of(name).is_some_and(|_| constant(name).is_some());
    let stamps = clock_column(&leaves, is_fact, epoch_of_texts);
    let counted = stamps.filter(|leaf| leaf.kind.is_numeric());
    let times = counted.map_or_else(Vec::new, |leaf| numbers(&table, &leaf.name));
    let unit = counted.and_then(|leaf| time_unit(&leaf.name).or_else(|| unit_of_steps(&times)));
    let epoch = match (stamps, unit) {
        (Some(leaf), Some(unit)) => epoch_of(&times, unit, is_of_day(&leaf.name)),
        (Some(leaf), None) if leaf.kind == DataType::Utf8 => epoch_of_texts(&leaf.name).unwrap_or_default(),
        _ => Epoch::None,
    };
    let is_position = |name: &str| layout.position_column.as_deref() == Some(name);
    let is_clock = |name: &str| stamps.is_some_and(|leaf| leaf.name == name);
    let texts = layout.name_column.as_deref().map(|column| table.texts(column)).transpose()?;
    let names: Vec<&str> = match &texts {
        Some(texts) => texts.iter().map(String::as_str).collect(),
        None => {
            let names = numeric.iter().map(|leaf| leaf.name.as_str());
            names.filter(|name| !is_clock(name) && !is_identity(name) && !is_position(name)).collect()
        }
    };
    let (mut found, guesses) = channels(&names, common_root(&numeric));
    let has_own_position = layout.position_column.is_some() || columns.contains_key(&IdentityField::Position);
    if has_own_position {
        let only = found.positions.iter().next().cloned().unwrap_or_default();
        for columns in found.channels.values_mut() {
            let mut known = BTreeSet::new();
            columns.iter_mut().for_each(|(pattern, _)| *pattern = pattern.replace(PLACEHOLDER, &only));
            columns.retain(|(pattern, _)| known.insert(pattern.clone()));
        }
    }
    let others = names.iter().filter(|name| !guesses.iter().any(|guess| guess == *name));
    found.others = others.map(|name| (*name).to_owned()).collect();
    if let Some(column) = &layout.position_column {
        found.positions.clone_from(table.texts(column)?.as_ref());
    } else if let Some(column) = columns.get(&IdentityField::Position) {
        found.positions = constant(column).into_iter().collect();
    }
    let first = found.positions.iter().next().map_or("", String::as_str);
    let units = units_by_name(&table, &layout)?;
    for (pattern, unit) in found.channels.values_mut().flatten().filter(|(_, unit)| unit.is_none()) {
        let name = pattern.replace(PLACEHOLDER, first);
        *unit = units.get(&name).copied().flatten().or_else(|| file.field_metadata(&name).unit);
    }
    found.motor_wraps_at = if texts.is_none() { wraps_at(&table, &found) } else { None };
    let tail = metadata.get(&IdentityField::TailNumber).and_then(|key| file.metadata_field(key));
    let tails = match (tail, columns.get(&IdentityField::TailNumber)) {
        (None, Some(column)) => table.texts(column)?.as_ref().clone(),
        (tail, _) => tail.into_iter().collect(),
    };
    let folders = folders(path);
    let clock = stamps.map(|leaf| (leaf.name.clone(), unit));
    Ok(InferredMapping { clock, epoch, layout, metadata, columns, by_row, folders, tails, ..found })
}

/// The columns that hold facts, and whether they name more than one flight.
fn identity_columns(
    table: &RowTable,
    metadata: &BTreeMap<IdentityField, String>,
) -> (BTreeMap<IdentityField, String>, bool) {
    let leaves = &table.files[0].leaves;
    let is_constant = |name: &str| table.constant(name, "fact").is_ok_and(|text| text.is_some());
    let single = leaves.iter().filter(|leaf| !leaf.is_listed).map(|leaf| leaf.name.as_str());
    let mut facts = facts_of(single.map(|name| (name, name)));
    facts.retain(|fact, _| !metadata.contains_key(fact));
    let of_flight = |fact| matches!(fact, IdentityField::TailNumber | IdentityField::FlightId);
    let varies = |name: &str| !is_constant(name) && table.texts(name).is_ok_and(|texts| texts.len() > 1);
    let by_row = facts.iter().any(|(fact, name)| of_flight(*fact) && varies(name));
    let is_date = |name: &str| leaves.iter().any(|leaf| leaf.name == *name && leaf.kind == DataType::Date32);
    facts.retain(|fact, name| is_constant(name) || (by_row && (of_flight(*fact) || is_date(name))));
    (facts, by_row)
}

fn layout(
    table: &RowTable,
    leaves: &[LeafColumn],
    columns: &BTreeMap<IdentityField, String>,
) -> Result<Layout, Error> {
    let text = |leaf: &&LeafColumn| leaf.kind == DataType::Utf8 && !leaf.is_listed;
    let name =
        leaves.iter().filter(text).find(|leaf| place_in(NAME_COLUMNS, &leaf.name.to_lowercase()).is_some());
    let value = leaves.iter().find(|leaf| leaf.kind.is_numeric() && has_word_of(&leaf.name, VALUE_WORDS));
    let (name_column, value_column) =
        name.zip(value).map(|(name, value)| (name.name.clone(), value.name.clone())).unzip();
    let mut layout = Layout { name_column, value_column, position_column: None };
    let is_taken =
        |leaf: &LeafColumn| columns.values().chain(&layout.name_column).any(|column| *column == leaf.name);
    // A number names an actuator where its column says so: `actuator_id`, but not `position`.
    let may_name = |leaf: &&LeafColumn| {
        text(leaf) || (leaf.kind.is_integer() && !leaf.is_listed && has_word_of(&leaf.name, "id no number"))
    };
    for leaf in leaves.iter().filter(may_name).filter(|leaf| !is_taken(leaf)) {
        let is_position = fact_of(&leaf.name) == Some(IdentityField::Position)
            || (text(&leaf) && has_word_of(&leaf.name, POSITION_WORDS));
        let texts = if is_position { table.texts(&leaf.name)? } else { Arc::default() };
        if texts.len() > 1 && !texts.iter().all(|text| unit_of(text).is_some()) {
            layout.position_column = Some(leaf.name.clone());
            break;
        }
    }
    Ok(layout)
}

/// The unit of each name of a long layout, by its column of units; `None` for a name with several units.
fn units_by_name(table: &RowTable, layout: &Layout) -> Result<BTreeMap<String, Option<Unit>>, Error> {
    let mut units = BTreeMap::new();
    let file = &table.files[0];
    let is_of_units =
        |leaf: &&LeafColumn| leaf.kind == DataType::Utf8 && has_word_of(&leaf.name, "unit units uom");
    if let (Some(names), Some(column)) = (&layout.name_column, file.leaves.iter().find(is_of_units)) {
        let mut pairs = DistinctTexts::default();
        pairs.take_file(file, &[names, &column.name])?;
        for pair in pairs.found {
            let unit = unit_of(&pair[1]);
            units.entry(pair[0].clone()).and_modify(|unit| *unit = None).or_insert(unit);
        }
    }
    Ok(units)
}

/// The time column: timestamps before numbers, numbers before texts of instants, and these before texts of times of the
/// day; names of a time before others; never a column of one value.
fn clock_column(
    leaves: &[LeafColumn],
    is_constant: impl Fn(&str) -> bool,
    epoch_of_texts: impl Fn(&str) -> Option<Epoch>,
) -> Option<&LeafColumn> {
    let is_instant = |leaf: &LeafColumn| {
        matches!(leaf.kind, DataType::Timestamp(..) | DataType::Time32(_) | DataType::Time64(_))
    };
    let rank = |leaf: &LeafColumn| match (is_instant(leaf), is_time(&leaf.name), time_unit(&leaf.name)) {
        (true, true, _) => Some(0),
        (true, false, _) => Some(1),
        (false, true, Some(_)) if leaf.kind.is_numeric() => Some(2),
        (false, true, None) if leaf.kind.is_numeric() => Some(3),
        (false, true, _) if leaf.kind == DataType::Utf8 => match epoch_of_texts(&leaf.name)? {
            Epoch::Midnight => Some(5),
            _ => Some(4),
        },
        _ => None,
    };
    let ranked = leaves.iter().filter_map(|leaf| Some((rank(leaf)?, leaf)));
    ranked.filter(|(_, leaf)| !is_constant(&leaf.name)).min_by_key(|(rank, _)| *rank).map(|(_, leaf)| leaf)
}

/// The unit that gives the usual step of a column of times a rate between 2 and 5000 Hz; none where two units do.
fn unit_of_steps(values: &[f64]) -> Option<&'static str> {
    let mut steps: Vec<f64> = values.windows(2).map(|w| w[1] - w[0]).filter(|step| *step > 0.0).collect();
    let middle = steps.len().checked_sub(1)? / 2;
    let step = *steps.select_nth_unstable_by(middle, f64::total_cmp).1;
    let days = 2e-4 / DAY_S..=0.5 / DAY_S;
    let known = [("s", 2e-4..=0.5), ("ms", 2.0..=500.0), ("us", 2e3..=5e5), ("ns", 2e6..=5e8), ("d", days)];
    known.into_iter().find(|(_, steps)| steps.contains(&step)).map(|(unit, _)| unit)
}

/// A column of numbers; none where it cannot be read.
fn numbers(table: &RowTable, name: &str) -> Vec<f64> {
    let read = table.numbers(&SampleSelector::every_row(name), None, None);
    read.map_or_else(|_| Vec::new(), |(values, _)| values)
}

/// 1970, or 1899 for days, where times lie between 1990 and 2100 when they count from there; midnight where they lie
/// within a day and the name of the column has it.
fn epoch_of(times: &[f64], unit: &str, is_of_day: bool) -> Epoch {
    let per_second = from_symbol(unit).and_then(TimeUnit::per_second).unwrap_or(f64::NAN);
    let is_of_now = |since_1970_s: f64| (631_152_000.0..4_102_444_800.0).contains(&since_1970_s);
    match times.iter().find(|time| !time.is_nan()).map(|first| first / per_second) {
        Some(first_s) if unit == "d" && is_of_now(first_s + EXCEL_ZERO.as_second() as f64) => Epoch::Excel,
        Some(first_s) if is_of_now(first_s) => Epoch::Unix,
        Some(first_s) if is_of_day && (0.0..DAY_S).contains(&first_s) => Epoch::Midnight,
        _ => Epoch::None,
    }
}

/// The struct that all numbers are fields of, with its dot.
fn common_root<'l>(numeric: &[&'l LeafColumn]) -> &'l str {
    let root = |leaf: &&'l LeafColumn| leaf.name.split_inclusive('.').next().filter(|_| leaf.is_field);
    let first = numeric.first().and_then(root);
    first.filter(|first| numeric.iter().all(|leaf| root(leaf) == Some(first))).unwrap_or_default()
}

/// The channels that names speak of, and the names that were understood.
fn channels(names: &[&str], root: &str) -> (InferredMapping, BTreeSet<String>) {
    let parse = |has_sensors: bool| -> Vec<(String, ParsedName)> {
        let one = |name: &&str| {
            let guess = ParsedName::of(name.strip_prefix(root)?, has_sensors)?;
            let pattern = format!("{root}{}", guess.pattern);
            Some(((*name).to_owned(), ParsedName { pattern, ..guess }))
        };
        names.iter().filter_map(one).collect()
    };
    let tagged = parse(true);
    let sensors = |role: Role| -> BTreeSet<Option<usize>> {
        tagged.iter().filter(|(_, guess)| guess.role == role).map(|(_, guess)| guess.sensor).collect()
    };
    // Words that number every channel in the same way, where nothing else names a position, number the actuators.
    let of_motor = sensors(Role::Motor);
    let are_positions = of_motor.len() > 1
        && Role::NEEDED.iter().all(|role| sensors(*role) == of_motor)
        && tagged.iter().all(|(_, guess)| guess.position.is_none());
    let mut guesses = if are_positions { parse(false) } else { tagged };
    share_positions(&mut guesses);
    let found = choose(guesses.iter().map(|(_, guess)| guess));
    let is_chosen = |guess: &ParsedName| {
        found.channels.values().flatten().any(|(pattern, _)| *pattern == guess.pattern)
            && guess.position.as_ref().is_none_or(|position| found.positions.contains(position))
    };
    let understood =
        guesses.iter().filter(|(_, guess)| is_chosen(guess)).map(|(name, _)| name.clone()).collect();
    (found, understood)
}

/// A pattern of a channel: the places where it fits a column, its unit, and which of redundant sensors it is.
type Pattern<'g> = (BTreeSet<&'g str>, Option<Unit>, Option<usize>);

/// Gives all channels of an actuator its position: `AIL_L.hinge_load` speaks of AIL_L where another channel does.
fn share_positions(guesses: &mut [(String, ParsedName)]) {
    let places = |role: Role| -> BTreeSet<String> {
        let of_role = guesses.iter().filter(|(_, guess)| guess.role == role);
        of_role.filter_map(|(_, guess)| guess.position.clone()).collect()
    };
    let known = places(Role::Motor).intersection(&places(Role::Screw)).cloned().collect::<BTreeSet<_>>();
    for (_, guess) in guesses {
        let Some(own) = guess.position.as_ref().filter(|own| !known.contains(*own)) else { continue };
        let is_word = |rest: &str| !rest.starts_with(char::is_alphanumeric);
        let shorter = known.iter().find_map(|place| {
            let rest = own.strip_prefix(place.as_str()).filter(|rest| is_word(rest))?;
            Some((place.clone(), format!("{PLACEHOLDER}{rest}")))
        });
        if let Some((place, pattern)) = shorter {
            guess.pattern = guess.pattern.replace(PLACEHOLDER, &pattern);
            guess.position = Some(place);
        }
    }
}

/// The pattern of each channel that fits most columns; its redundant ones, and those of actuators whose columns are named
/// otherwise; and the positions that all channels know.
fn choose<'g>(guesses: impl Iterator<Item = &'g ParsedName>) -> InferredMapping {
    let mut patterns: BTreeMap<(Role, &str), Pattern<'_>> = BTreeMap::new();
    for guess in guesses {
        let entry = patterns.entry((guess.role, &guess.pattern)).or_default();
        entry.0.extend(guess.position.as_deref());
        (entry.1, entry.2) = (guess.unit, guess.sensor);
    }
    let mut found = InferredMapping::default();
    let places_of = |role: Role| -> BTreeSet<&str> {
        let of_role = patterns.iter().filter(|((of, _), _)| *of == role);
        of_role.flat_map(|(_, (places, ..))| places).copied().collect()
    };
    let known = Role::NEEDED.map(places_of).into_iter().filter(|places| !places.is_empty());
    let shared = known.reduce(|all, places| &all & &places).unwrap_or_default();
    for role in Role::ALL {
        let of_role = patterns.iter().filter(|((of, _), _)| *of == role);
        let mut ranked: Vec<(&str, &Pattern<'_>)> =
            of_role.map(|((_, name), pattern)| (*name, pattern)).collect();
        ranked.sort_by_key(|(_, (places, _, sensor))| (std::cmp::Reverse(places.len()), *sensor));
        let Some((name, (places, unit, sensor))) = ranked.first().copied() else { continue };
        let mut columns = vec![(name.to_owned(), *unit)];
        let is_redundant = |other: &Pattern<'_>| sensor.is_some() && other.2.is_some() && other.0 == *places;
        let mut covered = places.clone();
        for (name, other) in ranked.iter().skip(1) {
            let is_of_others = other.0.is_disjoint(&covered) && !other.0.is_disjoint(&shared);
            if is_of_others || is_redundant(other) {
                covered.extend(&other.0);
                columns.push(((*name).to_owned(), other.1));
            }
        }
        found.channels.insert(role, columns);
    }
    found.positions = shared.into_iter().map(str::to_owned).collect();
    found
}

/// The value at which the first motor position starts again: it leaps by more than half a turn within one turn.
fn wraps_at(table: &RowTable, found: &InferredMapping) -> Option<f64> {
    let (pattern, unit) = found.channel(Role::Motor)?;
    let turn = match unit {
        Some(Unit::Degree) | None => 360.0,
        Some(Unit::Radian) => std::f64::consts::TAU,
        Some(Unit::Revolution) => 1.0,
        _ => return None,
    };
    let name = pattern.replace(PLACEHOLDER, found.positions.iter().next().map_or("", String::as_str));
    let values = numbers(table, &name);
    let (least, greatest) = span(&values);
    let leaps = values.windows(2).filter(|w| (w[1] - w[0]).abs() > turn / 2.0).count();
    (leaps > 0 && greatest - least <= turn * 1.001).then_some(turn)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parquet::writer::{Column, write_parquet};

    /// The mapping that a log with these columns seems to offer.
    fn proposed(columns: &[(&str, Column)]) -> InferredMapping {
        let file = tempfile::NamedTempFile::new().unwrap();
        let columns: Vec<_> = columns.iter().map(|(name, own)| ((*name).to_owned(), own.clone())).collect();
        write_parquet(file.path(), &columns, &[]).unwrap();
        propose(file.path()).unwrap()
    }

    #[test]
    fn redundant_sensors_are_alternatives_and_numbered_actuators_are_positions() {
        for line in include_str!("../../tests/data/column_sets.txt").lines().skip(1) {
            let [names, positions, wanted] = line.split('|').collect::<Vec<_>>().try_into().unwrap();
            let (found, _) = channels(&names.split(' ').collect::<Vec<_>>(), "");
            assert!(found.positions.iter().eq(positions.split(' ')), "{names}: {:?}", found.positions);
            let shown =
                |(name, unit): &(String, Option<Unit>)| format!("{name}:{}", unit.map_or("-", Unit::as_str));
            let mut columns = found.channels.values().map(|all| all.iter().map(shown).collect::<Vec<_>>());
            assert!(columns.any(|all| all.join(" ") == wanted), "{names}: {:?}", found.channels);
        }
    }

    /// One row per position and instant, whose clock is a text.
    #[test]
    fn a_column_of_places_and_a_clock_of_texts_are_understood() {
        let text = |of: fn(usize) -> String| Column::Text((0..300).map(of).collect());
        let columns = [
            ("Date Time (UTC)", text(|k| format!("2026-11-19 04:13:{:02}.{:02}Z", k / 200, k / 2 % 100))),
            ("time_source", text(|_| "GPS".to_owned())),
            ("lru_location", text(|k| ["left", "right"][k % 2].to_owned())),
            ("motor_deg", Column::Real((0..300).map(f64::from).collect())),
        ];
        let found = proposed(&columns);
        assert_eq!(found.clock, Some(("Date Time (UTC)".to_owned(), None)));
        assert_eq!(found.layout.position_column.as_deref(), Some("lru_location"));
        assert!(found.positions.iter().eq(["left", "right"]));
    }

    /// A long table with its units and its identity in columns, one of which is a constant instant. 1,795,061,580 s after 1970
    /// is 2026-11-19T04:13:00Z.
    #[test]
    fn a_long_log_with_units_and_identity_in_columns_is_understood() {
        let every = |texts: [&str; 3]| Column::Text((0..300).map(|k| texts[k % 3].to_owned()).collect());
        let departure: jiff::Timestamp = "2026-11-19T04:13:00Z".parse().unwrap();
        let mut columns = [
            ("departure_utc", Column::Instant(vec![departure; 300])),
            ("tail_number", every(["N412FP"; 3])),
            ("flight_id", every(["0413"; 3])),
            ("unix_ms", Column::Real((0..300).map(|k| 1_795_061_580e3 + f64::from(k / 3 * 10)).collect())),
            ("channel", every(["rudder/motor_position", "rudder/screw_position", "rudder/load"])),
            ("unit", every(["deg", "mm", "N"])),
            ("eng_value", Column::Real((0..300).map(f64::from).collect())),
        ];
        let found = proposed(&columns);
        assert_eq!((found.clock, found.epoch), (Some(("unix_ms".to_owned(), Some("ms"))), Epoch::Unix));
        let Layout { name_column, value_column, position_column } = found.layout;
        let wanted = [Some("channel"), Some("eng_value"), None];
        assert_eq!([name_column, value_column, position_column].each_ref().map(Option::as_deref), wanted);
        assert_eq!(found.channels[&Role::Load], [("{position}/load".to_owned(), Some(Unit::Newton))]);
        assert!(found.positions.iter().eq(["rudder"]) && found.tails.iter().eq(["N412FP"]));
        let facts: Vec<&str> = found.columns.values().map(String::as_str).collect();
        assert_eq!((facts, found.by_row), (vec!["tail_number", "flight_id", "departure_utc"], false));
        columns[1].1 = Column::Text((0..300).map(|k| format!("N41{}FP", k / 200)).collect());
        let found = proposed(&columns);
        assert!(found.by_row && found.tails.iter().eq(["N410FP", "N411FP"]), "{found:?}");
        let epochs =
            [(0.0, "s", false), (1_795_061_580.0, "ms", true), (15_180.0, "s", true), (46_345.0, "d", false)]
                .map(|(first, unit, is_of_day)| epoch_of(&[first, first + 0.01], unit, is_of_day));
        assert_eq!(epochs, [Epoch::None, Epoch::None, Epoch::Midnight, Epoch::Excel]);
        assert_eq!(unit_of_steps(&[46_345.0, 46_345.0 + 0.01 / 86_400.0]), Some("d"));
    }
}
