//! Small charts: a followed quantity that changed, the gap along the stroke, and the gaps of a unit without labels.

use jiff::Timestamp;
use records::Quantity;
use records::report_rows::ReportFlight;
use records::uncertainty::NORMAL_95;

use crate::charts::frame::{DATA, Frame, INK, LIMIT, PLAN, day, thinned};
use crate::format::date;

/// Most points; above it, each is the mean of neighbouring flights.
const MAX_POINTS: usize = 90;

/// Draws the flights of a unit against date, its fitted level from the last step on, and steps as vertical lines.
pub(crate) fn small_chart(
    quantity: Quantity,
    flights: &[(Timestamp, f64)],
    level: Option<f64>,
    steps: &[Timestamp],
) -> String {
    let (_, factor) = quantity.display_unit();
    let all: Vec<[f64; 2]> = flights.iter().map(|(at, value)| [day(*at), value * factor]).collect();
    let points = thinned(&all, MAX_POINTS);
    let (Some(first), Some(last)) = (points.first(), points.last()) else { return String::new() };
    let level = level.map(|level| level * factor);
    let values = || points.iter().map(|p| p[1]).chain(level);
    let (low, high) = (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
    let margin = (0.1 * (high - low)).max(0.02 * high.abs()).max(1e-9);
    let span = (last[0] - first[0]).max(1.0);
    let x = first[0] - 0.12 * span..last[0] + 0.02 * span;
    let mut frame = Frame::new([420.0, 150.0], [14.0, 2.0, 24.0, 2.0], x, low - margin..high + margin);
    frame.grid(4);
    frame.dates(3);
    points.iter().for_each(|p| frame.dot((p[0], p[1]), 2.0, DATA, ""));
    steps.iter().for_each(|step| frame.vertical(day(*step), PLAN));
    if let Some(level) = level {
        let from = steps.iter().map(|step| day(*step)).fold(first[0], f64::max);
        frame.line([(from, level), (last[0], level)], INK);
    }
    frame.finish("")
}

/// The largest gap along the stroke of a flight whose gap varies, in words; and its picture: gap, µm, with its 90 % interval
/// against the screw position, mm, the largest as a disc, and the limit, m, where it applies to the largest.
pub(crate) fn stroke_profile(flight: &ReportFlight, limit_m: Option<f64>) -> Option<(String, String)> {
    let points: Vec<[f64; 4]> = flight
        .profile
        .0
        .iter()
        .map(|[at_m, m, se_m]| (1e3 * at_m, 1e6 * m, 1e6 * NORMAL_95 * se_m))
        .map(|(at, gap, bound)| [at, gap - bound, gap, gap + bound])
        .collect();
    let (first, last) = (points.first()?, points.last()?);
    let [at, low, gap, high] = points.iter().max_by(|a, b| a[2].total_cmp(&b[2]))?;
    let largest = format!("{gap:.1} µm ({low:.1} to {high:.1}) at {at:.1} mm");
    let limit = limit_m.map(|limit_m| 1e6 * limit_m);
    let highest = points.iter().map(|p| p[3]).chain(limit).fold(0.0, f64::max);
    let margin = 0.06 * (last[0] - first[0]);
    let x = first[0] - 2.0 * margin..last[0] + margin;
    let mut frame = Frame::new([420.0, 200.0], [14.0, 2.0, 24.0, 2.0], x, 0.0..1.1 * highest);
    frame.grid(4);
    frame.numbers(6, "mm");
    let band: Vec<[f64; 3]> = points.iter().map(|[at, low, _, high]| [*at, *low, *high]).collect();
    frame.clipped(|frame| frame.band(&band, DATA));
    frame.line(points.iter().map(|[at, _, gap, _]| (*at, *gap)), INK);
    limit.into_iter().for_each(|limit| frame.horizontal(limit, LIMIT));
    frame.dot((*at, *gap), 3.5, DATA, &largest);
    Some((format!("{}: largest {largest}", date(flight.departure_utc)), frame.finish("")))
}

/// Draws points, µm, and a dashed limit, µm, on shared axes as an SVG picture; empty for fewer than two points.
pub(crate) fn sparkline(
    size: [f64; 2],
    x: [f64; 2],
    full: f64,
    points: &[[f64; 2]],
    limit: Option<f64>,
) -> String {
    if points.len() < 2 {
        return String::new();
    }
    let mut frame = Frame::new(size, [2.0; 4], x[0]..x[1], 0.0..full);
    if let Some(limit) = limit {
        frame.horizontal(limit, &format!(r#"{} stroke-dasharray="4 3""#, LIMIT.replace("\"2\"", "\"1\"")));
    }
    let area: Vec<[f64; 3]> = points.iter().map(|[at, gap]| [*at, 0.0, *gap]).collect();
    frame.band(&area, DATA);
    frame.line(points.iter().map(|[at, gap]| (*at, *gap)), INK);
    frame.finish(r#"class="spark" aria-hidden="true""#)
}
