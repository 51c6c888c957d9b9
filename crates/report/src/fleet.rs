//! The fleet: what needs a decision, where it flies, what to expect, and how far to believe it.

use std::collections::{BTreeMap, BTreeSet};

use askama::Template;

use crate::agreement::Agreement;
use crate::model::{Report, Unit};
use crate::rates::spreads;
use crate::removals::removals;
use crate::scatter::scatter;
use crate::standing::Standing;
use crate::words::{
    NO_DATA, count, counted, date, date_or, days_between, hours, level, minute_or, percent, rate, um,
};
use crate::{Error, Page, serial_path, tail_path};

/// Rows of the work list on one page.
const WORK_ROWS: usize = 100;
/// Tails on one page.
const TAIL_ROWS: usize = 100;
/// Entries of the shorter lists.
const FEW: usize = 40;

/// A unit as a row of a table.
#[derive(Debug, Clone)]
pub(crate) struct Row {
    pub(crate) standing: Standing,
    pub(crate) link: String,
    pub(crate) name: String,
    pub(crate) position: String,
    pub(crate) gap: String,
    pub(crate) share: String,
    pub(crate) not_before: String,
    pub(crate) likely: String,
    pub(crate) why: String,
}

impl Row {
    pub(crate) fn of(unit: &Unit, root: &str) -> Self {
        let s = &unit.statement;
        Self {
            standing: unit.standing(),
            link: format!("{root}{}", serial_path(unit)),
            name: unit.name(),
            position: unit.position.clone().unwrap_or_else(|| NO_DATA.to_owned()),
            gap: level(s.gap_m, s.gap_se_m),
            share: share(unit).map_or_else(|| NO_DATA.to_owned(), percent),
            not_before: when(s.crossing_hours_p05, s.not_before_utc, unit),
            likely: when(s.crossing_hours_p50, s.likely_utc, unit),
            why: s.reason.clone().unwrap_or_else(|| NO_DATA.to_owned()),
        }
    }
}

/// Gap over limit.
pub(crate) fn share(unit: &Unit) -> Option<f64> {
    Some(unit.statement.gap_m? / unit.statement.limit_m?)
}

/// Hours and date of a crossing, or why there is none.
pub(crate) fn when(h: Option<f64>, at: Option<jiff::Timestamp>, unit: &Unit) -> String {
    let s = &unit.statement;
    match (h, at) {
        (Some(h), _) if h <= 0.0 => "now".to_owned(),
        (Some(h), Some(at)) => format!("{} ({} h)", date(at), hours(h)),
        (Some(h), None) => format!("{} h", hours(h)),
        (None, _) if s.limit_m.is_none() || s.gap_m.is_none() || s.state.is_none() => NO_DATA.to_owned(),
        (None, _) => "beyond the horizon".to_owned(),
    }
}

/// Who made the report, when, from what.
pub(crate) fn foot(report: &Report) -> String {
    let version = report.store_version.map_or_else(String::new, |v| format!(" from store version {v}"));
    format!("Made {} UTC by {}{version}.", crate::words::minute(report.made_utc), report.program)
}

/// Part, units, 5 %, median, 95 %, and the outlying units' pages.
type SpreadRow = (String, String, String, String, String, Vec<(String, String)>);
/// A tail, its page and its units.
type Group = (String, String, Vec<Row>);

#[derive(Template)]
#[template(path = "fleet.html")]
struct FleetView {
    root: &'static str,
    title: String,
    foot: String,
    lead: String,
    counts: Vec<(Standing, String)>,
    account: String,
    groups: Vec<Group>,
    more_work: Vec<String>,
    label: &'static str,
    news: Vec<(String, String, String, String)>,
    map: Map,
    tail_pages: Vec<String>,
    months: Vec<(String, String, String, u32)>,
    undated: usize,
    spreads: Vec<SpreadRow>,
    gaps: Vec<(String, String, String, String, String, String)>,
    faults: Vec<(String, String)>,
    more_faults: usize,
    calibration: Vec<(String, String, String)>,
    inspections: String,
    scatter: String,
    pairs: Vec<(String, String, String, String, String, String)>,
}

#[derive(Template)]
#[template(path = "work.html")]
struct WorkView {
    root: &'static str,
    title: String,
    foot: String,
    groups: Vec<Group>,
    label: &'static str,
}

#[derive(Template)]
#[template(path = "tails.html")]
struct TailsView {
    root: &'static str,
    title: String,
    foot: String,
    map: Map,
}

/// Tails by positions.
struct Map {
    positions: Vec<String>,
    rows: Vec<(String, String, Vec<Vec<Cell>>)>,
}

/// One unit in the map.
struct Cell {
    link: String,
    standing: Standing,
    name: String,
    text: String,
}

/// Makes the fleet page, the pages it goes on on, and the machine-readable twin.
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
        let view = WorkView { root: "", title, foot: foot(report), groups, label: "Work list" };
        pages.push(Page::html(path.clone(), &view.render()?));
        more_work.push(path);
    }
    let tails: Vec<&str> = report.tails.iter().map(|t| t.tail_number.as_str()).collect();
    let mut tail_pages = Vec::new();
    if tails.len() > FEW {
        for (k, chunk) in tails.chunks(TAIL_ROWS).enumerate() {
            let path = format!("tails-{}.html", k + 1);
            let title = format!("All tails, page {} · actuator free play", k + 1);
            let view = TailsView { root: "", title, foot: foot(report), map: map(report, chunk) };
            pages.push(Page::html(path.clone(), &view.render()?));
            tail_pages.push(path);
        }
    }
    let view = front(report, grouped(&work), more_work, tail_pages)?;
    pages.push(Page::html("index.html".to_owned(), &view.render()?));
    pages.push(Page { path: "report.json".to_owned(), body: serde_json::to_vec(report)? });
    Ok(pages)
}

fn front(
    report: &Report,
    groups: Vec<Group>,
    more_work: Vec<String>,
    tail_pages: Vec<String>,
) -> Result<FleetView, Error> {
    let number = |s: Standing| report.units.iter().filter(|u| u.standing() == s).count();
    let worst = worst_tails(report);
    let faults = report.log_faults.iter().map(|f| (f.log_path.clone(), f.code.clone()));
    let (inspections, pairs) = inspected(report);
    Ok(FleetView {
        root: "",
        title: "Actuator free play".to_owned(),
        foot: foot(report),
        lead: format!(
            "{} · flights to {} · statements of {}",
            report.scope.as_deref().unwrap_or("Whole fleet"),
            minute_or(report.newest_departure_utc),
            minute_or(report.as_of_utc),
        ),
        counts: Standing::ALL.map(|s| (s, count(number(s)))).into(),
        account: format!(
            "{} read · {} in error · {} · {}",
            counted(report.logs_known, "log"),
            counted(report.log_faults.len(), "log"),
            counted(report.tails.len(), "tail"),
            counted(report.units.len(), "unit"),
        ),
        groups,
        more_work,
        label: "Work list",
        news: news(report),
        map: map(report, &worst),
        tail_pages,
        months: months(report),
        undated: report.units.iter().filter(|u| u.statement.hours_per_day.is_none()).count(),
        spreads: spread_rows(report),
        gaps: gap_rows(report),
        more_faults: report.log_faults.len().saturating_sub(FEW),
        faults: faults.take(FEW).collect(),
        calibration: calibration(report),
        inspections,
        scatter: scatter(&compared(report))?,
        pairs,
    })
}

/// Units that call for a decision, by the day before which nothing happens.
fn work(report: &Report) -> Vec<&Unit> {
    let mut units: Vec<&Unit> = report.units.iter().filter(|u| u.standing().calls()).collect();
    units.sort_by(|a, b| urgency(a).partial_cmp(&urgency(b)).unwrap_or(std::cmp::Ordering::Equal));
    // One hangar visit serves a tail: its units follow its most urgent one.
    let mut first: BTreeMap<Option<&str>, usize> = BTreeMap::new();
    for (rank, unit) in units.iter().enumerate() {
        first.entry(unit.tail_number.as_deref()).or_insert(rank);
    }
    units.sort_by_key(|u| first.get(&u.tail_number.as_deref()).copied());
    units
}

fn urgency(unit: &Unit) -> (f64, Standing, String) {
    let days = unit.statement.not_before_utc.map(|t| t.as_second() as f64);
    (
        if unit.standing() == Standing::Act { 0.0 } else { days.unwrap_or(f64::MAX) },
        unit.standing(),
        unit.name(),
    )
}

fn grouped(units: &[&Unit]) -> Vec<Group> {
    let mut groups: Vec<Group> = Vec::new();
    for unit in units {
        let tail = unit.tail_number.as_deref().unwrap_or("tail not known");
        if groups.last().is_none_or(|(name, ..)| name != tail) {
            groups.push((tail.to_owned(), tail_path(tail), Vec::new()));
        }
        if let Some((_, _, rows)) = groups.last_mut() {
            rows.push(Row::of(unit, ""));
        }
    }
    groups
}

/// States that changed since the day before, and events of the last thirty days.
fn news(report: &Report) -> Vec<(String, String, String, String)> {
    let mut found = Vec::new();
    for unit in &report.units {
        let s = &unit.statement;
        let mut say =
            |what: String, detail: String| found.push((serial_path(unit), unit.name(), what, detail));
        if let Some(before) = s.state_day_before.as_ref().filter(|before| **before != s.state) {
            let was = Standing::of(before.as_deref());
            let now = unit.standing();
            say(
                if now < was { "worse" } else { "cleared" }.to_owned(),
                format!("{} → {}", was.word(), now.word()),
            );
        }
        for event in &unit.events {
            let age = report.as_of_utc.map(|now| days_between(event.departure_utc, now));
            if age.is_some_and(|age| age <= 30.0) {
                let books = match (event.in_books, event.tail_wide) {
                    (true, _) => "in the books",
                    (false, true) => "with the whole tail: sensor or recorder",
                    (false, false) => "not in the books",
                };
                say(
                    event.kind.clone(),
                    format!("{}, {} µm, {books}", date(event.departure_utc), um(event.step_m)),
                );
            }
        }
    }
    found.truncate(WORK_ROWS);
    found
}

fn worst_tails(report: &Report) -> Vec<&str> {
    let mut worst: BTreeMap<&str, Standing> = BTreeMap::new();
    for unit in &report.units {
        let Some(tail) = unit.tail_number.as_deref() else { continue };
        let standing = worst.entry(tail).or_insert(Standing::Normal);
        *standing = unit.standing().min(*standing);
    }
    let mut tails: Vec<(Standing, &str)> = worst.into_iter().map(|(tail, s)| (s, tail)).collect();
    tails.sort_unstable();
    tails.into_iter().take(FEW).map(|(_, tail)| tail).collect()
}

fn map(report: &Report, tails: &[&str]) -> Map {
    let mut cells: BTreeMap<(&str, &str), Vec<Cell>> = BTreeMap::new();
    let mut positions = BTreeSet::new();
    for unit in &report.units {
        let (Some(tail), Some(position)) = (unit.tail_number.as_deref(), unit.position.as_deref()) else {
            continue;
        };
        positions.insert(position);
        cells.entry((tail, position)).or_default().push(Cell {
            link: serial_path(unit),
            standing: unit.standing(),
            name: unit.name(),
            text: share(unit).map_or_else(|| NO_DATA.to_owned(), percent),
        });
    }
    let rows = tails.iter().map(|tail| {
        let row = positions.iter().map(|p| cells.remove(&(*tail, *p)).unwrap_or_default()).collect();
        ((*tail).to_owned(), tail_path(tail), row)
    });
    let rows = rows.collect();
    Map { positions: positions.into_iter().map(str::to_owned).collect(), rows }
}

fn months(report: &Report) -> Vec<(String, String, String, u32)> {
    let months = removals(report);
    let most = months.iter().map(|m| m.high).fold(1.0, f64::max);
    let row = |m: &crate::removals::Month| {
        let interval = format!("{:.1} to {:.1}", m.low, m.high);
        (m.name.clone(), format!("{:.1}", m.expected), interval, (100.0 * m.expected / most) as u32)
    };
    months.iter().map(row).collect()
}

fn spread_rows(report: &Report) -> Vec<SpreadRow> {
    let row = |s: crate::rates::Spread<'_>| {
        let outlying = s.outlying.iter().take(10);
        let outlying = outlying.map(|u| {
            let speed = u.statement.rate_m_per_hour.map_or_else(|| NO_DATA.to_owned(), rate);
            (serial_path(u), format!("{} ({speed})", u.serial_number))
        });
        (s.part.to_owned(), count(s.units), rate(s.low), rate(s.median), rate(s.high), outlying.collect())
    };
    spreads(report).into_iter().map(row).collect()
}

fn gap_rows(report: &Report) -> Vec<(String, String, String, String, String, String)> {
    let mut tails: Vec<&crate::model::Tail> = report.tails.iter().collect();
    tails.sort_by_key(|t| (t.last_estimate_utc, t.tail_number.clone()));
    let row = |t: &crate::model::Tail| {
        let age = t.last_estimate_utc.zip(report.as_of_utc).map(|(last, now)| days_between(last, now));
        let age = age.map_or_else(|| NO_DATA.to_owned(), |d| format!("{d:.0}"));
        let refused = format!("{} of {}", count(t.refused), count(t.records));
        (
            tail_path(&t.tail_number),
            t.tail_number.clone(),
            date_or(t.last_estimate_utc),
            age,
            refused,
            count(t.logs_in_error),
        )
    };
    tails.into_iter().take(FEW).map(row).collect()
}

/// Of the intervals stated so many days ago, how many held.
fn calibration(report: &Report) -> Vec<(String, String, String)> {
    let mut ages: BTreeMap<i64, (usize, usize)> = BTreeMap::new();
    for past in report.units.iter().flat_map(|u| &u.past) {
        let (held, all) = ages.entry(past.days_ago).or_default();
        *held += usize::from(past.held());
        *all += 1;
    }
    let row = |(days, (held, all)): (i64, (usize, usize))| {
        (
            format!("{days} days before"),
            format!("{} of {}", count(held), count(all)),
            percent(held as f64 / all as f64),
        )
    };
    ages.into_iter().map(row).collect()
}

type Pairs = Vec<(String, String, String, String, String, String)>;

/// Estimates and hangar checks that stand beside each other, m.
fn compared(report: &Report) -> Vec<(f64, f64)> {
    let checks = report.units.iter().flat_map(|u| &u.inspections);
    checks.filter_map(|i| Some((i.estimate_m?, i.play_m))).collect()
}

/// How estimates agree with hangar checks, in words and pair by pair.
fn inspected(report: &Report) -> (String, Pairs) {
    if !report.inspections_given {
        return (
            "No data: no table of inspections is configured (`logs.inspections`).".to_owned(),
            Vec::new(),
        );
    }
    let checks = || report.units.iter().flat_map(|u| u.inspections.iter().map(move |i| (u, i)));
    let pairs = compared(report);
    let words = match Agreement::of(&pairs) {
        Some(a) => format!(
            "Estimate minus inspection over {}: bias {} ± {} µm (95 %), limits of agreement {} to {} µm.",
            counted(a.pairs, "pair"),
            um(a.bias_m),
            um(a.bias_half_width_m),
            um(a.lower_m),
            um(a.upper_m)
        ),
        None => format!("{}: at least 3 are needed to state a bias.", counted(pairs.len(), "pair")),
    };
    let unmatched = report.inspections_unmatched;
    let words = if unmatched == 0 {
        words
    } else {
        format!("{words} {} of units without records.", counted(unmatched, "check"))
    };
    let row = |(u, i): (&Unit, &crate::model::Inspection)| {
        let difference = i.estimate_m.map_or_else(|| NO_DATA.to_owned(), |e| um(e - i.play_m));
        (
            serial_path(u),
            u.name(),
            date(i.date_utc),
            um(i.play_m),
            crate::words::um_or(i.estimate_m),
            difference,
        )
    };
    (words, checks().take(WORK_ROWS).map(row).collect())
}
