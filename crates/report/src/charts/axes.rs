//! What the charts share: colours, axes, days, and means of neighbouring points.

use std::ops::Range;

use jiff::Timestamp;
use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use records::time::DAY_S;

use crate::page::Error;

/// Colours of the style sheet, which replaces exactly these values in dark mode.
pub(crate) const INK: RGBColor = RGBColor(0x1C, 0x25, 0x30);
pub(crate) const GRID: RGBColor = RGBColor(0xE1, 0xE6, 0xEB);
pub(crate) const DATA: RGBColor = RGBColor(0x5B, 0x8F, 0xB9);
pub(crate) const PLAN: RGBColor = RGBColor(0xC8, 0x52, 0x00);

pub(crate) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
pub(crate) type Chart<'a> = ChartContext<'a, SVGBackend<'a>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;
pub(crate) type DrawError = DrawingAreaErrorKind<std::io::Error>;

/// Axes of a chart.
pub(crate) struct Axes<'t> {
    pub(crate) x: Range<f64>,
    pub(crate) y: Range<f64>,
    /// Descriptions of both axes; empty for none.
    pub(crate) names: [&'t str; 2],
    /// Margin around the chart, and room for the labels below it and left of it, px.
    pub(crate) margins: [u32; 3],
    /// Height of the labels, px.
    pub(crate) text_px: u32,
    /// Of a horizontal axis in days since 1970: the numbers of labels of both axes. The days are shown as dates.
    pub(crate) dates: Option<[usize; 2]>,
}

impl Axes<'_> {
    /// Draws axes and grid.
    pub(crate) fn draw<'a>(&self, area: &Area<'a>) -> Result<Chart<'a>, DrawError> {
        let [margin, below, left] = self.margins;
        let mut chart = ChartBuilder::on(area)
            .margin(margin)
            .x_label_area_size(below)
            .y_label_area_size(left)
            .build_cartesian_2d(self.x.clone(), self.y.clone())?;
        let as_date = |day: &f64| {
            Timestamp::from_second((day * DAY_S) as i64).map(crate::format::date).unwrap_or_default()
        };
        let mut mesh = chart.configure_mesh();
        mesh.light_line_style(TRANSPARENT)
            .bold_line_style(GRID)
            .axis_style(INK)
            .label_style(("sans-serif", self.text_px).into_font().color(&INK));
        if let Some([x, y]) = self.dates {
            mesh.disable_x_mesh().x_labels(x).y_labels(y).x_label_formatter(&as_date);
        }
        let [x, y] = self.names;
        if !x.is_empty() {
            mesh.x_desc(x);
        }
        if !y.is_empty() {
            mesh.y_desc(y);
        }
        mesh.draw()?;
        Ok(chart)
    }
}

/// Draws an SVG picture of a size, px.
pub(crate) fn picture(
    size: (u32, u32),
    draw: impl FnOnce(&Area<'_>) -> Result<(), DrawError>,
) -> Result<String, Error> {
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        draw(&root)?;
        root.present()?;
    }
    Ok(svg)
}

/// Days since 1970.
pub(crate) fn day(t: Timestamp) -> f64 {
    t.as_second() as f64 / DAY_S
}

/// Means of groups of neighbouring points, at most `most` of them.
pub(crate) fn thinned<const N: usize>(points: &[[f64; N]], most: usize) -> Vec<[f64; N]> {
    let mean = |group: &[[f64; N]]| {
        std::array::from_fn(|k| group.iter().map(|point| point[k]).sum::<f64>() / group.len() as f64)
    };
    points.chunks(points.len().div_ceil(most).max(1)).map(mean).collect()
}
