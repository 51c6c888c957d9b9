//! Unit page: assessment, history, events, data quality and past forecasts of one unit.

use askama::Template;
use records::uncertainty::NORMAL_95;

use crate::charts::history::{drawn_forecast, history};
use crate::format::{
    NO_DATA, count, counted, date, date_or, hours, level, micrometres, micrometres_cell, micrometres_or,
    minute, or_no_data, rate,
};
use crate::model::{Report, TimedInterval, UnitView};
use crate::page::{Error, Page, tail_path, unit_path};
use crate::pages::fleet::{when, why};
use crate::pages::quantities::{self, Change, Chart};
use crate::state_badge::StateBadge;
use crate::stats::crossing_probability::probability_text;
use crate::stats::rate_spread::RateSpreads;

#[derive(Template)]
#[template(path = "unit.html")]
struct View<'a> {
    root: &'static str,
    title: String,
    footer: String,
    report: &'a Report,
    spreads: &'a RateSpreads<'a>,
    unit: &'a UnitView,
    /// Page and number of the tail, and the position.
    place: Option<(String, String, String)>,
    plot: String,
    /// Dates of the crossing, earliest, median and latest; empty where unknown.
    crossing: [String; 3],
    forecast: Vec<(&'static str, String)>,
    quantity_changes: Vec<Change>,
    charts: Vec<Chart>,
    /// The forecast as far as it is drawn.
    drawn_forecast: Vec<TimedInterval>,
    /// Number of flights with a diagnostic plot.
    plots: usize,
}

type Facts = Vec<(&'static str, String)>;

/// Renders the page of a unit.
///
/// # Errors
/// If the plot cannot be drawn or the template cannot be rendered.
pub fn unit_page(report: &Report, spreads: &RateSpreads<'_>, unit: &UnitView) -> Result<Page, Error> {
    let s = &unit.assessment;
    let forecast =
        [("earliest (5 %)", s.not_before_utc), ("median", s.likely_utc), ("latest (95 %)", s.not_after_utc)];
    let view = View {
        root: "../",
        title: format!("{} · actuator free play", unit.name()),
        footer: report.footer(),
        report,
        spreads,
        unit,
        crossing: forecast.map(|(_, at)| at.map(date).unwrap_or_default()),
        place: unit.tail_number.as_ref().map(|tail| {
            (format!("../{}", tail_path(tail)), tail.clone(), unit.position.clone().unwrap_or_default())
        }),
        plot: history(unit)?,
        forecast: forecast.into_iter().filter_map(|(word, t)| Some((word, date(t?)))).collect(),
        quantity_changes: quantities::changes(report, "../", |change| {
            change.serial_number.as_ref() == Some(&unit.serial_number)
                && change.part_number == unit.part_number
        }),
        charts: quantities::unit_charts(unit)?,
        drawn_forecast: drawn_forecast(unit),
        plots: unit.flights.iter().filter(|flight| flight.plot_path.is_some()).count(),
    };
    Ok(Page::html(unit_path(unit), &view.render()?))
}

fn now(spreads: &RateSpreads<'_>, unit: &UnitView) -> Facts {
    let s = &unit.assessment;
    let fleet = unit.part_number.as_deref().and_then(|part| spreads.part(part));
    let fleet = or_no_data(fleet, |f| {
        format!("{} ({} to {}), {}", rate(f.median), rate(f.low), rate(f.high), counted(f.units, "unit"))
    });
    vec![
        ("Gap at the last record", unit.gap_text()),
        ("Records behind it", or_no_data(s.gap_records, |n| count(n as usize))),
        ("Latest record", latest_record(unit)),
        (
            "An installation may shift all gaps by [µm] (90 %)",
            or_no_data(s.installation_sd_m, |sd_m| micrometres(NORMAL_95 * sd_m)),
        ),
        ("Act limit", or_no_data(s.limit_m, |l| format!("{} µm", micrometres(l)))),
        ("% of limit", unit.share_text()),
        (
            "Rate [µm per 1000 FH], 90 % interval",
            rates(s.rate_p05_m_per_hour, s.rate_m_per_hour, s.rate_p95_m_per_hour),
        ),
        ("Fleet rate [µm per 1000 FH]: median, 5–95 %, units", fleet),
        ("Trend", s.trend.clone()),
    ]
}

fn latest_record(unit: &UnitView) -> String {
    let s = &unit.assessment;
    or_no_data(s.latest_utc, |at| format!("{}, {}", level(s.latest_gap_m, s.latest_gap_se_m), minute(at)))
}

fn rates(low: Option<f64>, middle: Option<f64>, high: Option<f64>) -> String {
    match (low, middle, high) {
        (Some(low), Some(middle), Some(high)) => {
            format!("{} ({} to {})", rate(middle), rate(low), rate(high))
        }
        _ => NO_DATA.to_owned(),
    }
}

fn remaining(report: &Report, unit: &UnitView) -> Facts {
    let s = &unit.assessment;
    let flights = s.crossing_hours_p50.zip(s.hours_per_flight).map(|(h, per)| h / per);
    let pace = or_no_data(s.hours_per_day, |h| format!("{h:.1} FH/day"));
    let check = probability_text(s, report.check_interval_hours);
    let check = format!("{check} ({} FH)", hours(report.check_interval_hours));
    vec![
        ("Earliest (5 %)", when(s.crossing_hours_p05, s.not_before_utc, unit)),
        ("Median", when(s.crossing_hours_p50, s.likely_utc, unit)),
        ("Latest (95 %)", when(s.crossing_hours_p95, s.not_after_utc, unit)),
        ("Median, flights", or_no_data(flights, |n| count(n.round() as usize))),
        ("Chance of reaching the limit before the next check", check),
        ("Utilisation, last 90 days", pace),
    ]
}

fn plot_description(unit: &UnitView) -> String {
    let estimated = unit.flights.iter().filter(|f| f.gap_m.is_some());
    let (first, last) = (estimated.clone().next(), estimated.clone().next_back());
    match (first, last) {
        (Some(first), Some(last)) => format!(
            "Gap of {} against date: {} from {} to {}, now {}, act limit {} µm",
            unit.name(),
            counted(estimated.count(), "estimate"),
            date(first.departure_utc),
            date(last.departure_utc),
            level(unit.assessment.gap_m, unit.assessment.gap_se_m),
            micrometres_or(unit.assessment.limit_m),
        ),
        _ => "No estimate yet".to_owned(),
    }
}

fn quality(unit: &UnitView) -> Facts {
    let q = &unit.quality;
    let list = |of: &[(String, usize)]| {
        let words: Vec<String> = of.iter().map(|(word, n)| format!("{word} {}", count(*n))).collect();
        if words.is_empty() { "none".to_owned() } else { words.join(", ") }
    };
    let remedies: Vec<String> = q.remedies.iter().map(|(code, remedy)| format!("{code}: {remedy}")).collect();
    let remedies = (!remedies.is_empty()).then(|| ("Remedies of rejections", remedies.join("; ")));
    let facts = vec![
        ("Flights used", count(q.estimated)),
        ("Flights rejected", count(q.refused)),
        ("Rejection reasons", list(&q.reasons)),
        ("Quality flags", list(&q.flags)),
        ("Last estimate", date_or(q.last_estimate_utc)),
        ("Days since", or_no_data(q.days_since_estimate, |d| format!("{d:.0}"))),
        ("Scatter / reported uncertainty", or_no_data(q.noise_ratio, |r| format!("{r:.2}"))),
    ];
    facts.into_iter().chain(remedies).collect()
}

fn statistics(unit: &UnitView) -> Facts {
    let s = &unit.assessment;
    vec![
        ("Unit hours [FH]", or_no_data(s.unit_hours, hours)),
        ("Most probable wear law", s.law.clone().unwrap_or_else(|| NO_DATA.to_owned())),
        ("Usage axis", or_no_data(s.axis.as_ref(), |axis| axis.replace('_', " "))),
        ("Forecast by", method(s.forecast_method.as_deref()).to_owned()),
        (
            "Previous-day state",
            match &s.state_day_before {
                Some(before) => StateBadge::from_state(before.as_deref()).word().to_owned(),
                None => NO_DATA.to_owned(),
            },
        ),
    ]
}

/// Fleet prior of the unit's part number, as text.
fn prior(report: &Report, unit: &UnitView) -> String {
    report.priors.iter().find(|p| p.part_number == unit.part_number).map_or_else(
        || NO_DATA.to_owned(),
        |p| {
            let part = p.part_number.as_deref().unwrap_or("units without a part number");
            format!(
                "Learned from {part} until {}: a new unit has {} ± {} µm (90 %); time from new to the act limit: median {} FH, \
                 90 % of units between {} and {} FH; wear follows {}.",
                date(p.learned_until_utc),
                micrometres(p.new_m),
                micrometres(NORMAL_95 * p.new_sd_m),
                hours(p.life_p50_hours),
                hours(p.life_p05_hours),
                hours(p.life_p95_hours),
                p.axis.replace('_', " "),
            )
        },
    )
}

/// What a forecast follows from, in words.
fn method(word: Option<&str>) -> &'static str {
    match word {
        Some("measured") => "none: records are at the limit",
        Some("fleet") => "wear laws, weighted by the part's fleet",
        Some("single_unit") => "wear laws, weighted by this unit's records alone",
        Some("line") => "line through the last records: no wear law explains them",
        _ => NO_DATA,
    }
}
