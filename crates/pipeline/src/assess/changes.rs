//! Changes of a run: states and events of units that differ from those after the run before, each with its cause.
//!
//! Each run stores the states that it leaves ([`records::UnitState`]). So a change is found also after a run that was
//! killed, and its cause is known: new records, a corrected table, another limit, other settings, or the date alone.

use std::collections::{BTreeMap, BTreeSet};

use jiff::Timestamp;
use job::Config;
use records::time::days_between;
use records::{ChangePoint, PartNumber, TailNumber, TrendRow, UnitState};
use serde::Serialize;

use crate::fleet::bookkeeping::join::MovedFlights;
use crate::fleet::histories::UnitKey;

/// An event of one kind is the same one when its date moved by no more than this: dates are estimates.
const SAME_EVENT_DAYS: f64 = 60.0;

/// Why the state of a unit is another one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// Records of this run.
    Records,
    /// A corrected table: installations, flights or aliases.
    Bookkeeping,
    /// Another limit in the configuration.
    Limit,
    /// Other settings of the estimate or of the part.
    Settings,
    /// The date of the assessment, or records of other units.
    Date,
}

/// A change point that a unit has no more.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub struct ClearedEvent {
    pub kind: String,
    pub departure_utc: Timestamp,
}

/// A unit whose state or events differ from those after the run before.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub struct UnitChange {
    pub part_number: Option<String>,
    pub serial_number: String,
    pub tail_number: Option<String>,
    pub position: Option<String>,
    /// The state after the run before, and now.
    pub from: Option<String>,
    pub to: Option<&'static str>,
    /// Why the state is what it is now.
    pub reason: Option<String>,
    /// Why it changed.
    pub cause: Cause,
    /// The same in words.
    pub because: String,
    pub new_events: Vec<ChangePoint>,
    pub cleared_events: Vec<ClearedEvent>,
}

impl UnitChange {
    /// Part number where known, and serial number.
    pub fn unit(&self) -> UnitKey {
        (self.part_number.clone(), self.serial_number.clone())
    }
}

/// Changes that a run reports.
#[derive(Debug, Clone, Copy)]
pub struct RunFacts<'a> {
    /// The run.
    pub run_id: &'a str,
    /// Units with records of this run.
    pub with_records: &'a BTreeSet<UnitKey>,
    /// Flights that a corrected table gave to another unit.
    pub moved: &'a [MovedFlights],
}

/// Changes of a run, and the states to store for the next.
#[derive(Debug, Default)]
pub struct Changes {
    /// Units whose state or events differ; none where no run stored states before.
    pub changed: Vec<UnitChange>,
    /// Rows of states that differ from the stored ones.
    pub states: Vec<UnitState>,
}

/// Compares the assessments of all units with the states after the run before.
pub fn changes(config: &Config, before: &[UnitState], now: &[TrendRow], run: RunFacts<'_>) -> Changes {
    let before: BTreeMap<UnitKey, &UnitState> = before.iter().map(|state| (state.unit(), state)).collect();
    let is_first = before.is_empty();
    let mut found = Changes::default();
    for row in now {
        let known = before.get(&row.unit()).copied();
        let state = UnitState::of(row, settings_digest(config, row), run.run_id);
        if known.is_some_and(|known| known.is_same(&state)) {
            continue;
        }
        found.changed.extend(of_unit(config, known, &state, Some(row), run).filter(|_| !is_first));
        found.states.push(state);
    }
    let assessed: BTreeSet<UnitKey> = now.iter().map(TrendRow::unit).collect();
    for gone in before.values().filter(|state| state.state.is_some() && !assessed.contains(&state.unit())) {
        let (change_points, run_id) = (Vec::new(), run.run_id.to_owned());
        let state = UnitState { state: None, change_points, run_id, ..(*gone).clone() };
        found.changed.extend(of_unit(config, Some(gone), &state, None, run));
        found.states.push(state);
    }
    found
}

fn settings_digest(config: &Config, row: &TrendRow) -> Option<String> {
    let (tail, part) = (row.tail_number.as_ref()?, row.part_number.as_ref()?);
    Some(config.digest(&TailNumber::new(tail).ok()?, &PartNumber::new(part).ok()?).to_string())
}

/// The change of a unit against its state before; without a row, of a unit of which no flight is left.
fn of_unit(
    config: &Config,
    before: Option<&UnitState>,
    state: &UnitState,
    now: Option<&TrendRow>,
    run: RunFacts<'_>,
) -> Option<UnitChange> {
    let is_like = |a: (&str, Timestamp), b: (&str, Timestamp)| {
        a.0 == b.0 && days_between(a.1, b.1).abs() <= SAME_EVENT_DAYS
    };
    let known = || before.into_iter().flat_map(UnitState::events);
    let is_new =
        |event: &&ChangePoint| !known().any(|other| is_like(other, (event.kind, event.departure_utc)));
    let events = now.iter().flat_map(|row| &row.change_points);
    let new_events: Vec<ChangePoint> = events.filter(is_new).cloned().collect();
    let is_cleared =
        |event: &(&str, Timestamp)| now.is_some() && !state.events().any(|other| is_like(other, *event));
    let cleared = known().filter(is_cleared);
    let cleared_events: Vec<ClearedEvent> =
        cleared.map(|(kind, departure_utc)| ClearedEvent { kind: kind.to_owned(), departure_utc }).collect();
    let from = before.and_then(|before| before.state.clone());
    let is_news = from != state.state || !new_events.is_empty() || !cleared_events.is_empty();
    let (cause, because) = cause(config, before, state, now.is_some(), run);
    is_news.then(|| UnitChange {
        part_number: state.part_number.clone(),
        serial_number: state.serial_number.clone(),
        tail_number: state.tail_number.clone(),
        position: state.position.clone(),
        from,
        to: now.and_then(|row| row.state),
        reason: now.map_or_else(|| Some("no flight is left".to_owned()), |row| row.reason.clone()),
        cause,
        because,
        new_events,
        cleared_events,
    })
}

/// Why a unit has another state than after the run before; bookkeeping and settings before records, since a person who made
/// a correction wants to see what it did.
fn cause(
    config: &Config,
    before: Option<&UnitState>,
    now: &UnitState,
    has_flights: bool,
    run: RunFacts<'_>,
) -> (Cause, String) {
    let unit = now.unit();
    let concerns = |moved: &&MovedFlights| moved.former_unit() == unit || moved.present_unit() == unit;
    let moved: Vec<String> = run.moved.iter().filter(concerns).map(ToString::to_string).collect();
    let differ = |(one, other)| one != other;
    let micrometers =
        |limit_m: Option<f64>| limit_m.map_or("none".to_owned(), |m| format!("{:.0} µm", m * 1e6));
    match before {
        Some(before) if before.limit_m != now.limit_m => {
            let place = config.limit_place(now.part_number.as_deref());
            let (from, to) = (micrometers(before.limit_m), micrometers(now.limit_m));
            (Cause::Limit, format!("limit_m changed from {from} to {to} ({place})"))
        }
        _ if !moved.is_empty() => (Cause::Bookkeeping, moved.join("; ")),
        _ if !has_flights => {
            (Cause::Bookkeeping, "its records were withdrawn, or are another unit's now".to_owned())
        }
        Some(before)
            if before.settings_digest.as_ref().zip(now.settings_digest.as_ref()).is_some_and(differ) =>
        {
            (Cause::Settings, "the settings of its estimates changed".to_owned())
        }
        Some(before) if (&before.tail_number, &before.position) != (&now.tail_number, &now.position) => {
            let place = |state: &UnitState| {
                let word = |text: &Option<String>| text.clone().unwrap_or_else(|| "–".to_owned());
                format!("{} {}", word(&state.tail_number), word(&state.position))
            };
            let (from, to) = (place(before), place(now));
            (Cause::Bookkeeping, format!("it went from {from} to {to} in the installations table"))
        }
        Some(before) if now.state.is_none() && before.state.is_some() => {
            (Cause::Bookkeeping, "it was removed in the installations table".to_owned())
        }
        _ if run.with_records.contains(&unit) => (Cause::Records, "records of this run".to_owned()),
        _ => (
            Cause::Date,
            "no record of its own: the date, the operator's tables, or records of other units".to_owned(),
        ),
    }
}
