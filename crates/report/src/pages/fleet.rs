//! Fleet page: work list, changes, map of tails and positions, removal forecast, forecast accuracy, data quality.

use std::collections::{BTreeMap, BTreeSet};

use askama::Template;
use records::time::days_between;

use crate::charts::agreement_plot::agreement_plot;
use crate::format::{
    NO_DATA, count, counted, date, date_or, hours, micrometres, micrometres_or, minute_or, or_no_data,
    percent, rate, unbroken,
};
use crate::model::{Inspection, Report, Tail, UnitView};
use crate::page::{Error, Page, part_path, tail_path, unit_path};
use crate::pages::quantities::{self, Change};
use crate::state_badge::StateBadge;
use crate::stats::agreement::Agreement;
use crate::stats::rate_spread::spreads;
use crate::stats::removal_forecast::{Month, removal_forecast};

/// Maximum number of work-list rows on one page.
const WORK_ROWS: usize = 100;
/// Maximum number of tails on one page.
const TAIL_ROWS: usize = 100;
/// Maximum number of entries in the short lists.
const FEW: usize = 40;

/// Units below the heading of their tail; on the page of a tail, which needs no heading, its name is empty.
pub(crate) struct Group<'a> {
    pub(crate) tail: &'a str,
    pub(crate) units: Vec<&'a UnitView>,
}

/// Reason of the state, with the states of the other followed quantities.
pub(crate) fn why(unit: &UnitView) -> String {
    let reason = unit.assessment.reason.clone().unwrap_or_else(|| NO_DATA.to_owned());
    let states = unit.quantities.iter().filter_map(|view| view.row.state);
    states.fold(reason, |why, state| format!("{why}; {}", state.replace('_', " ")))
}

/// Date and hours of a crossing, or why there is none.
pub(crate) fn when(h: Option<f64>, at: Option<jiff::Timestamp>, unit: &UnitView) -> String {
    let s = &unit.assessment;
    match (h, at) {
        (Some(h), _) if h <= 0.0 => "now".to_owned(),
        (Some(h), Some(at)) => format!("{} ({} FH)", date(at), hours(h)),
        (Some(h), None) => format!("{} FH", hours(h)),
        (None, _) if s.limit_m.is_none() || s.gap_m.is_none() || s.state.is_none() => NO_DATA.to_owned(),
        (None, _) => "after the forecast horizon".to_owned(),
    }
}

#[derive(Template)]
#[template(path = "fleet.html")]
struct FleetView<'a> {
    root: &'static str,
    title: String,
    footer: String,
    report: &'a Report,
    groups: Vec<Group<'a>>,
    more_work: Vec<String>,
    label: &'static str,
    quantity_changes: Vec<Change>,
    more_quantity_changes: usize,
    map: Map<'a>,
    tail_pages: Vec<String>,
    /// Plot of estimates against inspections; empty without a pair.
    scatter: String,
}

#[derive(Template)]
#[template(path = "work.html")]
struct WorkView<'a> {
    root: &'static str,
    title: String,
    footer: String,
    groups: Vec<Group<'a>>,
    label: &'static str,
}

#[derive(Template)]
#[template(path = "tails.html")]
struct TailsView<'a> {
    root: &'static str,
    title: String,
    footer: String,
    map: Map<'a>,
}

/// Positions, and each tail with its units by position.
struct Map<'a> {
    positions: BTreeSet<&'a str>,
    rows: Vec<(&'a str, Vec<Vec<&'a UnitView>>)>,
}

/// Renders the fleet page and its continuation pages.
///
/// # Errors
/// When a template cannot be filled.
pub fn fleet_pages(report: &Report) -> Result<Vec<Page>, Error> {
    let mut work = work(report);
    let rest = work.split_off(FEW.min(work.len()));
    let mut pages = Vec::new();
    let mut more_work = Vec::new();
    for (k, chunk) in rest.chunks(WORK_ROWS).enumerate() {
        let path = format!("work-{}.html", k + 2);
        let title = format!("Work list, page {} · actuator free play", k + 2);
        let groups = grouped(chunk);
        let view = WorkView { root: "", title, footer: report.footer(), groups, label: "Work list" };
        pages.push(Page::html(path.clone(), &view.render()?));
        more_work.push(path);
    }
    let tails: Vec<&str> = report.tails.iter().map(|t| t.tail_number.as_str()).collect();
    let mut tail_pages = Vec::new();
    if tails.len() > FEW {
        for (k, chunk) in tails.chunks(TAIL_ROWS).enumerate() {
            let path = format!("tails-{}.html", k + 1);
            let title = format!("All tails, page {} · actuator free play", k + 1);
            let view = TailsView { root: "", title, footer: report.footer(), map: map(report, chunk) };
            pages.push(Page::html(path.clone(), &view.render()?));
            tail_pages.push(path);
        }
    }
    let view = index_page(report, grouped(&work), more_work, tail_pages)?;
    pages.push(Page::html("index.html".to_owned(), &view.render()?));
    Ok(pages)
}

fn index_page<'a>(
    report: &'a Report,
    groups: Vec<Group<'a>>,
    more_work: Vec<String>,
    tail_pages: Vec<String>,
) -> Result<FleetView<'a>, Error> {
    let quantity_changes = quantities::changes(report, "", |_| true);
    Ok(FleetView {
        root: "",
        title: "Actuator free play".to_owned(),
        footer: report.footer(),
        report,
        groups,
        more_work,
        label: "Work list",
        more_quantity_changes: quantity_changes.len().saturating_sub(FEW),
        quantity_changes: quantity_changes.into_iter().take(FEW).collect(),
        map: map(report, &most_urgent_tails(report)),
        tail_pages,
        scatter: agreement_plot(&inspection_pairs(report))?,
    })
}

/// Heading of the fleet page: scope and date.
fn heading(report: &Report) -> String {
    let scope = report.scope.as_deref().unwrap_or("Fleet");
    match report.as_of_utc {
        Some(day) => format!("{scope}: actuator free play – {}", date(day)),
        None => format!("{scope}: actuator free play"),
    }
}

/// What the report covers, and until when.
fn lead(report: &Report) -> String {
    format!(
        "{} · data to {} · assessed {}",
        report.scope.as_deref().unwrap_or("Whole fleet"),
        minute_or(report.newest_departure_utc),
        minute_or(report.as_of_utc),
    )
}

/// Number of units in a state.
fn in_state(report: &Report, badge: StateBadge) -> usize {
    report.units.iter().filter(|unit| unit.badge() == badge).count()
}

/// Number of units whose removal has no date, because their utilisation is unknown.
fn undated(report: &Report) -> usize {
    report.units.iter().filter(|unit| unit.assessment.hours_per_day.is_none()).count()
}

/// Inspections one by one, with their units.
fn checks(report: &Report) -> Vec<(&UnitView, &Inspection)> {
    let checks = report.units.iter().flat_map(|unit| unit.inspections.iter().map(move |check| (unit, check)));
    if report.inspections_given { checks.take(WORK_ROWS).collect() } else { Vec::new() }
}

/// What to do first, and how many units are in each state.
fn decision(report: &Report) -> String {
    let counts = StateBadge::ALL.map(|badge| (in_state(report, badge), badge.word()));
    let counts: Vec<String> =
        counts.into_iter().filter(|(n, _)| *n > 0).map(|(n, word)| format!("{} {word}", count(n))).collect();
    let first = work(report).into_iter().find(|unit| unit.badge().needs_action());
    let Some(unit) = first else {
        let counts = if counts.is_empty() { "no unit".to_owned() } else { counts.join(", ") };
        return format!("No unit needs action: {counts}.");
    };
    let action = unit.assessment.action_text.as_deref().unwrap_or("inspect");
    format!("{} ({}): {action}. In all: {}.", unit.place(), unit.name(), counts.join(", "))
}

/// Units that need action or have an open work request, by earliest date.
fn work(report: &Report) -> Vec<&UnitView> {
    let mut units: Vec<&UnitView> =
        report.units.iter().filter(|u| u.badge().needs_action() || u.open_request().is_some()).collect();
    units.sort_by(|a, b| urgency(a).partial_cmp(&urgency(b)).unwrap_or(std::cmp::Ordering::Equal));
    // Units of one tail are grouped for one maintenance visit, after the tail's most urgent unit.
    let mut first: BTreeMap<Option<&str>, usize> = BTreeMap::new();
    for (rank, unit) in units.iter().enumerate() {
        first.entry(unit.tail_number.as_deref()).or_insert(rank);
    }
    units.sort_by_key(|u| first.get(&u.tail_number.as_deref()).copied());
    units
}

fn urgency(unit: &UnitView) -> (u8, f64, String) {
    let due = unit.assessment.due_utc.map(|t| t.as_second() as f64);
    (unit.badge().rank(), due.unwrap_or(f64::MAX), unit.name())
}

fn grouped<'a>(units: &[&'a UnitView]) -> Vec<Group<'a>> {
    let tail = |unit: &UnitView| unit.tail_number.clone();
    let group = |units: &[&'a UnitView]| Group {
        tail: units[0].tail_number.as_deref().unwrap_or("tail not known"),
        units: units.to_vec(),
    };
    units.chunk_by(|a, b| tail(a) == tail(b)).map(group).collect()
}

/// State changes since the day before, and events of the last 30 days.
fn changes(report: &Report) -> Vec<(String, String, String, String)> {
    let mut found = Vec::new();
    for unit in &report.units {
        let s = &unit.assessment;
        let mut add = |what: String, detail: String| found.push((unit_path(unit), unit.name(), what, detail));
        if let Some(before) = s.state_day_before.as_ref().filter(|before| **before != s.state) {
            let was = StateBadge::from_state(before.as_deref());
            let now = unit.badge();
            add(
                if now.rank() < was.rank() { "worse" } else { "cleared" }.to_owned(),
                format!("{} → {}", was.word(), now.word()),
            );
        }
        for event in &unit.events {
            let age = report.as_of_utc.map(|now| days_between(event.departure_utc, now));
            if age.is_some_and(|age| age <= 30.0) {
                let books = match (event.is_on_record, event.is_tail_wide) {
                    (true, _) => "on record",
                    (false, true) => "whole tail at once: its sensor or recorder is likelier",
                    (false, false) => "not on record",
                };
                add(
                    event.kind.replace('_', " "),
                    format!("{}, {} µm, {books}", date(event.departure_utc), micrometres(event.step_m)),
                );
            }
        }
    }
    found.truncate(WORK_ROWS);
    found
}

fn most_urgent_tails(report: &Report) -> Vec<&str> {
    let mut worst: BTreeMap<&str, u8> = BTreeMap::new();
    for unit in &report.units {
        let Some(tail) = unit.tail_number.as_deref() else { continue };
        let rank = worst.entry(tail).or_insert(StateBadge::NORMAL.rank());
        *rank = unit.badge().rank().min(*rank);
    }
    let mut tails: Vec<(u8, &str)> = worst.into_iter().map(|(tail, s)| (s, tail)).collect();
    tails.sort_unstable();
    tails.into_iter().take(FEW).map(|(_, tail)| tail).collect()
}

fn map<'a>(report: &'a Report, tails: &[&'a str]) -> Map<'a> {
    let mut cells: BTreeMap<(&str, &str), Vec<&UnitView>> = BTreeMap::new();
    let mut positions = BTreeSet::new();
    for unit in &report.units {
        if let (Some(tail), Some(position)) = (&unit.tail_number, &unit.position) {
            positions.insert(position.as_str());
            cells.entry((tail, position)).or_default().push(unit);
        }
    }
    let row = |tail: &&'a str| {
        let of_tail = positions.iter().map(|position| cells.remove(&(*tail, *position)).unwrap_or_default());
        (*tail, of_tail.collect())
    };
    let rows = tails.iter().map(row).collect();
    Map { positions, rows }
}

/// Length of a month's bar, % of the largest bound of all months.
fn bar_percent(month: &Month, months: &[Month]) -> u32 {
    let most = months.iter().map(|m| m.high).fold(1.0, f64::max);
    (100.0 * month.expected / most) as u32
}

fn longest_without_estimate(report: &Report) -> Vec<&Tail> {
    let mut tails: Vec<&Tail> = report.tails.iter().collect();
    tails.sort_by_key(|t| (t.last_estimate_utc, t.tail_number.clone()));
    tails.truncate(FEW);
    tails
}

/// Days from a tail's last estimate to the date of the assessments.
fn days_without(report: &Report, tail: &Tail) -> String {
    let age = tail.last_estimate_utc.zip(report.as_of_utc).map(|(last, now)| days_between(last, now));
    or_no_data(age, |days| format!("{days:.0}"))
}

/// Coverage of the 90 % forecast intervals by forecast lead.
fn forecast_accuracy(report: &Report) -> Vec<(String, String, String)> {
    let mut ages: BTreeMap<i64, (usize, usize)> = BTreeMap::new();
    for past in report.units.iter().flat_map(|u| &u.past_forecasts) {
        let (held, all) = ages.entry(past.days_ago).or_default();
        *held += usize::from(past.held());
        *all += 1;
    }
    let row = |(days, (held, all)): (i64, (usize, usize))| {
        (
            format!("{days} days"),
            format!("{} of {}", count(held), count(all)),
            percent(held as f64 / all as f64),
        )
    };
    ages.into_iter().map(row).collect()
}

/// Pairs of estimate and hangar inspection, m.
fn inspection_pairs(report: &Report) -> Vec<(f64, f64)> {
    let checks = report.units.iter().flat_map(|u| &u.inspections);
    checks.filter_map(|i| Some((i.estimate_m?, i.play_m))).collect()
}

/// Agreement of each part's estimates with its inspections: part, pairs, bias, limits.
fn inspection_bias(report: &Report) -> Vec<(String, String, String, String)> {
    let mut parts: BTreeMap<&str, Vec<(f64, f64)>> = BTreeMap::new();
    for unit in &report.units {
        let pairs = unit.inspections.iter().filter_map(|i| Some((i.estimate_m?, i.play_m)));
        parts.entry(unit.part_number.as_deref().unwrap_or(NO_DATA)).or_default().extend(pairs);
    }
    let row = |(part, pairs): (&str, Vec<(f64, f64)>)| {
        let found = Agreement::of(&pairs);
        let text = |value: fn(&Agreement) -> String| or_no_data(found.as_ref(), value);
        (!pairs.is_empty()).then(|| {
            let bias = text(|a| format!("{} ± {}", micrometres(a.bias_m), micrometres(a.bias_half_width_m)));
            let limits = text(|a| format!("{} to {}", micrometres(a.lower_m), micrometres(a.upper_m)));
            (part.to_owned(), count(pairs.len()), bias, limits)
        })
    };
    parts.into_iter().filter_map(row).collect()
}

/// Agreement of estimates with hangar inspections, in words.
fn inspection_agreement(report: &Report) -> String {
    if !report.inspections_given {
        return "No data: no inspections table is configured (`logs.inspections`).".to_owned();
    }
    let pairs = inspection_pairs(report);
    let words = match Agreement::of(&pairs) {
        Some(a) => format!(
            "Estimate minus inspection over {}: bias {} ± {} µm (90 %), limits of agreement (95 % of differences) {} to {} µm.",
            counted(a.pairs, "pair"),
            micrometres(a.bias_m),
            micrometres(a.bias_half_width_m),
            micrometres(a.lower_m),
            micrometres(a.upper_m)
        ),
        None => format!("{}: at least 3 are needed to state a bias.", counted(pairs.len(), "pair")),
    };
    let unmatched = report.inspections_unmatched;
    if unmatched == 0 {
        return words;
    }
    format!("{words} {} of units without records.", counted(unmatched, "check"))
}
