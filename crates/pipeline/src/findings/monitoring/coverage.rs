//! What assessments lack: limits, hours of unlogged flights, channels of installed units, and tails that nothing else names.

use std::collections::{BTreeMap, BTreeSet};

use ingest::mapping::column_pattern::nearest;
use jiff::Timestamp;
use job::Config;
use records::time::{day_text, days_between};
use records::{Installation, Installations, PartNumber, TrendRow};
use serde::Serialize;
use store::LogRecord;

/// Limits, hours and new logs that the assessments of some units lack, in words.
///
/// `newest_log` is the departure of the newest log of these units, and `today` the date from which its age counts.
pub(crate) fn notes(
    rows: &[TrendRow],
    newest_log: Option<Timestamp>,
    today: Timestamp,
    config: &Config,
) -> Vec<String> {
    let installed = || rows.iter().filter(|row| row.removed_utc.is_none());
    let mut without_limit = BTreeMap::<&str, usize>::new();
    for row in installed().filter(|row| row.limit_m.is_none()) {
        *without_limit.entry(row.part_number.as_deref().unwrap_or_default()).or_default() += 1;
    }
    let mut notes: Vec<String> = without_limit.iter().map(|(part, n)| no_limit(part, *n, config)).collect();
    let logged = trend::UsageSource::LoggedFlights.to_string();
    let of_logs = installed().filter(|row| row.usage_source.as_ref() == Some(&logged)).count();
    if of_logs > 0 {
        notes.push(format!(
            "{}: usage is that of logged flights alone, and every flight without a log is missing from rates and dates; \
             give a flights table (`logs.flights`), or map `tail_hours_end`",
            units(of_logs)
        ));
    }
    let as_of = rows.first().map(|row| row.as_of_utc);
    notes.extend(newest_log.zip(as_of).and_then(|(at, as_of)| age_of(at, as_of, today)));
    notes.extend(flights_table_ends(rows, config));
    notes.extend(look_alikes(rows));
    notes
}

/// Age of the newest log, if a day or more, and what it means for dates.
fn age_of(newest_log: Timestamp, as_of: Timestamp, today: Timestamp) -> Option<String> {
    let age = days_between(newest_log, today) as i64;
    let age = match age {
        ..1 => return None,
        1 => "1 day".to_owned(),
        _ => format!("{age} days"),
    };
    let dates = if days_between(as_of, today) < 1.0 {
        "since then, usage goes on at each unit's own rate"
    } else {
        "states are those of the newest record (`trend.as_of`)"
    };
    Some(format!("newest log {}, {age} old; {dates}", day_text(newest_log, today)))
}

/// Units of one part whose serial numbers look alike: one of them may be misspelt.
fn look_alikes(rows: &[TrendRow]) -> Vec<String> {
    let mut alike = BTreeMap::<(&str, String), BTreeSet<&str>>::new();
    for row in rows {
        let (part, serial) = (row.part_number.as_deref().unwrap_or_default(), row.serial_number.as_str());
        alike.entry((part, skeleton(serial))).or_default().insert(serial);
    }
    let several = alike.into_iter().filter(|(_, serials)| serials.len() > 1);
    let note = |((part, _), serials): ((&str, String), BTreeSet<&str>)| {
        let names: Vec<String> = serials.into_iter().map(|serial| format!("`{serial}`")).collect();
        let names = names.join(" and ");
        format!(
            "part {part}: serial numbers {names} look alike; if they are one unit, name it in `logs.aliases`"
        )
    };
    several.map(note).collect()
}

/// A name without what is easily mistaken: dashes, blanks, capitals, O for 0, and I or l for 1.
fn skeleton(name: &str) -> String {
    let kept = name.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_uppercase);
    kept.map(|c| match c {
        'O' => '0',
        'I' | 'L' => '1',
        other => other,
    })
    .collect()
}

/// A flights table whose rows of a tail end before its logs do: from then on, usage is that of logged flights.
fn flights_table_ends(rows: &[TrendRow], config: &Config) -> Option<String> {
    let mut ends = BTreeMap::<&str, (Timestamp, Timestamp)>::new();
    for row in rows {
        let Some((tail, latest)) = row.tail_number.as_deref().zip(row.latest_utc) else { continue };
        let Some(last) = config.flights.of_tail(tail).last() else { continue };
        let known = ends.entry(tail).or_insert((last.departure_utc, latest));
        known.1 = known.1.max(latest);
    }
    ends.retain(|_, (end, latest)| days_between(*end, *latest) > QUIET_DAYS);
    let (tail, (end, latest)) = ends.iter().max_by_key(|(_, (end, latest))| latest.duration_since(*end))?;
    let day = |at: &Timestamp| at.strftime("%Y-%m-%d").to_string();
    let others = ends.keys().filter(|other| *other != tail).map(|other| format!(", {other}"));
    let table = flights_table(config);
    Some(format!(
        "{table} ends before the logs of {tail}{}: of {tail}, the last row is of {} and the last log of {}; usage between them \
         is that of logged flights; bring the table up to date",
        others.collect::<String>(),
        day(end),
        day(latest)
    ))
}

/// Days by which logs may go on after the end of the flights table.
const QUIET_DAYS: f64 = 3.0;

fn flights_table(config: &Config) -> &str {
    config.document.logs.flights.as_deref().unwrap_or_default()
}

fn identity(account: &LogRecord) -> Option<(&str, &str, Timestamp)> {
    Some((account.tail_number.as_deref()?, account.flight_id.as_deref()?, account.departure_utc?))
}

fn units(count: usize) -> String {
    if count == 1 { "1 unit".to_owned() } else { format!("{count} units") }
}

fn no_limit(part: &str, count: usize, config: &Config) -> String {
    let units = units(count);
    let lost = format!("{units} unassessed");
    if PartNumber::new(part).is_ok_and(|part| config.parts.contains_key(&part)) {
        return format!("part {part} has no limit: {lost}; add `limit_m` to `[part.\"{part}\"]`");
    }
    let near = nearest(part, config.parts.keys().map(PartNumber::as_str));
    let near = near.map(|near| format!(" (nearest: {near})")).unwrap_or_default();
    format!("part {part} is not configured{near}: {lost}; add `[part.\"{part}\"]`, or correct its name")
}

/// Departures of the flights table that differ from those of the logs by quarters of an hour: another time zone, which may
/// change in summer.
pub(crate) fn departures_in_another_zone<'a>(
    config: &Config,
    accounts: impl Iterator<Item = &'a LogRecord>,
) -> Option<String> {
    const QUARTER_S: f64 = 900.0;
    /// Tables round departures to the minute.
    const ROUNDED_S: f64 = 60.0;
    const MIN_FLIGHTS: usize = 3;
    let offset = |account: &LogRecord| {
        let (tail, id, at) = identity(account)?;
        Some(config.flights.of(tail, id, at)?.departure_utc.duration_since(at).as_secs())
    };
    let (mut by_offset, mut all) = (BTreeMap::<i64, usize>::new(), 0);
    for offset_s in accounts.filter_map(offset) {
        all += 1;
        let quarters = (offset_s as f64 / QUARTER_S).round();
        if quarters != 0.0 && (offset_s as f64 - quarters * QUARTER_S).abs() <= ROUNDED_S {
            *by_offset.entry(quarters as i64).or_default() += 1;
        }
    }
    // Winter and summer, without the odd flight that happens to lie apart by so much.
    by_offset.retain(|_, flights| 5 * *flights >= all);
    let flights: usize = by_offset.values().sum();
    (flights >= MIN_FLIGHTS && 2 * flights > all).then(|| {
        let hours: Vec<String> = by_offset.keys().map(|of| format!("{:+} h", *of as f64 / 4.0)).collect();
        let (hours, table) = (hours.join(" or "), flights_table(config));
        format!(
            "{table}: {flights} of {all} departures are {hours} from those of the logs, which count; write them in UTC, or \
             with their offset (2026-10-01T08:00-05:00), since those of flights without a log may be on the wrong day"
        )
    })
}

/// A note on logs without a row in the flights table, of aircraft for which these are over half of the logs in the table's
/// period.
pub(crate) fn logs_without_row<'a>(
    config: &Config,
    accounts: impl Iterator<Item = &'a LogRecord>,
) -> Option<String> {
    const MIN_LOGS: usize = 3;
    let mut departures = BTreeMap::<&str, Vec<Timestamp>>::new();
    let mut has_row = |account: &'a LogRecord| {
        let (tail, id, at) = identity(account)?;
        let of_table = || config.flights.of_tail(tail).map(|flight| flight.departure_utc).collect();
        let of_tail = departures.entry(tail).or_insert_with(of_table);
        let is_in_period = (*of_tail.first()?..=*of_tail.last()?).contains(&at);
        let is_row = of_tail.binary_search(&at).is_ok() || config.flights.of(tail, id, at).is_some();
        is_in_period.then_some(is_row)
    };
    let mut by_tail = BTreeMap::<&str, (usize, usize)>::new();
    for account in accounts {
        let Some((tail, has_row)) = account.tail_number.as_deref().zip(has_row(account)) else { continue };
        let (all, without) = by_tail.entry(tail).or_default();
        (*all, *without) = (*all + 1, *without + usize::from(!has_row));
    }
    let lacking = by_tail.into_values().filter(|(all, without)| 2 * without > *all);
    let (all, without) = lacking.fold((0, 0), |sum, of_tail| (sum.0 + of_tail.0, sum.1 + of_tail.1));
    let table = flights_table(config);
    (without >= MIN_LOGS).then(|| {
        format!(
            "{table}: {without} of {all} logs have no row by flight number or departure; a row within 12 hours of such a log \
             counts as its flight; write flight numbers as the logs do, or departures in UTC"
        )
    })
}

/// Installed positions whose channels none of the latest logs has, with the number of their aircraft.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub struct UnmappedPositions {
    pub positions: Vec<String>,
    pub tails: usize,
}

impl std::fmt::Display for UnmappedPositions {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let tails = if self.tails == 1 { "1 tail".to_owned() } else { format!("{} tails", self.tails) };
        write!(
            f,
            "{} of {tails}: units are installed there, and no recent log has their channels; check the names of columns \
             and positions under `[channel]`",
            self.positions.join(", ")
        )
    }
}

/// The installed positions, of aircraft with a processed log, that none of its latest logs has.
pub(crate) fn unmapped_positions<'a>(
    accounts: impl Iterator<Item = &'a LogRecord>,
    installations: &Installations,
) -> Vec<UnmappedPositions> {
    const LATEST: usize = 5;
    let mut logs = BTreeMap::<&str, Vec<&LogRecord>>::new();
    for account in accounts.filter(|account| account.estimated + account.refused > 0) {
        account.tail_number.iter().for_each(|tail| logs.entry(tail).or_default().push(account));
    }
    logs.values_mut().for_each(|logs| logs.sort_by_key(|log| std::cmp::Reverse(log.departure_utc)));
    let is_missing = |installation: &&Installation| {
        let logs = logs.get(installation.tail_number.as_str()).map_or(&[][..], |logs| logs);
        let is_in = |log: &&&LogRecord| log.positions.iter().any(|at| *at == installation.position.as_str());
        logs.first().and_then(|newest| newest.departure_utc).is_some_and(|at| installation.covers(at))
            && !logs.iter().take(LATEST).any(|log| is_in(&log))
    };
    let mut missing = BTreeMap::<&str, BTreeSet<&str>>::new();
    for installation in installations.iter().filter(is_missing) {
        let tail = installation.tail_number.as_str();
        missing.entry(tail).or_default().insert(installation.position.as_str());
    }
    let mut tails = BTreeMap::<BTreeSet<&str>, usize>::new();
    missing.into_values().for_each(|positions| *tails.entry(positions).or_default() += 1);
    let row = |(positions, tails): (BTreeSet<&str>, usize)| UnmappedPositions {
        positions: positions.into_iter().map(str::to_owned).collect(),
        tails,
    };
    tails.into_iter().map(row).collect()
}

/// A tail that a table or an override names, and neither the installations nor a log.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub struct UnknownTail {
    /// File of the table, or `[[override]]`.
    pub named_in: String,
    pub tail_number: String,
    /// The known tail with the most similar name.
    pub nearest: Option<String>,
}

impl std::fmt::Display for UnknownTail {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: tail {} has neither an installation nor a log", self.named_in, self.tail_number)?;
        self.nearest.iter().try_for_each(|near| write!(f, "; nearest: {near}"))
    }
}

/// The tails of the flights table and of overrides that nothing else names.
pub(crate) fn unknown_tails<'a>(
    config: &Config,
    installations: &'a Installations,
    accounts: impl Iterator<Item = &'a LogRecord>,
) -> Vec<UnknownTail> {
    let installed = installations.iter().map(|i| i.tail_number.as_str());
    let known: BTreeSet<&str> = accounts.filter_map(|a| a.tail_number.as_deref()).chain(installed).collect();
    let unknown = |named_in: &str, tail: &str| UnknownTail {
        named_in: named_in.to_owned(),
        tail_number: tail.to_owned(),
        nearest: nearest(tail, known.iter().copied()).map(str::to_owned),
    };
    let mut found = BTreeSet::new();
    let flights = flights_table(config);
    let flown: BTreeSet<&str> = config.flights.iter().map(|flight| flight.tail_number.as_str()).collect();
    found.extend(flown.difference(&known).map(|tail| unknown(flights, tail)));
    for pattern in config.document.overrides.iter().flat_map(|one| &one.tails) {
        let fits = |tail: &&str| glob::Pattern::new(pattern).is_ok_and(|pattern| pattern.matches(tail));
        if !known.is_empty() && !known.iter().any(fits) {
            found.insert(unknown("[[override]]", pattern));
        }
    }
    found.into_iter().collect()
}
