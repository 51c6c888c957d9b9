//! What a report says, composed from the store: statements now and before, flights, stays, inspections.

use std::collections::{BTreeMap, BTreeSet};

use ::report::{Event, FlightRow, Inspection, LogFault, Past, Quality, Report, Statement, Stay, Tail, Unit};
use fleet::{GapRecord, Installations, SerialNumber};
use ingest::tables::{Table, name, number, utc};
use jiff::{SignedDuration, Timestamp};
use job::Config;
use store::{Outcome, Query, Store};

use crate::error::Error;
use crate::trends::{self, AsOf, Ask, Flown, TrendRow};

/// Days before the report of which statements are held against what came.
const LOOK_BACK_DAYS: [i64; 3] = [30, 90, 180];
/// An installation within so many days explains a change.
const BOOKED_WITHIN_DAYS: f64 = 7.0;
/// Estimates beside an inspection: so many at most, within so many days before it.
const BESIDE: usize = 10;
const BESIDE_DAYS: f64 = 30.0;

/// A unit, as statements name it.
type Name = (Option<String>, String);

/// Composes the report of the asked units.
///
/// # Errors
/// When the store or the table of inspections cannot be read, or a part's limits cannot be judged by.
pub fn compose(
    config: &Config,
    installations: &Installations,
    store: &Store,
    ask: &Ask,
    made_utc: Timestamp,
    program: &str,
) -> Result<Report, Error> {
    let checks = inspections(config)?;
    let mut records = store.records(&Query::default())?;
    records.retain(|r| ask.as_of_utc.is_none_or(|day| r.flight.departure_utc <= day));
    let flown: Vec<Flown> = records.iter().map(|r| Flown::of(r.clone(), installations)).collect();
    let now = trends::of_flown(config, installations, flown.clone(), ask)?;
    let as_of_utc = now.first().map(|row| row.as_of_utc);
    let before = statements_before(config, installations, flown, &now)?;
    let mut of_unit: BTreeMap<Name, Vec<&GapRecord>> = BTreeMap::new();
    for record in &records {
        let name = (Some(record.part_number.to_string()), record.serial_number.to_string());
        of_unit.entry(name).or_default().push(record);
    }
    let compose =
        Compose { config, installations, before: &before, checks: checks.as_deref().unwrap_or(&[]) };
    let units: Vec<Unit> = now
        .iter()
        .map(|row| {
            let name = (row.part_number.clone(), row.serial_number.clone());
            compose.unit(row, of_unit.get(&name).map_or(&[], Vec::as_slice))
        })
        .collect();
    let accounts = store.accounts()?;
    let shown: BTreeSet<&str> = units.iter().filter_map(|u| u.tail_number.as_deref()).collect();
    let narrowed = ask.tail_number.is_some() || ask.serial_number.is_some();
    let wanted = |tail: Option<&str>| !narrowed || tail.is_some_and(|tail| shown.contains(tail));
    let faults = accounts.iter().filter(|a| a.outcome == Outcome::Error && wanted(a.tail_number.as_deref()));
    let faults: Vec<LogFault> = faults
        .map(|a| LogFault {
            log_path: a.log_path.clone(),
            tail_number: a.tail_number.clone(),
            code: a.error_code.clone().unwrap_or_default(),
            processed_utc: a.processed_utc,
        })
        .collect();
    let mut tails = tails(&records, &faults);
    tails.retain(|t| wanted(Some(&t.tail_number)));
    let known = |c: &Check| of_unit.keys().any(|name| c.is_of(name));
    Ok(Report {
        made_utc,
        program: program.to_owned(),
        store_version: Some(store.info()?.version),
        scope: scope(ask),
        as_of_utc,
        newest_departure_utc: records.iter().map(|r| r.flight.departure_utc).max(),
        logs_known: accounts.iter().filter(|a| wanted(a.tail_number.as_deref())).count(),
        check_interval_hours: config.document.trend.next_check_hours,
        log_faults: faults,
        tails,
        inspections_given: checks.is_some(),
        inspections_unmatched: checks.iter().flatten().filter(|c| !known(c)).count(),
        units,
    })
}

fn scope(ask: &Ask) -> Option<String> {
    let tail = ask.tail_number.as_ref().map(|tail| format!("Tail {tail} only"));
    let serial = ask.serial_number.as_ref().map(|serial| format!("Serial {serial} only"));
    let both: Vec<String> = tail.into_iter().chain(serial).collect();
    (!both.is_empty()).then(|| both.join(", "))
}

/// The statements of one and of more days before, by days.
type Before = BTreeMap<i64, BTreeMap<Name, TrendRow>>;

fn statements_before(
    config: &Config,
    installations: &Installations,
    flown: Vec<Flown>,
    now: &[TrendRow],
) -> Result<Before, Error> {
    let mut queries = Vec::new();
    let mut days_of = Vec::new();
    for days in [1].into_iter().chain(LOOK_BACK_DAYS) {
        for row in now {
            queries.push(AsOf {
                part_number: row.part_number.clone(),
                serial_number: row.serial_number.clone(),
                as_of_utc: row.as_of_utc - SignedDuration::from_hours(24 * days),
            });
            days_of.push(days);
        }
    }
    let rows = trends::of_queries(config, installations, flown, &queries)?;
    let mut before = Before::new();
    for (days, row) in days_of.into_iter().zip(rows).filter(|(_, row)| row.flights > 0) {
        let name = (row.part_number.clone(), row.serial_number.clone());
        before.entry(days).or_default().insert(name, row);
    }
    Ok(before)
}

/// What all units' pages are composed from.
struct Compose<'a> {
    config: &'a Config,
    installations: &'a Installations,
    before: &'a Before,
    checks: &'a [Check],
}

impl Compose<'_> {
    fn unit(&self, row: &TrendRow, records: &[&GapRecord]) -> Unit {
        let name = (row.part_number.clone(), row.serial_number.clone());
        let stays = self.stays(&name);
        Unit {
            statement: self.statement(row, records, &name),
            quality: quality(records, row.as_of_utc),
            events: events(row, &stays),
            past: self.past(row, records, &name),
            inspections: self.checks.iter().filter(|c| c.is_of(&name)).map(|c| c.beside(records)).collect(),
            flights: records.iter().map(|r| flight(r)).collect(),
            stays,
            part_number: name.0,
            serial_number: name.1,
            tail_number: row.tail_number.clone(),
            position: row.position.clone(),
        }
    }

    fn statement(&self, row: &TrendRow, records: &[&GapRecord], name: &Name) -> Statement {
        let part = records.first().and_then(|r| self.config.parts.get(&r.part_number));
        let pace = pace(records);
        let last = records.last().map_or(row.as_of_utc, |r| r.flight.departure_utc);
        let at = |hours: Option<f64>| date(last, hours? / pace?.0);
        Statement {
            state: row.state.map(str::to_owned),
            reason: row.reason.clone(),
            flights: records.len(),
            unit_hours: row.unit_hours,
            gap_m: row.gap_m,
            gap_se_m: row.gap_se_m,
            limit_m: row.limit_m,
            watch_m: part.and_then(|p| p.watch_m),
            rate_m_per_hour: row.rate_m_per_hour,
            rate_p05_m_per_hour: row.rate_p05_m_per_hour,
            rate_p95_m_per_hour: row.rate_p95_m_per_hour,
            trend: row.trend.to_owned(),
            crossing_hours_p05: row.crossing_hours_p05,
            crossing_hours_p50: row.crossing_hours_p50,
            crossing_hours_p95: row.crossing_hours_p95,
            not_before_utc: row.not_before_utc.or_else(|| at(row.crossing_hours_p05)),
            likely_utc: row.likely_utc.or_else(|| at(row.crossing_hours_p50)),
            not_after_utc: row.not_after_utc.or_else(|| at(row.crossing_hours_p95)),
            hours_per_day: pace.map(|p| p.0),
            hours_per_flight: pace.map(|p| p.1),
            check_probability: row.check_probability,
            law: row.wear_law.clone(),
            axis: row.usage_axis.clone(),
            mann_kendall_p: row.trend_p_value,
            sen_rate_m_per_hour: row.sen_rate_m_per_hour,
            sen_low_m_per_hour: row.sen_low_m_per_hour,
            sen_high_m_per_hour: row.sen_high_m_per_hour,
            state_day_before: self
                .before
                .get(&1)
                .and_then(|d| d.get(name))
                .map(|r| r.state.map(str::to_owned)),
        }
    }

    fn stays(&self, name: &Name) -> Vec<Stay> {
        let mine = self.installations.iter().filter(|s| {
            s.serial_number.as_str() == name.1
                && name.0.as_deref().is_none_or(|p| s.part_number.as_str() == p)
        });
        let mut stays: Vec<Stay> = mine
            .map(|s| Stay {
                tail_number: s.tail_number.to_string(),
                position: s.position.to_string(),
                installed_utc: s.installed_utc,
                removed_utc: s.removed_utc,
            })
            .collect();
        stays.sort_by_key(|s| s.installed_utc);
        stays
    }

    /// What was foreseen for today, and what is found.
    fn past(&self, row: &TrendRow, records: &[&GapRecord], name: &Name) -> Vec<Past> {
        let of_day = |days: &i64| {
            let then = self.before.get(days)?.get(name)?;
            foreseen(then, row, flown_hours(records, then.as_of_utc)?, *days)
        };
        LOOK_BACK_DAYS.iter().filter_map(of_day).collect()
    }
}

/// The level then, grown at the rate then over the hours since; the errors of both levels and the
/// interval of the rate are independent of each other.
fn foreseen(then: &TrendRow, now: &TrendRow, hours: f64, days_ago: i64) -> Option<Past> {
    let gap_m = then.gap_m?;
    let rate = then.rate_m_per_hour?;
    let level = 1.645 * then.gap_se_m?.hypot(now.gap_se_m?);
    let foreseen_m = gap_m + rate * hours;
    Some(Past {
        as_of_utc: then.as_of_utc,
        days_ago,
        state: then.state.map(str::to_owned),
        gap_m,
        foreseen_low_m: foreseen_m - level.hypot((rate - then.rate_p05_m_per_hour?) * hours),
        foreseen_m,
        foreseen_high_m: foreseen_m + level.hypot((then.rate_p95_m_per_hour? - rate) * hours),
        found_m: now.gap_m?,
    })
}

/// Hours flown after a day; nothing when a flight does not say its length.
fn flown_hours(records: &[&GapRecord], after: Timestamp) -> Option<f64> {
    records.iter().filter(|r| r.flight.departure_utc > after).map(|r| r.flight.flight_hours).sum()
}

/// Hours a day and hours a flight over the last ninety days of flights.
fn pace(records: &[&GapRecord]) -> Option<(f64, f64)> {
    let last = records.last()?.flight.departure_utc;
    let from = records.partition_point(|r| days(r.flight.departure_utc, last) > 90.0);
    let (first, since) = records[from..].split_first()?;
    let hours: f64 = since.iter().map(|r| r.flight.flight_hours).sum::<Option<f64>>()?;
    let days = days(first.flight.departure_utc, last);
    (hours > 0.0 && days > 0.0).then(|| (hours / days, hours / since.len() as f64))
}

fn days(from: Timestamp, to: Timestamp) -> f64 {
    to.duration_since(from).as_secs_f64() / 86_400.0
}

/// So many days after; nothing where the calendar ends.
fn date(from: Timestamp, days: f64) -> Option<Timestamp> {
    from.checked_add(SignedDuration::try_from_secs_f64(days * 86_400.0).ok()?).ok()
}

fn events(row: &TrendRow, stays: &[Stay]) -> Vec<Event> {
    let booked = |at: Timestamp| {
        stays.iter().any(|s| {
            let ends = [Some(s.installed_utc), s.removed_utc];
            ends.into_iter().flatten().any(|end| days(end, at).abs() <= BOOKED_WITHIN_DAYS)
        })
    };
    let event = |c: &trends::ChangePoint| Event {
        departure_utc: c.departure_utc,
        kind: c.kind.to_owned(),
        step_m: c.step_m,
        // Wear that sets in is nothing that maintenance does.
        in_books: c.kind == "recorded" || (c.kind != "onset" && booked(c.departure_utc)),
    };
    row.change_points.iter().map(event).collect()
}

fn quality(records: &[&GapRecord], as_of: Timestamp) -> Quality {
    let (mut reasons, mut doubts) = (BTreeMap::new(), BTreeMap::new());
    for estimate in records.iter().map(|r| &r.estimate) {
        if estimate.gap_m.is_none() {
            *reasons.entry(estimate.reason.clone().unwrap_or_default()).or_default() += 1;
        }
        for flag in &estimate.flags {
            *doubts.entry(flag.clone()).or_default() += 1;
        }
    }
    let estimated = records.iter().filter(|r| r.estimate.gap_m.is_some());
    let last = estimated.clone().next_back().map(|r| r.flight.departure_utc);
    let count = estimated.count();
    Quality {
        estimated: count,
        refused: records.len() - count,
        reasons: ranked(reasons),
        doubts: ranked(doubts),
        last_estimate_utc: last,
        days_since_estimate: last.map(|last| days(last, as_of)),
        noise_found_over_stated: noise(records),
    }
}

fn ranked(counts: BTreeMap<String, usize>) -> Vec<(String, usize)> {
    let mut counts: Vec<(String, usize)> = counts.into_iter().collect();
    counts.sort_by(|a, b| b.1.cmp(&a.1).then_with(|| a.0.cmp(&b.0)));
    counts
}

/// The spread of neighbouring flights' differences, by the median, over the joint standard error.
fn noise(records: &[&GapRecord]) -> Option<f64> {
    let gaps: Vec<(f64, f64)> =
        records.iter().filter_map(|r| Some((r.estimate.gap_m?, r.estimate.gap_se_m?))).collect();
    let ratio = |pair: &[(f64, f64)]| (pair[1].0 - pair[0].0).abs() / pair[0].1.hypot(pair[1].1);
    let mut ratios: Vec<f64> = gaps.windows(2).map(ratio).filter(|r| r.is_finite()).collect();
    ratios.sort_by(f64::total_cmp);
    (ratios.len() >= 5).then(|| 1.4826 * ratios[ratios.len() / 2])
}

fn flight(record: &GapRecord) -> FlightRow {
    let e = &record.estimate;
    let refusal =
        e.reason.iter().map(|r| if e.gap_m.is_none() { format!("refused: {r}") } else { r.clone() });
    let others = e.flags.iter().filter(|flag| Some(*flag) != e.reason.as_ref()).cloned();
    FlightRow {
        departure_utc: record.flight.departure_utc,
        flight_id: record.flight.flight_id.to_string(),
        tail_number: record.flight.tail_number.to_string(),
        position: record.position.to_string(),
        unit_hours: record.unit_hours,
        gap_m: e.gap_m,
        gap_p05_m: e.gap_p05_m,
        gap_p95_m: e.gap_p95_m,
        gap_midrange_m: e.gap_midrange_m,
        load_reversals: e.load_reversals,
        load_p05_n: e.load_p05_n,
        load_p95_n: e.load_p95_n,
        remarks: refusal.chain(others).collect::<Vec<_>>().join(", "),
    }
}

fn tails(records: &[GapRecord], faults: &[LogFault]) -> Vec<Tail> {
    let mut tails: BTreeMap<&str, (Tail, BTreeSet<&str>)> = BTreeMap::new();
    for record in records {
        let name = record.flight.tail_number.as_str();
        let (tail, flights) = tails.entry(name).or_insert_with(|| (quiet(name), BTreeSet::new()));
        flights.insert(record.flight.flight_id.as_str());
        tail.records += 1;
        tail.last_departure_utc = tail.last_departure_utc.max(Some(record.flight.departure_utc));
        if record.estimate.gap_m.is_some() {
            tail.last_estimate_utc = tail.last_estimate_utc.max(Some(record.flight.departure_utc));
        } else {
            tail.refused += 1;
        }
    }
    for fault in faults {
        let Some(name) = fault.tail_number.as_deref() else { continue };
        tails.entry(name).or_insert_with(|| (quiet(name), BTreeSet::new())).0.logs_in_error += 1;
    }
    tails.into_values().map(|(tail, flights)| Tail { flights: flights.len(), ..tail }).collect()
}

fn quiet(tail_number: &str) -> Tail {
    Tail {
        tail_number: tail_number.to_owned(),
        flights: 0,
        records: 0,
        refused: 0,
        logs_in_error: 0,
        last_departure_utc: None,
        last_estimate_utc: None,
    }
}

/// A hangar check as the table has it.
#[derive(Debug, Clone, PartialEq)]
struct Check {
    part_number: Option<String>,
    serial_number: String,
    date_utc: Timestamp,
    play_m: f64,
    instrument: Option<String>,
    force_n: Option<f64>,
}

impl Check {
    fn is_of(&self, name: &Name) -> bool {
        self.serial_number == name.1 && (self.part_number.is_none() || self.part_number == name.0)
    }

    /// The check beside the median of the last estimates before it: what follows may be another gap.
    fn beside(&self, records: &[&GapRecord]) -> Inspection {
        let near = records
            .iter()
            .rev()
            .filter(|r| (0.0..=BESIDE_DAYS).contains(&days(r.flight.departure_utc, self.date_utc)));
        let mut gaps: Vec<f64> = near.filter_map(|r| r.estimate.gap_m).take(BESIDE).collect();
        gaps.sort_by(f64::total_cmp);
        let middle = gaps.len() / 2;
        let median = gaps
            .get(middle)
            .map(|upper| if gaps.len() % 2 == 1 { *upper } else { f64::midpoint(gaps[middle - 1], *upper) });
        Inspection {
            date_utc: self.date_utc,
            play_m: self.play_m,
            instrument: self.instrument.clone(),
            force_n: self.force_n,
            estimate_m: median,
            estimates: gaps.len(),
        }
    }
}

/// The configured table of hangar checks.
fn inspections(config: &Config) -> Result<Option<Vec<Check>>, Error> {
    let Some(file) = &config.document.logs.inspections else { return Ok(None) };
    let bad = |e: ingest::Error| Error::refused(e.complaint());
    let table = Table::read(&config.path(file)).map_err(bad)?;
    let serial = table.column(&["serial_number", "serial"]).map_err(bad)?;
    let date = table.column(&["date_utc", "date"]).map_err(bad)?;
    let play = table.column(&["play_m"]).map_err(bad)?;
    let [part, instrument, force] =
        ["part_number", "instrument", "force_n"].map(|column| table.find(&[column]));
    let text = |row, column: Option<usize>| column.and_then(|c| table.text(row, c)).map(str::to_owned);
    let check = |row| {
        Ok(Check {
            part_number: text(row, part),
            serial_number: table.required(row, serial, name::<SerialNumber>).map_err(bad)?.to_string(),
            date_utc: table.required(row, date, utc).map_err(bad)?,
            play_m: table.required(row, play, number).map_err(bad)?,
            instrument: text(row, instrument),
            force_n: table.optional(row, force, number).map_err(bad)?,
        })
    };
    (0..table.len()).map(check).collect::<Result<Vec<_>, Error>>().map(Some)
}
