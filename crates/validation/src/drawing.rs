//! What the drawings of the study and of the paper share: an SVG picture, and the style of its axes.

use plotters::chart::ChartContext;
use plotters::coord::Shift;
use plotters::coord::ranged1d::ValueFormatter;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;

pub(crate) const INK: RGBColor = RGBColor(0x1C, 0x25, 0x30);
pub(crate) const GRID: RGBColor = RGBColor(0xE1, 0xE6, 0xEB);
pub(crate) const BLUE: RGBColor = RGBColor(0x1F, 0x6F, 0xB2);
pub(crate) const ORANGE: RGBColor = RGBColor(0xC8, 0x52, 0x00);
pub(crate) const GREEN: RGBColor = RGBColor(0x5A, 0x8F, 0x3C);
pub(crate) const GREY: RGBColor = RGBColor(0x9A, 0xA5, 0xB1);

pub(crate) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
pub(crate) type Chart<'r, 's> = ChartContext<'r, SVGBackend<'s>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;
pub(crate) type Failure = DrawingAreaErrorKind<std::io::Error>;

/// An SVG drawing.
pub type Drawn = Result<String, Failure>;

/// A style of text of a size, px.
pub(crate) fn text(size: u32) -> TextStyle<'static> {
    ("sans-serif", size).into_font().color(&INK)
}

/// Draws on white, into a picture of a size, px.
pub(crate) fn drawing(size: (u32, u32), draw: impl FnOnce(&Area<'_>) -> Result<(), Failure>) -> Drawn {
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        root.fill(&WHITE)?;
        draw(&root)?;
        root.present()?;
    }
    Ok(svg)
}

/// Axes: their names and ranges.
pub(crate) struct Axes<'t> {
    pub(crate) x: (&'t str, f64, f64),
    pub(crate) y: (&'t str, f64, f64),
}

/// A chart with linear axes.
pub(crate) fn chart<'r, 's>(area: &'r Area<'s>, axes: &Axes<'_>) -> Result<Chart<'r, 's>, Failure> {
    let mut chart = builder(area).build_cartesian_2d(axes.x.1..axes.x.2, axes.y.1..axes.y.2)?;
    mesh(&mut chart, axes)?;
    Ok(chart)
}

/// Margins of a chart.
pub(crate) fn builder<'r, 's>(area: &'r Area<'s>) -> ChartBuilder<'r, 'r, SVGBackend<'s>> {
    let mut builder = ChartBuilder::on(area);
    builder.margin(8).margin_right(16).x_label_area_size(34).y_label_area_size(52);
    builder
}

/// Draws axes and grid.
pub(crate) fn mesh<'r, 's: 'r, X, Y>(
    chart: &mut ChartContext<'r, SVGBackend<'s>, Cartesian2d<X, Y>>,
    axes: &Axes<'_>,
) -> Result<(), Failure>
where
    X: Ranged<ValueType = f64> + ValueFormatter<f64>,
    Y: Ranged<ValueType = f64> + ValueFormatter<f64>,
{
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(GRID)
        .axis_style(INK)
        .label_style(text(12))
        .x_labels(7)
        .y_labels(6)
        .x_desc(axes.x.0)
        .y_desc(axes.y.0)
        .draw()
}
