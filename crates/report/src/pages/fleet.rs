//! Fleet page: warnings, work list, what is new, map of tails and positions, data; the rest behind details.

use std::collections::{BTreeMap, BTreeSet};

use askama::Template;
use records::assessment::action::{counts_text, state_rank};
use records::report_rows::{ReportInspectionRow, ReportTailRow};
use records::time::days_between;
use records::uncertainty::NORMAL_95;

use crate::format::{count, counted, date, micrometres, micrometres_or, or_no_data, rate, unbroken};
use crate::model::{Head, Report, UnitView};
use crate::page::{Error, Page, part_path, tail_path, unit_path};
use crate::pages::quantities::{self, Change};
use crate::pages::work_list::{Group, capital, grouped, work};
use crate::peers::Peers;
use crate::removal_forecast::removal_forecast;
use crate::state_badge::StateBadge;

const ROWS: usize = 100;
const FEW: usize = 40;
/// A month is shown only with at least this expected number of removals.
const LEAST_REMOVALS: f64 = 0.05;

#[derive(Template)]
#[template(path = "fleet.html")]
struct FleetView<'a> {
    head: Head,
    report: &'a Report,
    peers: &'a Peers<'a>,
    groups: Vec<Group<'a>>,
    more_work: Vec<String>,
    quantity_changes: Vec<Change<'a>>,
    more_quantity_changes: usize,
    map: Map<'a>,
    tail_pages: Vec<String>,
}

#[derive(Template)]
#[template(path = "work.html")]
struct WorkView<'a> {
    head: Head,
    peers: &'a Peers<'a>,
    groups: Vec<Group<'a>>,
}

#[derive(Template)]
#[template(path = "tails.html")]
struct TailsView<'a> {
    head: Head,
    map: Map<'a>,
}

/// Positions, and each tail with its installed units by position.
struct Map<'a> {
    positions: BTreeSet<&'a str>,
    rows: Vec<(&'a str, Vec<Vec<&'a UnitView>>)>,
}

/// Renders the fleet page and its continuation pages.
///
/// # Errors
/// When a template cannot be filled.
pub fn fleet_pages(report: &Report, peers: &Peers<'_>) -> Result<Vec<Page>, Error> {
    let mut work = work(report);
    let rest = work.split_off(FEW.min(work.len()));
    let (mut pages, mut more_work, mut tail_pages) = (Vec::new(), Vec::new(), Vec::new());
    for (k, chunk) in rest.chunks(ROWS).enumerate() {
        let path = format!("work-{}.html", k + 2);
        let title = format!("Work list, page {} · actuator free play", k + 2);
        let view = WorkView { head: report.head("", title), peers, groups: grouped(chunk) };
        pages.push(Page::html(path.clone(), &view.render()?));
        more_work.push(path);
    }
    let tails: Vec<&str> = report.tails.iter().map(|t| t.tail_number.as_str()).collect();
    for (k, chunk) in tails.chunks(ROWS).enumerate().filter(|_| tails.len() > FEW) {
        let path = format!("tails-{}.html", k + 1);
        let title = format!("All tails, page {} · actuator free play", k + 1);
        let view = TailsView { head: report.head("", title), map: map(report, chunk) };
        pages.push(Page::html(path.clone(), &view.render()?));
        tail_pages.push(path);
    }
    let quantity_changes = quantities::changes(report, "", |_| true);
    let view = FleetView {
        head: report.head("", "Actuator free play".to_owned()),
        report,
        peers,
        groups: grouped(&work),
        more_work,
        more_quantity_changes: quantity_changes.len().saturating_sub(FEW),
        quantity_changes: quantity_changes.into_iter().take(FEW).collect(),
        map: map(report, &most_urgent_tails(report)),
        tail_pages,
    };
    pages.push(Page::html("index.html".to_owned(), &view.render()?));
    Ok(pages)
}

fn heading(report: &Report) -> String {
    or_no_data(report.as_of_utc, |at| at.strftime("%a %-d %b %Y %H:%M UTC").to_string())
}

fn counts(report: &Report) -> String {
    match counts_text(report.units.iter().map(|unit| &unit.row)) {
        text if text.is_empty() => "No unit is installed.".to_owned(),
        text => text,
    }
}

/// State changes since the day before: path, place and serial number, change.
fn news(report: &Report) -> Vec<(String, String, String)> {
    let changed = |unit: &UnitView| {
        let now = unit.badge().word();
        let what = match &unit.state_day_before {
            Some(before) if before.as_deref() == unit.row.state => return None,
            Some(before) => format!("{} → {now}", StateBadge::from_state(before.as_deref()).word()),
            None if unit.row.gap_m.is_some() && unit.row.removed_utc.is_none() => {
                format!("first assessment: {now}")
            }
            None => return None,
        };
        Some((unit_path(unit), format!("{} {}", unit.place(), unit.row.serial_number), what))
    };
    report.units.iter().filter_map(changed).take(FEW).collect()
}

/// Removed units: path, serial number, and when with the last gap.
fn removed(report: &Report) -> Vec<(String, &str, String)> {
    let removed = report.units.iter().filter(|unit| unit.row.removed_utc.is_some()).take(FEW);
    removed.map(|unit| (unit_path(unit), unit.row.serial_number.as_str(), unit.row.why_text())).collect()
}

fn most_urgent_tails(report: &Report) -> Vec<&str> {
    let mut worst: BTreeMap<&str, u8> = BTreeMap::new();
    for unit in report.units.iter().filter(|unit| unit.row.removed_utc.is_none()) {
        let Some(tail) = unit.row.tail_number.as_deref() else { continue };
        let rank = worst.entry(tail).or_insert(u8::MAX);
        *rank = state_rank(unit.row.state).min(*rank);
    }
    let mut tails: Vec<(u8, &str)> = worst.into_iter().map(|(tail, rank)| (rank, tail)).collect();
    tails.sort_unstable();
    tails.into_iter().take(FEW).map(|(_, tail)| tail).collect()
}

fn map<'a>(report: &'a Report, tails: &[&'a str]) -> Map<'a> {
    let mut cells: BTreeMap<(&str, &str), Vec<&UnitView>> = BTreeMap::new();
    let mut positions = BTreeSet::new();
    for unit in report.units.iter().filter(|unit| unit.row.removed_utc.is_none()) {
        if let (Some(tail), Some(position)) = (&unit.row.tail_number, &unit.row.position) {
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

/// Tails, the one that is longest without an estimate first.
fn data(report: &Report) -> Vec<&ReportTailRow> {
    let mut tails: Vec<&ReportTailRow> = report.tails.iter().collect();
    tails.sort_by_key(|t| (t.last_estimate_utc, &t.tail_number));
    tails.truncate(FEW);
    tails
}

/// Days from a tail's last estimate to the date of the assessments.
fn days_without(report: &Report, tail: &ReportTailRow) -> String {
    let age = tail.last_estimate_utc.zip(report.as_of_utc).map(|(last, now)| days_between(last, now));
    or_no_data(age, |days| format!("{days:.0}"))
}

/// Number of flights with a log, and of all flights if the flights table has them.
pub(crate) fn logged(tail: &ReportTailRow) -> String {
    match tail.flown {
        Some(flown) if flown >= tail.flights => {
            format!("{} of {}", count(tail.flights as usize), count(flown as usize))
        }
        _ => count(tail.flights as usize),
    }
}

/// For each lead time in days, how many forecasts there were, and how many had the later gap in their 90 % interval.
fn forecast_check(report: &Report) -> Vec<(i64, String)> {
    let mut ages: BTreeMap<i64, (usize, usize)> = BTreeMap::new();
    for past in report.units.iter().flat_map(|u| &u.past_forecasts) {
        let (held, all) = ages.entry(past.days_ago).or_default();
        *held += usize::from(past.held());
        *all += 1;
    }
    ages.into_iter().map(|(days, (held, all))| (days, format!("{} of {}", count(held), count(all)))).collect()
}

/// Units that wear several times faster than their peers, the fastest first.
fn fast<'a>(report: &'a Report, peers: &Peers<'_>) -> Vec<(&'a UnitView, f64, String)> {
    let of = |unit: &'a UnitView| Some((unit, unit.row.rate_m_per_hour?, peers.faster_text(unit)?));
    let mut found: Vec<_> = report.units.iter().filter_map(of).collect();
    found.sort_by(|a, b| b.1.total_cmp(&a.1));
    found.truncate(FEW);
    found
}

fn checks(report: &Report) -> Vec<(&UnitView, &ReportInspectionRow)> {
    let checks = report.units.iter().flat_map(|unit| unit.inspections.iter().map(move |check| (unit, check)));
    checks.take(ROWS).collect()
}

/// Agreement of estimates with hangar inspections, in words: the mean difference with the 90 % interval of that mean (Bland and
/// Altman 1986).
fn inspection_agreement(report: &Report) -> String {
    if !report.inspections_given {
        return "No data: no inspections table is configured (`logs.inspections`).".to_owned();
    }
    let checks = report.units.iter().flat_map(|unit| &unit.inspections);
    let differences: Vec<f64> = checks.filter_map(ReportInspectionRow::difference_m).collect();
    let (n, pairs) = (differences.len() as f64, counted(differences.len(), "pair"));
    let bias_m = differences.iter().sum::<f64>() / n;
    let square: f64 = differences.iter().map(|difference| (difference - bias_m).powi(2)).sum();
    let half_width_m = NORMAL_95 * (square / (n - 1.0) / n).sqrt();
    let words = if differences.len() < 3 {
        format!("{pairs}: at least 3 are needed to state a bias.")
    } else {
        let (bias, half_width) = (micrometres(bias_m), micrometres(half_width_m));
        format!(
            "Estimate minus inspection over {pairs}: {bias} ± {half_width} µm (90 %); no estimate is corrected by it."
        )
    };
    match report.inspections_unmatched {
        0 => words,
        unmatched => format!("{words} {} of units without records.", counted(unmatched, "check")),
    }
}
