//! The page of one unit: its statement, the evidence, and how good that is.

use askama::Template;

use crate::crossing::chance_in_words;
use crate::fleet::{share, when};
use crate::model::{FlightRow, Report, Unit};
use crate::rates::Spreads;
use crate::standing::Standing;
use crate::words::{
    NO_DATA, count, counted, date, date_or, hours, level, minute, percent, rate, um, um_cell, um_or,
};
use crate::{Error, Page, chart, serial_path, tail_path};

#[derive(Template)]
#[template(path = "serial.html")]
struct View {
    root: &'static str,
    title: String,
    foot: String,
    name: String,
    place: Option<(String, String, String)>,
    standing: Standing,
    reason: String,
    now: Facts,
    remaining: Facts,
    picture: String,
    picture_words: String,
    limit: String,
    watch: String,
    forecast: Vec<(&'static str, String)>,
    events: Vec<(String, String, String, &'static str)>,
    stays: Vec<(String, String, String, String, String)>,
    quality: Facts,
    past: Vec<(String, String, String, String, String, &'static str)>,
    checks: Vec<(String, String, String, String, String)>,
    record: Facts,
    prior: String,
    band: Vec<(String, &'static str, String, String, String)>,
    flights: Vec<Flight>,
}

type Facts = Vec<(&'static str, String)>;

/// A flight as a row.
struct Flight {
    when: String,
    id: String,
    place: String,
    hours: String,
    gap: String,
    low: String,
    high: String,
    midrange: String,
    reversals: String,
    load: String,
    remarks: String,
}

/// Makes the page of a unit.
///
/// # Errors
/// When the picture cannot be drawn or the template not be filled.
pub fn serial_page(report: &Report, spreads: &Spreads<'_>, unit: &Unit) -> Result<Page, Error> {
    let s = &unit.statement;
    let forecast =
        [("not before", s.not_before_utc), ("likely", s.likely_utc), ("not after", s.not_after_utc)];
    let view = View {
        root: "../",
        title: format!("{} · actuator free play", unit.name()),
        foot: crate::fleet::foot(report),
        name: unit.name(),
        place: unit.tail_number.as_ref().map(|tail| {
            (format!("../{}", tail_path(tail)), tail.clone(), unit.position.clone().unwrap_or_default())
        }),
        standing: unit.standing(),
        reason: s.reason.clone().unwrap_or_else(|| NO_DATA.to_owned()),
        now: now(spreads, unit),
        remaining: remaining(report, unit),
        picture: chart::history(unit)?,
        picture_words: picture_words(unit),
        limit: um_cell(s.limit_m),
        watch: um_cell(s.watch_m),
        forecast: forecast.into_iter().filter_map(|(word, t)| Some((word, date(t?)))).collect(),
        events: events(unit),
        stays: stays(unit),
        quality: quality(unit),
        past: past(unit),
        checks: checks(unit),
        record: record(unit),
        prior: prior(report, unit),
        band: band(unit),
        flights: unit.flights.iter().map(flight).collect(),
    };
    Ok(Page::html(serial_path(unit), &view.render()?))
}

fn now(spreads: &Spreads<'_>, unit: &Unit) -> Facts {
    let s = &unit.statement;
    let fleet = unit.part_number.as_deref().and_then(|part| spreads.part(part));
    let fleet = fleet.map_or_else(
        || NO_DATA.to_owned(),
        |f| {
            format!(
                "median {}, 5 to 95 % {} to {}, {}",
                rate(f.median),
                rate(f.low),
                rate(f.high),
                counted(f.units, "unit")
            )
        },
    );
    vec![
        ("Gap now", level(s.gap_m, s.gap_se_m)),
        ("Act limit", s.limit_m.map_or_else(|| NO_DATA.to_owned(), |l| format!("{} µm", um(l)))),
        ("Share of limit", share(unit).map_or_else(|| NO_DATA.to_owned(), percent)),
        ("Rate, µm per 1000 h", rates(s.rate_p05_m_per_hour, s.rate_m_per_hour, s.rate_p95_m_per_hour)),
        ("Rate of this part's fleet", fleet),
        ("Trend", s.trend.clone()),
    ]
}

fn rates(low: Option<f64>, middle: Option<f64>, high: Option<f64>) -> String {
    match (low, middle, high) {
        (Some(low), Some(middle), Some(high)) => {
            format!("{} ({} to {})", rate(middle), rate(low), rate(high))
        }
        _ => NO_DATA.to_owned(),
    }
}

fn remaining(report: &Report, unit: &Unit) -> Facts {
    let s = &unit.statement;
    let flights = s.crossing_hours_p50.zip(s.hours_per_flight).map(|(h, per)| h / per);
    let pace = s.hours_per_day.map_or_else(|| NO_DATA.to_owned(), |h| format!("{h:.1} h a day"));
    vec![
        ("Not before", when(s.crossing_hours_p05, s.not_before_utc, unit)),
        ("Likely", when(s.crossing_hours_p50, s.likely_utc, unit)),
        ("Not after", when(s.crossing_hours_p95, s.not_after_utc, unit)),
        ("Likely, in flights", flights.map_or_else(|| NO_DATA.to_owned(), |n| count(n.round() as usize))),
        ("Limit met before the next check", chance_in_words(s, report.check_interval_hours)),
        ("Use in the last 90 days", pace),
    ]
}

fn picture_words(unit: &Unit) -> String {
    let estimated = unit.flights.iter().filter(|f| f.gap_m.is_some());
    let (first, last) = (estimated.clone().next(), estimated.clone().next_back());
    match (first, last) {
        (Some(first), Some(last)) => format!(
            "Gap of {} against date: {} from {} to {}, now {}, act limit {} µm",
            unit.name(),
            counted(estimated.count(), "estimate"),
            date(first.departure_utc),
            date(last.departure_utc),
            level(unit.statement.gap_m, unit.statement.gap_se_m),
            um_or(unit.statement.limit_m),
        ),
        _ => "No estimate yet".to_owned(),
    }
}

fn events(unit: &Unit) -> Vec<(String, String, String, &'static str)> {
    let row = |e: &crate::model::Event| {
        let size = if e.kind == "onset" { "–".to_owned() } else { um(e.step_m) };
        let kind =
            if e.tail_wide { format!("{}, whole tail: sensor or recorder", e.kind) } else { e.kind.clone() };
        (date(e.departure_utc), kind, size, if e.in_books { "yes" } else { "no" })
    };
    unit.events.iter().map(row).collect()
}

fn stays(unit: &Unit) -> Vec<(String, String, String, String, String)> {
    let row = |s: &crate::model::Stay| {
        let until = s.removed_utc.map_or_else(|| "still there".to_owned(), date);
        (
            format!("../{}", tail_path(&s.tail_number)),
            s.tail_number.clone(),
            s.position.clone(),
            date(s.installed_utc),
            until,
        )
    };
    unit.stays.iter().map(row).collect()
}

fn quality(unit: &Unit) -> Facts {
    let q = &unit.quality;
    let list = |of: &[(String, usize)]| {
        let words: Vec<String> = of.iter().map(|(word, n)| format!("{word} {}", count(*n))).collect();
        if words.is_empty() { "none".to_owned() } else { words.join(", ") }
    };
    vec![
        ("Flights used", count(q.estimated)),
        ("Flights refused", count(q.refused)),
        ("Why refused", list(&q.reasons)),
        ("Doubts", list(&q.doubts)),
        ("Last estimate", date_or(q.last_estimate_utc)),
        ("Days since", q.days_since_estimate.map_or_else(|| NO_DATA.to_owned(), |d| format!("{d:.0}"))),
        (
            "Noise found over stated",
            q.noise_found_over_stated.map_or_else(|| NO_DATA.to_owned(), |r| format!("{r:.2}")),
        ),
    ]
}

fn past(unit: &Unit) -> Vec<(String, String, String, String, String, &'static str)> {
    let row = |p: &crate::model::Past| {
        let interval =
            format!("{} ({} to {})", um(p.foreseen_m), um(p.foreseen_low_m), um(p.foreseen_high_m));
        let state = Standing::of(p.state.as_deref()).word().to_owned();
        (
            date(p.as_of_utc),
            state,
            um(p.gap_m),
            interval,
            um(p.found_m),
            if p.held() { "held" } else { "missed" },
        )
    };
    unit.past.iter().map(row).collect()
}

fn checks(unit: &Unit) -> Vec<(String, String, String, String, String)> {
    let row = |i: &crate::model::Inspection| {
        let force = i.force_n.map_or_else(|| NO_DATA.to_owned(), |f| format!("{f:.0}"));
        let instrument = i.instrument.clone().unwrap_or_else(|| NO_DATA.to_owned());
        (date(i.date_utc), um(i.play_m), um_or(i.estimate_m), instrument, force)
    };
    unit.inspections.iter().map(row).collect()
}

fn record(unit: &Unit) -> Facts {
    let s = &unit.statement;
    vec![
        ("Unit hours", s.unit_hours.map_or_else(|| NO_DATA.to_owned(), hours)),
        ("Wear law believed in most", s.law.clone().unwrap_or_else(|| NO_DATA.to_owned())),
        ("Usage axis", s.axis.as_ref().map_or_else(|| NO_DATA.to_owned(), |axis| axis.replace('_', " "))),
        ("Mann–Kendall, two-sided p", s.mann_kendall_p.map_or_else(|| NO_DATA.to_owned(), small)),
        ("The same, allowing for autocorrelation", s.hamed_rao_p.map_or_else(|| NO_DATA.to_owned(), small)),
        (
            "Sen's slope, µm per 1000 h",
            rates(s.sen_low_m_per_hour, s.sen_rate_m_per_hour, s.sen_high_m_per_hour),
        ),
        (
            "State the day before",
            match &s.state_day_before {
                Some(before) => Standing::of(before.as_deref()).word().to_owned(),
                None => NO_DATA.to_owned(),
            },
        ),
    ]
}

/// Widening worth a word: less comes of counting few past forecasts.
const WIDER: f64 = 1.15;

/// What was believed of a unit like this one before its own flights were looked at.
fn prior(report: &Report, unit: &Unit) -> String {
    report.priors.iter().find(|p| p.part_number == unit.part_number).map_or_else(
        || NO_DATA.to_owned(),
        |p| {
            let part = p.part_number.as_deref().unwrap_or("units without a part number");
            let wider = if p.widening > WIDER {
                format!(
                    "Past forecasts of this fleet missed more often than they should: its intervals are {:.1} \
                     times as wide as they usually are.",
                    p.widening
                )
            } else {
                "Past forecasts of this fleet held: its intervals are as wide as usual.".to_owned()
            };
            format!(
                "Learned from {part} until {}: a new unit has {} ± {} µm; from new to the act limit it takes {} h, \
                 90 % of units between {} and {} h; wear follows {}. {wider}",
                date(p.learned_until_utc),
                um(p.new_m),
                um(1.645 * p.new_sd_m),
                hours(p.life_p50_hours),
                hours(p.life_p05_hours),
                hours(p.life_p95_hours),
                p.axis.replace('_', " "),
            )
        },
    )
}

/// The level through past flights and the fan ahead, as rows.
fn band(unit: &Unit) -> Vec<(String, &'static str, String, String, String)> {
    let row = |what: &'static str| {
        move |b: &crate::model::Banded| (minute(b.at_utc), what, um(b.m), um(b.p05_m), um(b.p95_m))
    };
    unit.level.iter().map(row("level")).chain(unit.forecast.iter().map(row("forecast"))).collect()
}

/// A probability; one too small for three places is never shown as none.
fn small(p: f64) -> String {
    if p < 0.001 { "below 0.001".to_owned() } else { format!("{p:.3}") }
}

fn flight(f: &FlightRow) -> Flight {
    let load = f.load_p05_n.zip(f.load_p95_n).map(|(low, high)| format!("{low:.0} to {high:.0}"));
    Flight {
        when: minute(f.departure_utc),
        id: f.flight_id.clone(),
        place: format!("{} {}", f.tail_number, f.position),
        hours: f.unit_hours.map(|h| format!("{h:.1}")).unwrap_or_default(),
        gap: um_cell(f.gap_m),
        low: um_cell(f.gap_p05_m),
        high: um_cell(f.gap_p95_m),
        midrange: um_cell(f.gap_midrange_m),
        reversals: f.load_reversals.map(|n| n.to_string()).unwrap_or_default(),
        load: load.unwrap_or_default(),
        remarks: f.remarks.clone(),
    }
}
