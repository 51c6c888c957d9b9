//! Small charts of followed quantities on one time axis, for readers without scripts and for print.

use jiff::Timestamp;
use plotters::prelude::*;
use records::Quantity;
use records::time::DAY_S;

use crate::charts::history::{DATA, GRID, INK, PLAN};
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
    let series: Vec<Vec<(f64, f64)>> = lines.iter().map(|line| downsampled(&line.flights, factor)).collect();
    let values = || series.iter().flatten().map(|p| p.1);
    let (low, high) = (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
    if low > high {
        return Ok(String::new());
    }
    let margin = (0.1 * (high - low)).max(0.02 * high.abs()).max(1e-9);
    let (y, x) = ((low - margin, high + margin), (day(span.0), day(span.1).max(day(span.0) + 1.0)));
    let mut svg = String::new();
    let plot_error = |e: DrawingAreaErrorKind<std::io::Error>| Error::Plot(e.to_string());
    {
        let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        let mut chart = ChartBuilder::on(&root)
            .margin(4)
            .x_label_area_size(20)
            .y_label_area_size(52)
            .build_cartesian_2d(x.0..x.1, y.0..y.1)
            .map_err(plot_error)?;
        chart
            .configure_mesh()
            .disable_x_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(GRID)
            .axis_style(INK)
            .label_style(("sans-serif", 12).into_font().color(&INK))
            .x_labels(4)
            .y_labels(4)
            .x_label_formatter(&|d| date_of(*d))
            .draw()
            .map_err(plot_error)?;
        for (points, line) in series.iter().zip(lines) {
            chart
                .draw_series(points.iter().map(|p| Circle::new(*p, 2, DATA.filled())))
                .map_err(plot_error)?;
            let from = events.iter().map(|e| day(*e)).fold(x.0, f64::max);
            if let Some(level) = line.level.map(|level| level * factor).filter(|l| (y.0..y.1).contains(l)) {
                let drawn = LineSeries::new([(from, level), (x.1, level)], INK.stroke_width(2));
                chart.draw_series(drawn).map_err(plot_error)?;
            }
        }
        for event in events.iter().map(|e| day(*e)).filter(|d| (x.0..x.1).contains(d)) {
            let drawn = LineSeries::new([(event, y.0), (event, y.1)], PLAN);
            chart.draw_series(drawn).map_err(plot_error)?;
        }
        root.present().map_err(plot_error)?;
    }
    Ok(svg)
}

fn downsampled(flights: &[(Timestamp, f64)], factor: f64) -> Vec<(f64, f64)> {
    let mean = |part: &[(Timestamp, f64)]| {
        let count = part.len() as f64;
        let sum = part.iter().fold((0.0, 0.0), |sum, (at, value)| (sum.0 + day(*at), sum.1 + value * factor));
        (sum.0 / count, sum.1 / count)
    };
    flights.chunks(flights.len().div_ceil(MAX_POINTS).max(1)).map(mean).collect()
}

fn day(t: Timestamp) -> f64 {
    t.as_second() as f64 / DAY_S
}

fn date_of(day: f64) -> String {
    Timestamp::from_second((day * DAY_S) as i64).map(crate::format::date).unwrap_or_default()
}
