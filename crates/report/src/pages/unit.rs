//! Unit page: verdict, chart, how far to trust it, history and flights of one unit.

use askama::Template;
use jiff::Timestamp;
use records::uncertainty::NORMAL_95;
use trend::Interval;

use crate::charts::history::{drawn_forecast, history, shows_crossing};
use crate::charts::quantities::stroke_profile;
use crate::format::{
    NO_DATA, count, counted, date, hours, level, micrometres, micrometres_cell, micrometres_or, minute, rate,
    unbroken, whole_dates,
};
use crate::model::{Head, Report, UnitView};
use crate::page::{Error, Page, tail_path, unit_path};
use crate::pages::quantities::{self, Change, Chart, Level};
use crate::pages::work_list::{capital, what};
use crate::peers::Peers;

#[derive(Template)]
#[template(path = "unit.html")]
struct View<'a> {
    head: Head,
    report: &'a Report,
    peers: &'a Peers<'a>,
    unit: &'a UnitView,
    /// Page and number of the tail, and the position.
    place: Option<(String, String, String)>,
    warnings: Vec<&'a str>,
    /// Other units of the tail that need work.
    same_visit: Vec<&'a UnitView>,
    chart: String,
    /// The latest flight whose gap varies along the stroke: its largest gap in words, and its picture.
    profile: Option<(String, String)>,
    quantity_changes: Vec<Change<'a>>,
    charts: Vec<Chart>,
    levels: Vec<Level>,
    drawn_forecast: Vec<(Timestamp, Interval)>,
}

/// Renders the page of a unit.
///
/// # Errors
/// If the template cannot be rendered.
pub fn unit_page(report: &Report, peers: &Peers<'_>, unit: &UnitView) -> Result<Page, Error> {
    let row = &unit.row;
    let tail = row.tail_number.as_deref();
    let mate = |other: &&UnitView| {
        other.row.action.is_some()
            && other.row.tail_number.as_deref() == tail
            && other.row.serial_number != row.serial_number
    };
    let is_due = row.action.is_some() && tail.is_some();
    let view = View {
        head: report.head("../", format!("{} · actuator free play", unit.name())),
        report,
        peers,
        unit,
        place: tail.map(|tail| {
            (format!("../{}", tail_path(tail)), tail.to_owned(), row.position.clone().unwrap_or_default())
        }),
        warnings: tail.map(|tail| report.warnings(Some(tail))).unwrap_or_default(),
        same_visit: if is_due { report.units.iter().filter(mate).collect() } else { Vec::new() },
        chart: history(unit, peers),
        profile: unit
            .flights
            .iter()
            .rev()
            .find_map(|flight| stroke_profile(flight, row.limit_m.filter(|_| row.is_by_largest()))),
        quantity_changes: quantities::changes(report, "../", |change| {
            change.serial_number.as_ref() == Some(&row.serial_number) && change.part_number == row.part_number
        }),
        charts: quantities::unit_charts(unit),
        levels: unit.quantities.iter().filter_map(quantities::level).collect(),
        drawn_forecast: drawn_forecast(unit),
    };
    Ok(Page::html(unit_path(unit), &view.render()?))
}

fn verdict(unit: &UnitView) -> String {
    let row = &unit.row;
    match row.action_text() {
        Some(action) => format!("{}: {}.", capital(&action), row.why_text()),
        None if row.removed_utc.is_some() => format!("{}.", capital(&row.why_text())),
        None => format!("Nothing to do: {}.", row.why_text()),
    }
}

/// Gap, rate, peers and usage, each with its name.
fn facts(peers: &Peers<'_>, unit: &UnitView) -> Vec<(&'static str, String)> {
    let row = &unit.row;
    let rates = row.rate_m_per_hour.map(|middle| match (row.rate_p05_m_per_hour, row.rate_p95_m_per_hour) {
        (Some(low), Some(high)) => format!("{} ({} to {})", rate(middle), rate(low), rate(high)),
        _ => rate(middle),
    });
    let largest = unit.flights.iter().rev().find_map(|f| Some((f.departure_utc, f.gap_largest_m.0?)));
    let largest = largest.filter(|_| !row.is_by_largest());
    let known = [
        (
            if row.is_by_largest() { "Gap, largest along the stroke" } else { "Gap" },
            Some(level(row.gap_m, row.gap_se_m)),
        ),
        ("Limit [µm]", row.limit_m.map(micrometres)),
        ("Largest along the stroke", largest.map(|(at, m)| format!("{} µm, {}", micrometres(m), date(at)))),
        ("Wear [µm/1000 FH], 90 %", rates),
        ("Its peers, median", peers.median_rate(unit).map(rate)),
        ("Usage [FH/day]", row.hours_per_day.map(|h| format!("{h:.1}"))),
        ("Unit hours [FH]", row.unit_hours.map(hours)),
    ];
    known.into_iter().filter_map(|(name, value)| Some((name, value?))).collect()
}

/// What supports the gap and its forecast, and what speaks against them.
fn trust(unit: &UnitView) -> Vec<String> {
    let (row, quality) = (&unit.row, &unit.quality);
    let mut lines = Vec::new();
    for check in &unit.inspections {
        let (day, measured) = (date(check.date_utc), micrometres(check.play_m));
        let flights = counted(check.estimates as usize, "flight");
        let estimated = check.estimate_m.map_or_else(
            || "no estimate shortly before".to_owned(),
            |m| format!("{} µm estimated from the {flights} before", micrometres(m)),
        );
        lines.push(format!("Hangar {day}: {measured} µm measured, {estimated}."));
    }
    let held = unit.past_forecasts.iter().filter(|past| past.held()).count();
    if !unit.past_forecasts.is_empty() {
        let all = counted(unit.past_forecasts.len(), "earlier forecast");
        lines.push(format!("{held} of {all} for today contained the gap found."));
    }
    let (used, rejected) = (counted(quality.estimated, "flight"), count(quality.refused));
    lines.push(format!("{used} used, {rejected} rejected."));
    let reason = |(code, n): &(String, usize)| {
        let remedy = quality.remedies.get(code).map_or_else(String::new, |remedy| format!(": {remedy}"));
        format!("Rejected {} as {code}{remedy}.", count(*n))
    };
    lines.extend(quality.reasons.iter().map(reason));
    lines.extend(quality.flags.iter().map(|(flag, n)| format!("Flag {flag} on {}.", counted(*n, "flight"))));
    if let Some(sd_m) = row.installation_sd_m.filter(|sd_m| *sd_m > 0.0) {
        let shift = micrometres(NORMAL_95 * sd_m);
        lines.push(format!("An installation may shift all its gaps by up to {shift} µm (90 %)."));
    }
    lines
}

/// Everything that happened to the unit, latest first: date and text.
fn past(unit: &UnitView) -> Vec<(Timestamp, String)> {
    let mut all = Vec::new();
    for at in &unit.installations {
        let place = format!("{} {}", at.tail_number, at.position);
        all.push((at.installed_utc, format!("installed on {place}")));
        all.extend(at.removed_utc.map(|removed| (removed, format!("removed from {place}"))));
    }
    for event in &unit.events {
        let size = match event.kind.as_str() {
            "onset" | "exceedance" | "exceedance_not_confirmed" => String::new(),
            _ if event.step_m == 0.0 => String::new(),
            _ => format!(": {:+.1} µm", event.step_m * 1e6).replace('-', "−"),
        };
        let books = match (event.kind.as_str(), event.is_on_record) {
            ("reset" | "step", false) => ", not on record",
            (_, true) => ", on record",
            _ => "",
        };
        all.push((event.departure_utc, format!("{}{size}{books}", event.word())));
    }
    for check in &unit.inspections {
        let how = check.instrument.as_deref().map_or_else(String::new, |with| format!(", {with}"));
        let force = check.force_n.map_or_else(String::new, |force_n| format!(", {force_n:.0} N"));
        all.push((check.date_utc, format!("hangar check: {} µm{how}{force}", micrometres(check.play_m))));
    }
    for request in &unit.work_requests {
        let said = request.reason.as_deref().map_or_else(String::new, |reason| format!(": {reason}"));
        let by = request.by.as_deref().map_or_else(String::new, |by| format!(" ({by})"));
        all.push((request.opened_utc, format!("work request {}{by}{said}", request.title())));
    }
    all.sort_by_key(|(at, _)| std::cmp::Reverse(*at));
    all
}

fn chart_description(unit: &UnitView) -> String {
    let estimated = || unit.flights.iter().filter(|f| f.gap_m.is_some());
    let (Some(first), Some(last)) = (estimated().next(), estimated().next_back()) else {
        return String::new();
    };
    format!(
        "Gap of {} against date: {} from {} to {}, now {}, limit {} µm. {}",
        unit.name(),
        counted(estimated().count(), "estimate"),
        date(first.departure_utc),
        date(last.departure_utc),
        level(unit.row.gap_m, unit.row.gap_se_m),
        micrometres_or(unit.row.limit_m),
        unit.row.chance_text().unwrap_or_default(),
    )
}

/// What the forecast follows from, and what was assumed of such a unit before its own flights.
fn prior(report: &Report, unit: &UnitView) -> String {
    let method = match unit.row.forecast_method {
        Some("measured") => "none: records are at the limit",
        Some("fleet") => "wear laws, weighted by the part's fleet",
        Some("single_unit") => "wear laws, weighted by this unit's records alone",
        Some("line") => "line through the last records: no wear law explains them",
        _ => NO_DATA,
    };
    let law = unit.row.wear_law.as_deref().unwrap_or(NO_DATA);
    let prior = report.priors.iter().find(|p| p.part_number == unit.row.part_number).map(|p| {
        format!(
            " Fleet prior, learned from {} until {}: a new unit has {} ± {} µm (90 %); time from new to the limit: median {} FH, \
             90 % of units between {} and {} FH; wear follows {}.",
            p.part_number.as_deref().unwrap_or("units without a part number"),
            date(p.learned_until_utc),
            micrometres(p.new_m),
            micrometres(NORMAL_95 * p.new_sd_m),
            hours(p.life_p50_hours),
            hours(p.life_p05_hours),
            hours(p.life_p95_hours),
            p.axis.replace('_', " "),
        )
    });
    format!("Forecast: {method}. Most probable wear law: {law}.{}", prior.unwrap_or_default())
}
