//! Static pictures, for readers without scripts and for paper; the style sheet recolours them in the dark.

use jiff::Timestamp;
use plotters::prelude::*;

use crate::Error;
use crate::model::Unit;

/// The colours of the style sheet, which swaps them by these very values.
const INK: RGBColor = RGBColor(0x1C, 0x25, 0x30);
const GRID: RGBColor = RGBColor(0xE1, 0xE6, 0xEB);
const DATA: RGBColor = RGBColor(0x5B, 0x8F, 0xB9);
const WATCH: RGBColor = RGBColor(0xD9, 0xA9, 0x00);
const PLAN: RGBColor = RGBColor(0xC8, 0x52, 0x00);
const ACT: RGBColor = RGBColor(0x7A, 0x00, 0x44);

/// Marks a static picture shows at most; beyond it each mark is the mean of neighbours.
const MARKS: usize = 120;

/// The forecast as three dates at the limit.
type Fan = [Option<f64>; 3];

/// Gap against date: flights with error bars, limits, the forecast and events.
pub(crate) fn history(unit: &Unit) -> Result<String, Error> {
    let points = thinned(unit);
    let (Some(first), Some(last)) = (points.first(), points.last()) else { return Ok(String::new()) };
    let s = &unit.statement;
    let fan: Fan = [s.not_before_utc, s.likely_utc, s.not_after_utc].map(|t| t.map(day));
    let span = (last.0 - first.0).max(10.0);
    let horizon = last.0 + 3.0 * span;
    let ends = fan.iter().flatten().copied().map(|d| d.min(horizon)).fold(last.0, f64::max);
    let top = points.iter().map(|p| p.3).chain(s.limit_m.map(|l| l * 1e6)).fold(1.0, f64::max) * 1.08;
    let lowest = points.iter().map(|p| p.2).fold(f64::INFINITY, f64::min);
    let bottom = (lowest - 0.2 * (top - lowest)).max(lowest.min(0.0));
    let mut svg = String::new();
    draw(&mut svg, unit, &points, (first.0 - 0.02 * span, ends + 0.02 * span), (bottom, top), fan)?;
    Ok(svg)
}

fn draw(
    svg: &mut String,
    unit: &Unit,
    points: &[(f64, f64, f64, f64)],
    x: (f64, f64),
    y: (f64, f64),
    fan: Fan,
) -> Result<(), Error> {
    let lift = |e: DrawingAreaErrorKind<std::io::Error>| Error::Picture(e.to_string());
    let root = SVGBackend::with_string(svg, (860, 340)).into_drawing_area();
    let mut chart = ChartBuilder::on(&root)
        .margin(8)
        .x_label_area_size(28)
        .y_label_area_size(48)
        .build_cartesian_2d(x.0..x.1, y.0..y.1)
        .map_err(lift)?;
    chart
        .configure_mesh()
        .disable_x_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(GRID)
        .axis_style(INK)
        .label_style(("sans-serif", 13).into_font().color(&INK))
        .x_labels(7)
        .x_label_formatter(&|d| date_of(*d))
        .y_desc("gap µm")
        .draw()
        .map_err(lift)?;
    let s = &unit.statement;
    for (limit, colour) in [(s.watch_m, WATCH), (s.limit_m, ACT)] {
        let line = limit.map(|l| LineSeries::new([(x.0, l * 1e6), (x.1, l * 1e6)], colour.stroke_width(2)));
        line.map(|line| chart.draw_series(line)).transpose().map_err(lift)?;
    }
    for event in unit.events.iter().map(|e| day(e.departure_utc)).filter(|d| (x.0..x.1).contains(d)) {
        chart.draw_series(LineSeries::new([(event, y.0), (event, y.1)], PLAN)).map_err(lift)?;
    }
    if let (Some(gap), Some(limit), Some(last)) = (s.gap_m, s.limit_m, points.last()) {
        for end in fan.into_iter().flatten() {
            let line = [(last.0, gap * 1e6), cut((last.0, gap * 1e6), (end.max(last.0), limit * 1e6), x.1)];
            chart.draw_series(DashedLineSeries::new(line, 6, 4, PLAN.stroke_width(2))).map_err(lift)?;
        }
    }
    let bars = points.iter().map(|p| PathElement::new(vec![(p.0, p.2), (p.0, p.3)], DATA));
    chart.draw_series(bars).map_err(lift)?;
    chart.draw_series(points.iter().map(|p| Circle::new((p.0, p.1), 3, DATA.filled()))).map_err(lift)?;
    root.present().map_err(lift)
}

/// Where a line ends in the picture: a point beyond the edge would be pulled in, and the line turned.
fn cut(from: (f64, f64), to: (f64, f64), edge: f64) -> (f64, f64) {
    if to.0 <= edge {
        return to;
    }
    (edge, from.1 + (to.1 - from.1) * (edge - from.0) / (to.0 - from.0))
}

/// Day, gap, low and high of the estimated flights in µm, means of neighbours when they are many.
fn thinned(unit: &Unit) -> Vec<(f64, f64, f64, f64)> {
    let all: Vec<(f64, f64, f64, f64)> = unit
        .flights
        .iter()
        .filter_map(|f| {
            let gap = f.gap_m?;
            let (low, high) = (f.gap_p05_m.unwrap_or(gap), f.gap_p95_m.unwrap_or(gap));
            Some((day(f.departure_utc), gap * 1e6, low * 1e6, high * 1e6))
        })
        .collect();
    let size = all.len().div_ceil(MARKS).max(1);
    let mean = |c: &[(f64, f64, f64, f64)]| {
        let n = c.len() as f64;
        let sum = c.iter().fold((0.0, 0.0, 0.0, 0.0), |a, p| (a.0 + p.0, a.1 + p.1, a.2 + p.2, a.3 + p.3));
        (sum.0 / n, sum.1 / n, sum.2 / n, sum.3 / n)
    };
    all.chunks(size).map(mean).collect()
}

fn day(t: Timestamp) -> f64 {
    t.as_second() as f64 / 86_400.0
}

fn date_of(day: f64) -> String {
    Timestamp::from_second((day * 86_400.0) as i64).map(crate::words::date).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_that_leaves_the_picture_keeps_its_slope() {
        assert_eq!(cut((0.0, 10.0), (10.0, 30.0), 5.0), (5.0, 20.0));
        assert_eq!(cut((0.0, 10.0), (4.0, 30.0), 5.0), (4.0, 30.0));
    }
}
