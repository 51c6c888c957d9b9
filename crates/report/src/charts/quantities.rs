//! Small chart of a followed quantity that changed.

use jiff::Timestamp;
use records::Quantity;

use crate::charts::frame::{DATA, Frame, INK, PLAN, day, thinned};

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
