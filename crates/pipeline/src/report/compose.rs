//! Composes a report from the store: assessments now and before, flights, installations, inspections.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use ::report::{Event, FleetPriorView, Quality, QuantityView, Report, UnitView};
use jiff::{SignedDuration, Timestamp};
use job::Config;
use records::report_rows::{
    ReportFlight, ReportInspectionRow, ReportLogErrorRow, ReportPastForecastRow, ReportTailRow,
};
use records::row_schema::NoColumn;
use records::time::{days_after, days_between};
use records::uncertainty::NORMAL_95;
use records::{
    ChangePoint, Flight, Installation, Installations, PartNumber, QuantityRow, TrendRow, WorkRequest,
};
use store::{ColumnScan, LogOutcome, LogRecord, Query, Store};
use trend::{Forecast, Interval};

use crate::assess::quantities::values::{self, READ};
use crate::assess::trends::{self, EarlierAssessments, ReportAssessments, StoreAssessment, UnitSelection};
use crate::error::Error;
use crate::findings::work_requests;
use crate::fleet::bookkeeping::inspections::{self, InspectionRow};
use crate::fleet::builder;
use crate::fleet::flight_row::{FlightRow as FlownRow, known};
use crate::fleet::histories::{Histories, History, TailPosition, UnitKey as Name};
use crate::report::flight_columns::{FlightDetails, flight_details};

/// Days before the report whose forecasts are compared with the outcome.
const LOOK_BACK_DAYS: [i64; 3] = [30, 90, 180];
/// An installation within this number of days explains a change.
const BOOKED_WITHIN_DAYS: f64 = 7.0;

/// Composes the report of the asked units.
///
/// # Errors
/// When the store or the table of inspections cannot be read, or a part's limits are invalid.
pub fn compose(
    config: &Config,
    installations: &Installations,
    store: &Store,
    ask: &UnitSelection,
    made_utc: Timestamp,
    program: &str,
) -> Result<Report, Error> {
    let mut checks = inspections::read(config, installations)?;
    let (accounts, mut logs_known) = (store.accounts()?, BTreeMap::<_, usize>::new());
    accounts.iter().for_each(|log| *logs_known.entry(log.tail_number.clone()).or_default() += 1);
    let failed = accounts.into_iter().filter(|log| log.outcome == LogOutcome::Error);
    let log_error = |account: LogRecord| ReportLogErrorRow {
        log_path: account.log_path,
        tail_number: account.tail_number,
        error_code: account.error_code.unwrap_or_default(),
        processed_utc: account.processed_utc,
    };
    let mut log_errors: Vec<ReportLogErrorRow> = failed.map(log_error).collect();
    let by_largest = config.parts_by_largest_gap();
    let until_utc = ask.as_of_utc.and_then(|last| last.checked_add(SignedDuration::from_micros(1)).ok());
    let mut histories = builder::of_store(store, &Query { until_utc, ..Query::default() }, &by_largest)?;
    let newest_departure_utc = histories.newest_utc();
    let days: Vec<i64> = [1].into_iter().chain(LOOK_BACK_DAYS).collect();
    let ReportAssessments { fleet, drawn, earlier, priors } =
        trends::assess_for_report(config, installations, &mut histories, ask, &days)?;
    let StoreAssessment { now, followed, mapping_faults, notes } = fleet;
    let as_of_utc = now.first().map(|row| row.as_of_utc);
    // A report of a past date knows nothing of later inspections.
    checks.retain(|row| as_of_utc.is_none_or(|as_of| row.date_utc <= as_of));
    let known = |c: &InspectionRow| histories.units.keys().any(|name| c.is_of(name));
    let inspections_unmatched = checks.iter().filter(|c| !known(c)).count();
    let mut requests = by_unit(work_requests::requests(&store.work_events()?, made_utc), WorkRequest::unit);
    let mut tails = tails(&histories, config, as_of_utc);
    // An aircraft whose units flew on others alone has a page too: theirs lead to it.
    now.iter().filter_map(|row| row.tail_number.as_deref()).for_each(|name| _ = entry(&mut tails, name));
    let compose = ReportComposer { config, earlier: &earlier, checks: &checks, installations, by_largest };
    let mut quantities = quantities(&followed.rows, &histories)?;
    let mut details = histories.stored.as_deref().map(flight_details).transpose()?.unwrap_or_default();
    let unit = |(row, drawn): (TrendRow, &Forecast)| {
        let name = row.unit();
        let work_requests = requests.remove(&name).unwrap_or_default();
        let quantities = quantities.remove(&name).unwrap_or_default();
        let history = histories.units.get(&name);
        let view = compose.unit(row, drawn, history.unwrap_or(&History::default()), &mut details);
        UnitView { work_requests, quantities, ..view }
    };
    let units: Vec<UnitView> = now.into_iter().zip(&drawn).map(unit).collect();
    let shown: BTreeSet<&str> = units.iter().filter_map(|u| u.row.tail_number.as_deref()).collect();
    let scope = scope(ask);
    let narrowed = scope.is_some();
    attribute_by_path(&mut log_errors, &tails, installations);
    let wanted = |tail: Option<&str>| !narrowed || tail.is_some_and(|tail| shown.contains(tail));
    log_errors.retain(|fault| wanted(fault.tail_number.as_deref()));
    for name in log_errors.iter().filter_map(|fault| fault.tail_number.as_deref()) {
        entry(&mut tails, name).logs_in_error += 1;
    }
    let tails = tails.into_values().filter(|t| wanted(Some(&t.tail_number))).collect();
    Ok(Report {
        made_utc,
        program: program.to_owned(),
        store_version: histories.stored.as_deref().map(ColumnScan::version),
        scope,
        as_of_utc,
        newest_departure_utc,
        logs_known: logs_known.iter().filter(|(tail, _)| wanted(tail.as_deref())).map(|(_, n)| n).sum(),
        log_errors,
        priors: priors.into_iter().map(prior).collect(),
        tails,
        inspections_given: config.document.logs.inspections.is_some(),
        inspections_unmatched,
        units,
        quantity_changes: followed.changes,
        notes,
        mapping_faults: mapping_faults.iter().map(ToString::to_string).collect(),
    })
}

fn by_unit<R>(rows: impl IntoIterator<Item = R>, unit: impl Fn(&R) -> Name) -> BTreeMap<Name, Vec<R>> {
    let mut units = BTreeMap::<Name, Vec<R>>::new();
    for row in rows {
        units.entry(unit(&row)).or_default().push(row);
    }
    units
}

fn quantities(
    rows: &[QuantityRow],
    histories: &Histories,
) -> Result<BTreeMap<Name, Vec<QuantityView>>, Error> {
    let mut views = Vec::new();
    let Some(stored) = &histories.stored else { return Ok(BTreeMap::new()) };
    for (index, (quantity, _)) in READ.into_iter().enumerate() {
        let column = values::quantity(stored, index)?;
        views.extend(rows.iter().filter(|row| row.quantity == quantity.as_str()).map(|row| {
            let flights = histories.units.get(&row.unit()).map_or(&[][..], History::flights);
            let values = flights.iter().map(|flown| column[flown.row as usize].0).collect();
            QuantityView { row: row.clone(), values }
        }));
    }
    Ok(by_unit(views, |view| view.row.unit()))
}

fn scope(ask: &UnitSelection) -> Option<String> {
    let tail = ask.tail_number.as_ref().map(|tail| format!("Tail {tail} only"));
    let serial = ask.serial_number.as_ref().map(|serial| format!("Serial {serial} only"));
    let part = ask.part_number.as_ref().map(|part| format!("Part {part} only"));
    let all: Vec<String> = tail.into_iter().chain(serial).chain(part).collect();
    (!all.is_empty()).then(|| all.join(", "))
}

struct ReportComposer<'a> {
    config: &'a Config,
    earlier: &'a EarlierAssessments,
    checks: &'a [InspectionRow],
    installations: &'a Installations,
    by_largest: BTreeSet<String>,
}

impl ReportComposer<'_> {
    fn unit(
        &self,
        row: TrendRow,
        drawn: &Forecast,
        history: &History,
        details: &mut [FlightDetails],
    ) -> UnitView {
        let name = row.unit();
        let is_by_largest = name.0.as_ref().is_some_and(|part| self.by_largest.contains(part));
        let installations: Vec<Installation> = self.installations.of_unit(&name).cloned().collect();
        let part = name.0.as_ref().and_then(|part| PartNumber::new(part).ok());
        let before = self.earlier.get(&1).and_then(|units| units.get(&name));
        let before = before.map(|(row, _)| row).filter(|row| row.gap_m.is_some());
        let checks = self.checks.iter().filter(|check| check.is_of(&name));
        UnitView {
            level: drawn
                .past
                .iter()
                .filter_map(|(us, band)| Some((Timestamp::from_microsecond(*us).ok()?, *band)))
                .collect(),
            forecast: forecast(drawn, &row),
            watch_m: part.and_then(|part| self.config.parts.get(&part)?.settings.watch_m),
            state_day_before: before.map(|row| row.state.map(str::to_owned)),
            quality: quality(history, details, &row),
            events: events(&row, &installations),
            past_forecasts: self.past(&row, &name),
            inspections: checks.map(|check| compared(check, &row, history.flights())).collect(),
            flights: flights(history, details, is_by_largest),
            installations,
            work_requests: Vec::new(),
            quantities: Vec::new(),
            row,
        }
    }

    /// The forecasts that were made for the date of the report, and the level found.
    fn past(&self, row: &TrendRow, name: &Name) -> Vec<ReportPastForecastRow> {
        let of_day = |days: &i64| {
            let (then, forecast) = self.earlier.get(days)?.get(name)?;
            let forecast = forecast.as_ref()?;
            Some(ReportPastForecastRow {
                part_number: row.part_number.clone(),
                serial_number: row.serial_number.clone(),
                as_of_utc: then.as_of_utc,
                days_ago: *days,
                state: then.state.map(str::to_owned),
                gap_m: then.gap_m?,
                predicted_p05_m: forecast.p05_m,
                predicted_m: forecast.m,
                predicted_p95_m: forecast.p95_m,
                found_m: row.gap_m?,
            })
        };
        LOOK_BACK_DAYS.iter().filter_map(of_day).collect()
    }
}

/// The fan on the calendar, at this unit's utilisation; nothing where that is not known or the unit was removed.
fn forecast(drawn: &Forecast, row: &TrendRow) -> Vec<(Timestamp, Interval)> {
    let Some(hours_per_day) = row.hours_per_day.filter(|_| row.removed_utc.is_none()) else {
        return Vec::new();
    };
    let at = |hours: f64| days_after(row.as_of_utc, (hours - row.elapsed_hours.0) / hours_per_day);
    drawn.ahead.iter().filter_map(|(hours, band)| Some((at(*hours)?, *band))).collect()
}

fn prior(
    (part_number, learned_until_utc, prior): (Option<String>, Timestamp, trend::FleetPrior),
) -> FleetPriorView {
    let (life_p05_hours, life_p95_hours) = prior.life_range_hours();
    FleetPriorView {
        part_number,
        learned_until_utc,
        axis: prior.axis.to_string(),
        new_m: prior.new_m,
        new_sd_m: prior.new_sd_m,
        life_p05_hours,
        life_p50_hours: prior.median_life_hours(),
        life_p95_hours,
    }
}

/// The changes of a unit. One that an entry of maintenance explains is shown with that entry.
fn events(row: &TrendRow, installations: &[Installation]) -> Vec<Event> {
    let is_near = |a: Timestamp, b: Timestamp| days_between(a, b).abs() <= BOOKED_WITHIN_DAYS;
    let booked = |at: Timestamp| {
        let ends = installations.iter().flat_map(|s| [Some(s.installed_utc), s.removed_utc]);
        ends.flatten().any(|end| is_near(end, at))
    };
    let explained = |by: &ChangePoint, of: &ChangePoint| {
        by.kind == "recorded"
            && matches!(of.kind, "reset" | "step")
            && is_near(by.departure_utc, of.departure_utc)
    };
    let changes = &row.change_points;
    let event = |c: &ChangePoint| Event {
        departure_utc: c.departure_utc,
        kind: c.kind.to_owned(),
        step_m: changes.iter().find(|of| explained(c, of)).map_or(c.step_m, |of| of.step_m),
        is_tail_wide: c.tail_wide,
        // Wear that sets in is nothing that maintenance does.
        is_on_record: c.kind == "recorded" || (c.kind != "onset" && booked(c.departure_utc)),
    };
    changes.iter().filter(|c| !changes.iter().any(|by| explained(by, c))).map(event).collect()
}

fn quality(history: &History, details: &[FlightDetails], row: &TrendRow) -> Quality {
    let records = history.flights();
    let (mut reasons, mut doubts) = (BTreeMap::new(), BTreeMap::new());
    for (flown, details) in records.iter().map(|flown| (flown, &details[flown.row as usize])) {
        if flown.gap_m().is_none() {
            *reasons.entry(details.reason.as_deref().unwrap_or_default().to_owned()).or_default() += 1;
        }
        for flag in &details.flags {
            *doubts.entry(flag.to_string()).or_default() += 1;
        }
    }
    let estimated = records.iter().filter(|r| r.gap_m().is_some());
    let last = estimated.clone().next_back().map(FlownRow::departure_utc);
    let count = estimated.count();
    Quality {
        estimated: count,
        refused: records.len() - count,
        remedies: reasons
            .keys()
            .filter_map(|code: &String| Some((code.clone(), job::rejection::remedy(code)?.to_owned())))
            .collect(),
        reasons: ranked(reasons),
        flags: ranked(doubts),
        last_estimate_utc: last,
        days_since_estimate: last.map(|last| days_between(last, row.as_of_utc)),
        noise_ratio: (count > 1).then(|| row.noise_factor.sqrt()),
    }
}

fn ranked(counts: BTreeMap<String, usize>) -> Vec<(String, usize)> {
    let mut counts: Vec<(String, usize)> = counts.into_iter().collect();
    counts.sort_by(|a, b| b.1.cmp(&a.1).then_with(|| a.0.cmp(&b.0)));
    counts
}

/// The flights of a unit, which share the names of its places. The bounds of a gap that is the largest along the stroke are
/// of that.
fn flights(history: &History, details: &mut [FlightDetails], is_by_largest: bool) -> Vec<ReportFlight> {
    let shared = |name: &Option<String>| Arc::from(name.as_deref().unwrap_or_default());
    let mut names: Option<(&TailPosition, [Arc<str>; 2])> = None;
    let row = |flown: &FlownRow| {
        let details = std::mem::take(&mut details[flown.row as usize]);
        let [
            unit_hours,
            gap_p05_m,
            gap_p95_m,
            gap_midrange_m,
            gap_largest_m,
            gap_largest_se_m,
            load_p05_n,
            load_p95_n,
            load_reversals,
        ] = details.numbers.map(known);
        let reach_m = gap_largest_se_m.map(|se_m| NORMAL_95 * se_m);
        let (gap_p05_m, gap_p95_m) = match gap_largest_m.filter(|_| is_by_largest) {
            Some(gap_m) => (reach_m.map(|reach_m| gap_m - reach_m), reach_m.map(|reach_m| gap_m + reach_m)),
            None => (gap_p05_m, gap_p95_m),
        };
        let place = history.place(flown);
        let known = names.take().filter(|(of, _)| *of == place);
        let shared = || (place, [&place.tail_number, &place.position].map(shared));
        let (_, [tail_number, position]) = names.insert(known.unwrap_or_else(shared));
        ReportFlight {
            departure_utc: flown.departure_utc(),
            flight_id: history.flight_id(flown).unwrap_or_default().into(),
            tail_number: Arc::clone(tail_number),
            position: Arc::clone(position),
            gap_m: flown.gap_m(),
            remarks: remarks(flown, &details),
            unit_hours,
            gap_p05_m,
            gap_p95_m,
            gap_midrange_m,
            gap_largest_m: NoColumn(gap_largest_m),
            profile: NoColumn(details.profile),
            load_reversals: load_reversals.map(|n| n as i64),
            load_p05_n,
            load_p95_n,
            ..ReportFlight::default()
        }
    };
    history.flights().iter().map(row).collect()
}

/// Rejection reason, or quality flags with the most severe first.
fn remarks(flown: &FlownRow, details: &FlightDetails) -> Box<str> {
    let reason = details.reason.as_deref().map(|reason| match flown.gap_m() {
        None => format!("refused: {reason}"),
        Some(_) => reason.to_owned(),
    });
    let others = details.flags.iter().filter(|flag| Some(*flag) != details.reason.as_ref());
    reason.into_iter().chain(others.map(ToString::to_string)).collect::<Vec<_>>().join(", ").into()
}

fn tails(
    histories: &Histories,
    config: &Config,
    as_of: Option<Timestamp>,
) -> BTreeMap<String, ReportTailRow> {
    let mut tails: BTreeMap<&str, (ReportTailRow, BTreeSet<i64>)> = BTreeMap::new();
    let flown = histories.units.values().flat_map(|h| h.flights().iter().map(move |f| (h, f)));
    for (history, record) in flown {
        let Some(name) = history.place(record).tail_number.as_deref() else { continue };
        let (tail, departures) = tails.entry(name).or_default();
        departures.insert(record.departure_us());
        tail.records += 1;
        tail.last_departure_utc = tail.last_departure_utc.max(Some(record.departure_utc()));
        if record.gap_m().is_some() {
            tail.last_estimate_utc = tail.last_estimate_utc.max(Some(record.departure_utc()));
        } else {
            tail.refused += 1;
        }
    }
    let counted = |(name, (tail, departures)): (&str, (ReportTailRow, BTreeSet<i64>))| {
        let is_past = |flight: &&Flight| as_of.is_none_or(|as_of| flight.departure_utc <= as_of);
        let flown = Some(config.flights.of_tail(name).filter(is_past).count() as i64).filter(|n| *n > 0);
        let (tail_number, flights) = (name.to_owned(), departures.len() as i64);
        (tail_number.clone(), ReportTailRow { tail_number, flights, flown, ..tail })
    };
    tails.into_iter().map(counted).collect()
}

/// Attributes logs that could not be read to the tail that their path names, if it names one known tail.
fn attribute_by_path(
    faults: &mut [ReportLogErrorRow],
    tails: &BTreeMap<String, ReportTailRow>,
    installations: &Installations,
) {
    let installed = installations.iter().map(|i| i.tail_number.as_str());
    let known: BTreeSet<&str> = tails.keys().map(String::as_str).chain(installed).collect();
    for fault in faults.iter_mut().filter(|fault| fault.tail_number.is_none()) {
        let words = fault.log_path.split(|c: char| !c.is_alphanumeric() && c != '-');
        let words: Vec<&str> = words.flat_map(|word| word.split('-').chain([word])).collect();
        let mut named = known.iter().filter(|tail| words.contains(tail));
        if let (Some(tail), None) = (named.next(), named.next()) {
            fault.tail_number = Some((*tail).to_owned());
        }
    }
}

fn entry<'t>(tails: &'t mut BTreeMap<String, ReportTailRow>, name: &str) -> &'t mut ReportTailRow {
    let new = || ReportTailRow { tail_number: name.to_owned(), ..ReportTailRow::default() };
    tails.entry(name.to_owned()).or_insert_with(new)
}

/// An inspection with the median of the last estimates before it: later estimates may be of another gap.
fn compared(inspection: &InspectionRow, row: &TrendRow, records: &[FlownRow]) -> ReportInspectionRow {
    let (estimate_m, estimates) = inspection.estimate_before(records);
    ReportInspectionRow {
        part_number: row.part_number.clone(),
        serial_number: row.serial_number.clone(),
        date_utc: inspection.date_utc,
        play_m: inspection.play_m,
        estimate_m,
        estimates: estimates as i64,
        instrument: inspection.instrument.clone(),
        force_n: inspection.force_n,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The re-shim of a table and the fall that it explains, and another fall a month later.
    #[test]
    fn a_change_and_the_maintenance_that_explains_it_are_one_event() {
        let change = |kind, day: &str, step_m| ChangePoint {
            departure_utc: format!("{day}T06:00:00Z").parse().unwrap(),
            kind,
            step_m,
            ..ChangePoint::default()
        };
        let row = TrendRow {
            change_points: vec![
                change("recorded", "2026-10-05", 0.0),
                change("reset", "2026-10-07", -47e-6),
                change("reset", "2026-11-07", -5e-6),
            ],
            ..TrendRow::default()
        };
        let shown = events(&row, &[]);
        let shown: Vec<_> =
            shown.iter().map(|e| (e.kind.as_str(), e.is_on_record, (e.step_m * 1e6) as i64)).collect();
        assert_eq!(shown, [("recorded", true, -47), ("reset", false, -5)]);
    }
}
