//! Static plot of a unit's history, for readers without scripts and for print; CSS recolours it in dark mode.

use jiff::Timestamp;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use records::time::DAY_S;

use crate::charts::axes::{Axes, Chart, DATA, DrawError, INK, PLAN, day, picture, thinned};
use crate::model::{FlightRow, TimedInterval, UnitView};
use crate::page::Error;

const WATCH: RGBColor = RGBColor(0xD9, 0xA9, 0x00);
const ACT: RGBColor = RGBColor(0x7A, 0x00, 0x44);

/// Maximum number of points in the plot; above it, each point is the mean of neighbouring flights.
const MAX_POINTS: usize = 120;

type DrawResult = Result<(), DrawError>;
/// Day, and 5 %, median and 95 % of a gap, µm.
type BandPoint = [f64; 4];

/// Until when the forecast is drawn: the median crossing, or the latest one where it is not much later; a fifth more.
/// Nothing beyond serves a plan.
pub(crate) fn forecast_end(unit: &UnitView) -> Option<Timestamp> {
    let s = &unit.assessment;
    let whole = unit.forecast.last()?.at_utc;
    let start = unit.forecast.first()?.at_utc;
    let Some(likely) = s.likely_utc.filter(|likely| *likely > start) else { return Some(whole) };
    let ahead_s = likely.duration_since(start).as_secs_f64();
    let latest_s = s.not_after_utc.map_or(f64::INFINITY, |latest| latest.duration_since(start).as_secs_f64());
    let shown_s = 1.2 * if latest_s <= 2.0 * ahead_s { latest_s } else { ahead_s };
    Some((start + jiff::SignedDuration::from_secs(shown_s.max(30.0 * DAY_S) as i64)).min(whole))
}

/// The forecast as far as it is drawn.
pub(crate) fn drawn_forecast(unit: &UnitView) -> Vec<TimedInterval> {
    let end = forecast_end(unit);
    unit.forecast.iter().filter(|f| end.is_none_or(|end| f.at_utc <= end)).copied().collect()
}

/// Draws gap against date: flights with error bars, smoothed level, limits, forecast band and events.
pub(crate) fn history(unit: &UnitView) -> Result<String, Error> {
    let points = thinned(&estimated(unit), MAX_POINTS);
    let (Some(first), Some(last)) = (points.first(), points.last()) else { return Ok(String::new()) };
    let span = (last[0] - first[0]).max(10.0);
    let end = forecast_end(unit).map_or(last[0], day).max(last[0]);
    let ahead = unit.forecast.iter().map(|f| f.p95_m * 1e6);
    let limit = unit.assessment.limit_m.map(|l| l * 1e6);
    // A forecast far above the limit would squeeze the flights into the bottom of the plot.
    let ahead = ahead.fold(0.0, f64::max).min(limit.map_or(f64::INFINITY, |l| 1.15 * l));
    let top = points.iter().map(|p| p[3]).chain(limit).fold(ahead.max(1.0), f64::max) * 1.04;
    let lowest = points.iter().map(|p| p[1]).fold(f64::INFINITY, f64::min);
    let bottom = (lowest - 0.2 * (top - lowest)).max(lowest.min(0.0));
    let (x, y) = ((first[0] - 0.02 * span, end + 0.02 * span), (bottom, top));
    let axes = Axes {
        x: x.0..x.1,
        y: y.0..y.1,
        names: ["", "Gap [µm]"],
        margins: [8, 28, 48],
        text_px: 13,
        dates: Some([7, 11]),
    };
    picture((860, 340), |root| {
        let mut chart = axes.draw(root)?;
        draw_flights(&mut chart, &points)?;
        draw_band(&mut chart, &band_points(&unit.level), y, INK, false)?;
        draw_band(&mut chart, &band_points(&drawn_forecast(unit)), y, PLAN, true)?;
        draw_lines(&mut chart, unit, x, y)
    })
}

fn draw_flights(chart: &mut Chart<'_>, points: &[BandPoint]) -> DrawResult {
    let bars = points.iter().map(|p| PathElement::new(vec![(p[0], p[1]), (p[0], p[3])], DATA));
    chart.draw_series(bars)?;
    chart.draw_series(points.iter().map(|p| Circle::new((p[0], p[2]), 3, DATA.filled()))).map(drop)
}

/// Draws a band and its median, clipped to the plot.
fn draw_band(
    chart: &mut Chart<'_>,
    band: &[BandPoint],
    y: (f64, f64),
    colour: RGBColor,
    dashed: bool,
) -> DrawResult {
    let edge = band.iter().map(|p| (p[0], p[3])).chain(band.iter().rev().map(|p| (p[0], p[1])));
    let edge: Vec<(f64, f64)> = edge.map(|(d, gap)| (d, gap.clamp(y.0, y.1))).collect();
    chart.draw_series([Polygon::new(edge, colour.mix(0.18))])?;
    let middle = band.iter().map(|p| (p[0], p[2])).take_while(|p| p.1 <= y.1);
    if dashed {
        chart.draw_series(DashedLineSeries::new(middle, 6, 4, colour.stroke_width(2))).map(drop)
    } else {
        chart.draw_series(LineSeries::new(middle, colour.stroke_width(2))).map(drop)
    }
}

/// Draws limits as horizontal and events as vertical lines.
fn draw_lines(chart: &mut Chart<'_>, unit: &UnitView, x: (f64, f64), y: (f64, f64)) -> DrawResult {
    let s = &unit.assessment;
    for (name, limit, colour) in [("watch", s.watch_m, WATCH), ("act limit", s.limit_m, ACT)] {
        // A level outside the plot would be drawn along its edge.
        let level = limit.map(|l| l * 1e6).filter(|l| (y.0..y.1).contains(l));
        let Some(level) = level else { continue };
        chart.draw_series(LineSeries::new([(x.0, level), (x.1, level)], colour.stroke_width(2)))?;
        let text = format!("{name} {level:.0} µm");
        let style = ("sans-serif", 12).into_font().color(&INK).pos(Pos::new(HPos::Left, VPos::Bottom));
        chart.draw_series([Text::new(text, (x.0 + 0.005 * (x.1 - x.0), level), style)])?;
    }
    draw_crossing(chart, unit, x, y)?;
    for event in unit.events.iter().map(|e| day(e.departure_utc)).filter(|d| (x.0..x.1).contains(d)) {
        chart.draw_series(LineSeries::new([(event, y.0), (event, y.1)], PLAN))?;
    }
    Ok(())
}

/// Draws the day of the assessment, and the crossing: its 90 % interval as a bar on the limit, its median as a mark.
fn draw_crossing(chart: &mut Chart<'_>, unit: &UnitView, x: (f64, f64), y: (f64, f64)) -> DrawResult {
    let s = &unit.assessment;
    if let Some(today) = unit.forecast.first().map(|f| day(f.at_utc)).filter(|d| (x.0..x.1).contains(d)) {
        chart.draw_series(DashedLineSeries::new([(today, y.0), (today, y.1)], 2, 3, INK.stroke_width(1)))?;
        let style = ("sans-serif", 12).into_font().color(&INK).pos(Pos::new(HPos::Right, VPos::Bottom));
        chart.draw_series([Text::new("today ", (today, y.0), style)])?;
    }
    let Some(limit) = s.limit_m.map(|l| l * 1e6).filter(|l| (y.0..y.1).contains(l)) else { return Ok(()) };
    let Some(from) = s.not_before_utc.map(day).filter(|d| *d < x.1) else { return Ok(()) };
    let until = s.not_after_utc.map_or(x.1, day).min(x.1);
    chart.draw_series([PathElement::new(
        vec![(from.max(x.0), limit), (until, limit)],
        PLAN.stroke_width(6),
    )])?;
    if let Some(likely) = s.likely_utc.map(day).filter(|d| (x.0..x.1).contains(d)) {
        chart.draw_series([Circle::new((likely, limit), 5, PLAN.filled())])?;
    }
    Ok(())
}

fn band_points(band: &[TimedInterval]) -> Vec<BandPoint> {
    band.iter().map(|b| [day(b.at_utc), b.p05_m * 1e6, b.m * 1e6, b.p95_m * 1e6]).collect()
}

/// The flights with an estimate.
fn estimated(unit: &UnitView) -> Vec<BandPoint> {
    let point = |f: &FlightRow| {
        let gap = f.gap_m?;
        let (low, high) = (f.gap_p05_m.unwrap_or(gap), f.gap_p95_m.unwrap_or(gap));
        Some([day(f.departure_utc), low * 1e6, gap * 1e6, high * 1e6])
    };
    unit.flights.iter().filter_map(point).collect()
}
