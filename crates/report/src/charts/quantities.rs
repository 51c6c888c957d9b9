//! Small charts of followed quantities on one time axis, for readers without scripts and for print.

use jiff::Timestamp;
use plotters::prelude::*;
use records::Quantity;

use crate::charts::axes::{Axes, DATA, INK, PLAN, day, picture, thinned};
use crate::page::Error;

/// Size of a chart, px.
const SIZE: (u32, u32) = (420, 130);
/// Most points of a line; above it, each is the mean of neighbouring flights.
const MAX_POINTS: usize = 90;

/// One line of a chart: the values of one unit.
pub(crate) struct Line {
    pub(crate) flights: Vec<(Timestamp, f64)>,
    /// Fitted level, drawn as a horizontal line from the last step on.
    pub(crate) level: Option<f64>,
}

/// Draws a quantity against date: flights, levels, and events as vertical lines.
///
/// # Errors
/// When the plot cannot be drawn.
pub(crate) fn small_chart(
    quantity: Quantity,
    lines: &[Line],
    events: &[Timestamp],
    span: (Timestamp, Timestamp),
) -> Result<String, Error> {
    let (_, factor) = quantity.display_unit();
    let points = |line: &Line| -> Vec<[f64; 2]> {
        let all: Vec<[f64; 2]> = line.flights.iter().map(|(at, value)| [day(*at), value * factor]).collect();
        thinned(&all, MAX_POINTS)
    };
    let series: Vec<Vec<[f64; 2]>> = lines.iter().map(points).collect();
    let values = || series.iter().flatten().map(|p| p[1]);
    let (low, high) = (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
    if low > high {
        return Ok(String::new());
    }
    let margin = (0.1 * (high - low)).max(0.02 * high.abs()).max(1e-9);
    let (y, x) = (low - margin..high + margin, day(span.0)..day(span.1).max(day(span.0) + 1.0));
    let axes = Axes {
        x: x.clone(),
        y: y.clone(),
        names: ["", ""],
        margins: [4, 20, 52],
        text_px: 12,
        dates: Some([4, 4]),
    };
    picture(SIZE, |root| {
        let mut chart = axes.draw(root)?;
        for (points, line) in series.iter().zip(lines) {
            chart.draw_series(points.iter().map(|p| Circle::new((p[0], p[1]), 2, DATA.filled())))?;
            let from = events.iter().map(|e| day(*e)).fold(x.start, f64::max);
            if let Some(level) = line.level.map(|level| level * factor).filter(|l| y.contains(l)) {
                let ends = [(from, level), (x.end, level)];
                chart.draw_series(LineSeries::new(ends, INK.stroke_width(2)))?;
            }
        }
        for event in events.iter().map(|e| day(*e)).filter(|d| x.contains(d)) {
            chart.draw_series(LineSeries::new([(event, y.start), (event, y.end)], PLAN))?;
        }
        Ok(())
    })
}
