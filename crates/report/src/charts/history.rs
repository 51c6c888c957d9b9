//! Chart of a unit: flights, smoothed gap, forecast, limits, inspections, maintenance and peers.

use jiff::{SignedDuration, Timestamp};
use records::report_rows::ReportFlight;
use records::time::DAY_S;
use trend::Interval;

use crate::charts::frame::{BAR, DATA, Frame, GRID, INK, LIMIT, PEER, PLAN, THIN, WATCH, day, thinned};
use crate::format::{date, micrometres};
use crate::model::UnitView;
use crate::peers::Peers;

/// Maximum number of points in the chart; above it, each point is the mean of neighbouring flights.
const MAX_POINTS: usize = 120;
/// Least distance of two labels of events, as a share of the width.
const LABEL_SHARE: f64 = 0.14;

/// Until when the forecast is drawn: the latest date on which the limit is reached, where it is at most three times as far
/// away as the likely one; else a fifth more than the likely one.
pub(crate) fn forecast_end(unit: &UnitView) -> Option<Timestamp> {
    let (start, whole) = (unit.forecast.first()?.0, unit.forecast.last()?.0);
    let ahead_s = |at: Timestamp| at.duration_since(start).as_secs_f64();
    let Some(likely_s) = unit.row.likely_utc.map(ahead_s).filter(|ahead_s| *ahead_s > 0.0) else {
        return Some(whole);
    };
    let latest_s = unit.row.not_after_utc.map(ahead_s).filter(|latest_s| *latest_s <= 3.0 * likely_s);
    let shown_s = latest_s.map_or(1.2 * likely_s, |latest_s| 1.05 * latest_s).max(30.0 * DAY_S);
    Some((start + SignedDuration::from_secs(shown_s as i64)).min(whole))
}

/// Whether the chart shows when the limit is reached.
pub(crate) fn shows_crossing(unit: &UnitView) -> bool {
    let is_ahead = unit.row.crossing_hours_p05.is_some_and(|hours| hours > 0.0);
    is_ahead && unit.row.not_before_utc.is_some_and(|from| Some(from) <= forecast_end(unit))
}

pub(crate) fn drawn_forecast(unit: &UnitView) -> Vec<(Timestamp, Interval)> {
    let end = forecast_end(unit);
    unit.forecast.iter().filter(|(at, _)| end.is_none_or(|end| *at <= end)).copied().collect()
}

/// Draws gap against date as an SVG picture; an empty string for a unit without an estimate.
pub(crate) fn history(unit: &UnitView, peers: &Peers<'_>) -> String {
    let all: Vec<[f64; 4]> = unit.flights.iter().filter_map(point).collect();
    let points = thinned(&all, MAX_POINTS);
    let (Some(first), Some(last)) = (points.first(), points.last()) else { return String::new() };
    let mut frame = frame(unit, peers, &points, first[0], last[0]);
    frame.grid(5);
    frame.dates(8);
    let forecast = drawn_forecast(unit);
    frame.clipped(|frame| {
        for peer in peers.curves(unit) {
            frame.line(peer.iter().map(|[at, gap_um]| (*at, *gap_um)), PEER);
        }
        draw_band(frame, &unit.level, r##"fill="#1C2530""##, INK);
        draw_band(frame, &forecast, r##"fill="#C85200""##, &format!(r#"{PLAN} stroke-dasharray="6 4""#));
        for [at, low, _, high] in &points {
            frame.line([(*at, *low), (*at, *high)], BAR);
        }
    });
    draw_limits(&mut frame, unit);
    draw_events(&mut frame, unit);
    let names = (all.len() == points.len()).then(|| unit.flights.iter().filter(|f| f.gap_m.is_some()));
    let mut names = names.into_iter().flatten();
    for [at, low, gap, high] in points {
        let name = names.next().map(|f| format!("{} {}: ", date(f.departure_utc), f.flight_id));
        let title = format!("{}{gap:.1} µm ({low:.1} to {high:.1})", name.unwrap_or_default());
        frame.dot((at, gap), 3.5, DATA, &title);
    }
    draw_inspections(&mut frame, unit);
    frame.finish("")
}

/// Scales that hold flights, limits, inspections, and the forecast up to a little above the limit.
fn frame(unit: &UnitView, peers: &Peers<'_>, points: &[[f64; 4]], first: f64, last: f64) -> Frame {
    let today = day(unit.row.as_of_utc).min(last + 400.0);
    let end = forecast_end(unit).map_or(today, day).max(last).max(today);
    let span = (end - first).max(14.0);
    let limit = unit.row.limit_m.map(|limit_m| limit_m * 1e6);
    let ahead = unit.forecast.iter().map(|(_, f)| f.p95_m * 1e6).fold(0.0, f64::max);
    let ahead = ahead.min(limit.map_or(f64::INFINITY, |limit| 1.1 * limit));
    let shown = unit.inspections.iter().map(|check| check.play_m * 1e6);
    let highest =
        points.iter().map(|p| p[3]).chain(limit).chain(shown.clone()).fold(ahead.max(1.0), f64::max);
    let peers = peers.curves(unit).flatten().map(|[_, gap_um]| *gap_um);
    let lowest = points.iter().map(|p| p[1]).chain(shown).chain(peers).fold(f64::INFINITY, f64::min);
    let room = 0.08 * (highest - lowest.min(0.8 * highest));
    let bottom = (lowest - 2.0 * room).max(lowest.min(0.0));
    let (x, y) = (first - 0.09 * span..first + 1.02 * span, bottom..highest + 1.5 * room);
    Frame::new([900.0, 440.0], [26.0, 6.0, 34.0, 6.0], x, y)
}

fn draw_band(frame: &mut Frame, band: &[(Timestamp, Interval)], fill: &str, pen: &str) {
    let um = |m: f64| m * 1e6;
    let edges: Vec<[f64; 3]> = band.iter().map(|(at, b)| [day(*at), um(b.p05_m), um(b.p95_m)]).collect();
    if !edges.is_empty() {
        frame.band(&edges, fill);
        frame.line(band.iter().map(|(at, b)| (day(*at), um(b.m))), pen);
    }
}

/// Draws both limits with their names, the crossing as a bar on the limit with its median as a mark, and today.
fn draw_limits(frame: &mut Frame, unit: &UnitView) {
    let row = &unit.row;
    for (name, limit_m, pen) in [("watch", unit.watch_m, WATCH), ("limit", row.limit_m, LIMIT)] {
        let level = limit_m.map(|limit_m| limit_m * 1e6).filter(|level| frame.y.contains(level));
        let Some(level) = level else { continue };
        frame.horizontal(level, pen);
        let text = format!("{name} {level:.0} µm");
        // At the right end of the limit is the crossing.
        if name == "limit" {
            frame.text((frame.x.start, level), [62.0, -5.0], "start", text);
        } else {
            frame.text((frame.x.end, level), [-4.0, -5.0], "end", text);
        }
    }
    let today = day(row.as_of_utc);
    if frame.x.contains(&today) {
        frame.vertical(today, THIN);
        frame.text((today, frame.y.start), [-4.0, -5.0], "end", "today");
    }
    let limit = row.limit_m.map(|limit_m| limit_m * 1e6).filter(|limit| frame.y.contains(limit));
    let is_ahead = row.crossing_hours_p05.is_some_and(|hours| hours > 0.0);
    let (Some(limit), Some(earliest)) = (limit.filter(|_| is_ahead), row.not_before_utc) else { return };
    let (from, end) = (day(earliest), frame.x.end);
    if from < end {
        let until = row.not_after_utc.map_or(end, day).min(end);
        frame.line([(from, limit), (until, limit)], &PLAN.replace("\"2\"", "\"7\""));
    }
    if let Some(likely) = row.likely_utc.map(day).filter(|likely| *likely < end) {
        frame.dot((likely, limit), 6.0, r##"fill="#C85200""##, "");
    }
    // A date that lies outside, or is not known.
    let beyond = match row.not_after_utc {
        _ if from >= end => format!("5 % by {} →", row.day(earliest)),
        Some(latest) if day(latest) > end => format!("95 % by {} →", row.day(latest)),
        None => "95 % later →".to_owned(),
        Some(_) => return,
    };
    frame.text((end, limit), [-4.0, 17.0], "end", beyond);
}

/// Draws maintenance, installations and changes as vertical lines, with a label where there is room.
fn draw_events(frame: &mut Frame, unit: &UnitView) {
    let changes = unit.events.iter().filter(|event| !event.kind.starts_with("exceedance"));
    let changes = changes.map(|event| (event.departure_utc, event.word(), PLAN));
    let installed = unit.installations.iter().map(|of| (of.installed_utc, "installed", GRID));
    let mut events: Vec<_> =
        changes.chain(installed).filter(|(at, ..)| frame.x.contains(&day(*at))).collect();
    events.sort_by_key(|(at, ..)| *at);
    let mut free_from = frame.x.start;
    for (at, word, pen) in events {
        frame.vertical(day(at), &pen.replace("\"2\"", "\"1\""));
        if day(at) >= free_from {
            frame.text((day(at), frame.y.end), [2.0, -8.0], "start", format!("↓ {word}"));
            free_from = day(at) + LABEL_SHARE * (frame.x.end - frame.x.start);
        }
    }
}

fn draw_inspections(frame: &mut Frame, unit: &UnitView) {
    let shown = frame.x.clone();
    for check in unit.inspections.iter().filter(|check| shown.contains(&day(check.date_utc))) {
        let title = format!("{} hangar: {} µm", date(check.date_utc), micrometres(check.play_m));
        frame.square((day(check.date_utc), check.play_m * 1e6), &title);
    }
}

/// Day, and 5 %, middle and 95 % of the gap of a flight with an estimate, µm.
fn point(flight: &ReportFlight) -> Option<[f64; 4]> {
    let gap_m = flight.gap_m?;
    let (low_m, high_m) = (flight.gap_p05_m.unwrap_or(gap_m), flight.gap_p95_m.unwrap_or(gap_m));
    Some([day(flight.departure_utc), low_m * 1e6, gap_m * 1e6, high_m * 1e6])
}
