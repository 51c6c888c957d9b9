//! The study's pictures: errors by method, errors by gap, and whether the stated errors are the real ones.

use plotters::coord::ranged1d::SegmentedCoord;
use plotters::prelude::*;

use crate::methods::METHODS;
use crate::metrics::ErrorStats;
use crate::scenarios::Kind;

const INK: RGBColor = RGBColor(0x1C, 0x25, 0x30);
const GRID: RGBColor = RGBColor(0xE1, 0xE6, 0xEB);
const COLOURS: [RGBColor; METHODS.len()] = [
    RGBColor(0xC8, 0x52, 0x00),
    RGBColor(0x1F, 0x6F, 0xB2),
    RGBColor(0x5A, 0x8F, 0x3C),
    RGBColor(0x9A, 0xA5, 0xB1),
];
/// Errors smaller than this are drawn at the edge.
const LEAST: f64 = 0.03;

/// An SVG drawing.
pub type Drawn = Result<String, DrawingAreaErrorKind<std::io::Error>>;

fn text(size: u32) -> TextStyle<'static> {
    ("sans-serif", size).into_font().color(&INK)
}

/// Median (dot) and 95 % quantile (end of the bar) of each method in each scenario with one gap.
///
/// # Errors
/// The drawing backend fails.
pub fn errors(tallies: &[ErrorStats]) -> Drawn {
    let rows: Vec<&ErrorStats> = tallies.iter().filter(|t| t.kind == Kind::Single).rev().collect();
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, (960, 60 + 34 * rows.len() as u32)).into_drawing_area();
        root.fill(&WHITE)?;
        let rows_axis: SegmentedCoord<_> = (0..rows.len()).into_segmented();
        let mut chart = ChartBuilder::on(&root)
            .margin(10)
            .margin_top(28)
            .x_label_area_size(34)
            .y_label_area_size(220)
            .build_cartesian_2d((LEAST..20_000.0).log_scale(), rows_axis)?;
        let name = |at: &SegmentValue<usize>| match at {
            SegmentValue::CenterOf(k) => rows.get(*k).map_or_else(String::new, |t| t.name.to_owned()),
            _ => String::new(),
        };
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(GRID)
            .axis_style(INK)
            .label_style(text(12))
            .y_labels(rows.len())
            .y_label_formatter(&name)
            .x_label_formatter(&|v| format!("{v}"))
            .x_desc("absolute error, % of the gap")
            .draw()?;
        let area = chart.plotting_area();
        for (k, row) in rows.iter().enumerate() {
            for (method, errors) in row.errors.iter().enumerate().filter(|(_, e)| e.count > 0) {
                let place = |v: f64| area.map_coordinate(&(v.max(LEAST), SegmentValue::CenterOf(k)));
                let ((x0, y), (x1, _)) = (place(errors.median), place(errors.p95));
                let y = y + 6 * method as i32 - 9;
                root.draw(&PathElement::new(vec![(x0, y), (x1, y)], COLOURS[method].stroke_width(2)))?;
                root.draw(&Circle::new((x0, y), 3, COLOURS[method].filled()))?;
            }
        }
        for (k, (method, colour)) in METHODS.iter().zip(COLOURS).enumerate() {
            let x = 240 + 170 * k as i32;
            root.draw(&Circle::new((x, 16), 4, colour.filled()))?;
            root.draw(&Text::new((*method).to_owned(), (x + 9, 10), text(13)))?;
        }
        root.present()?;
    }
    Ok(svg)
}

/// Contact regression's error against the true gap, for each drawn flight.
///
/// # Errors
/// The drawing backend fails.
pub fn scatter(tallies: &[ErrorStats]) -> Drawn {
    let rows: Vec<&ErrorStats> =
        tallies.iter().filter(|t| matches!(t.kind, Kind::Wide | Kind::Foreign)).collect();
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, (960, 340)).into_drawing_area();
        root.fill(&WHITE)?;
        for (area, tally) in root.split_evenly((1, rows.len().max(1))).iter().zip(rows) {
            let mut chart = ChartBuilder::on(area)
                .margin(10)
                .caption(tally.name, text(14))
                .x_label_area_size(34)
                .y_label_area_size(46)
                .build_cartesian_2d(0.0..300.0, -4.0..4.0)?;
            chart
                .configure_mesh()
                .light_line_style(TRANSPARENT)
                .bold_line_style(GRID)
                .axis_style(INK)
                .label_style(text(12))
                .x_labels(5)
                .x_desc("true gap µm")
                .y_desc("error µm, cut at ± 4")
                .draw()?;
            let dots = tally.scatter_um.iter().map(|(gap, error)| {
                Circle::new((*gap, error.clamp(-4.0, 4.0)), 2, COLOURS[0].mix(0.6).filled())
            });
            chart.draw_series(dots)?;
        }
        root.present()?;
    }
    Ok(svg)
}

/// Panels of [`classes`] side by side, their size, and the errors at which they are cut, µm.
const PANELS: usize = 4;
const PANEL_PX: (u32, u32) = (300, 220);
const PANEL_UM: f64 = 8.0;

/// Contact regression's error against the true gap: one panel for each class with drawn gaps.
///
/// # Errors
/// The drawing backend fails.
pub fn classes(tallies: &[ErrorStats]) -> Drawn {
    let rows: Vec<&ErrorStats> = tallies.iter().filter(|t| t.kind == Kind::Drawn).collect();
    let lines = rows.len().div_ceil(PANELS).max(1);
    let mut svg = String::new();
    {
        let size = (PANEL_PX.0 * PANELS as u32, PANEL_PX.1 * lines as u32);
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        root.fill(&WHITE)?;
        for (area, tally) in root.split_evenly((lines, PANELS)).iter().zip(rows) {
            let mut chart = ChartBuilder::on(area)
                .margin(8)
                .caption(tally.name, text(13))
                .x_label_area_size(28)
                .y_label_area_size(34)
                .build_cartesian_2d(0.0..310.0, -PANEL_UM..PANEL_UM)?;
            chart
                .configure_mesh()
                .light_line_style(TRANSPARENT)
                .bold_line_style(GRID)
                .axis_style(INK)
                .label_style(text(10))
                .x_labels(4)
                .y_labels(5)
                .x_desc("gap [µm]")
                .y_desc("error [µm]")
                .draw()?;
            let dots = tally.scatter_um.iter().map(|(gap, error)| {
                let colour = COLOURS[usize::from(error.abs() > PANEL_UM)];
                Circle::new((*gap, error.clamp(-PANEL_UM, PANEL_UM)), 2, colour.mix(0.6).filled())
            });
            chart.draw_series(dots)?;
        }
        root.present()?;
    }
    Ok(svg)
}

/// Share of intervals that hold against the share they promise, from error over standard error.
///
/// # Errors
/// The drawing backend fails.
pub fn calibration(tallies: &[ErrorStats]) -> Drawn {
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, (560, 460)).into_drawing_area();
        root.fill(&WHITE)?;
        let mut chart = ChartBuilder::on(&root)
            .margin(10)
            .margin_top(16)
            .x_label_area_size(36)
            .y_label_area_size(50)
            .build_cartesian_2d(0.0..3.0, 0.0..1.0)?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(GRID)
            .axis_style(INK)
            .label_style(text(12))
            .x_desc("half width of the interval, standard errors")
            .y_desc("share of flights whose truth lies within")
            .draw()?;
        let normal = (0..=300).map(|k| 0.01 * f64::from(k)).map(|z| (z, within(z)));
        chart.draw_series(DashedLineSeries::new(normal, 6, 4, INK.stroke_width(1)))?;
        let rows = tallies.iter().filter(|t| matches!(t.kind, Kind::Wide | Kind::Foreign));
        for (k, (tally, colour)) in rows.zip([COLOURS[0], COLOURS[1], COLOURS[2]]).enumerate() {
            let mut sizes: Vec<f64> = tally.deviations.iter().map(|z| z.abs()).collect();
            sizes.sort_unstable_by(f64::total_cmp);
            let n = sizes.len() as f64;
            let steps = sizes.iter().enumerate().map(|(k, z)| (z.min(3.0), (k + 1) as f64 / n));
            chart.draw_series(LineSeries::new(steps, colour.stroke_width(2)))?;
            let y = 300 + 18 * k as i32;
            root.draw(&Rectangle::new([(300, y + 4), (316, y + 8)], colour.filled()))?;
            root.draw(&Text::new(tally.name, (322, y), text(13)))?;
        }
        root.draw(&Text::new("dashed: normal errors", (300, 360), text(13)))?;
        root.present()?;
    }
    Ok(svg)
}

/// P(|Z| ≤ z) of a standard normal, by Simpson's rule over its density.
fn within(z: f64) -> f64 {
    const PANELS: usize = 60;
    let step = z / PANELS as f64;
    let density = |k: usize| {
        let weight = if k == 0 || k == PANELS {
            1.0
        } else if k.is_multiple_of(2) {
            2.0
        } else {
            4.0
        };
        let x = step * k as f64;
        weight * (-0.5 * x * x).exp()
    };
    2.0 * step / 3.0 * (0..=PANELS).map(density).sum::<f64>() / std::f64::consts::TAU.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nine_in_ten_normal_errors_lie_within_1_645() {
        assert!((within(1.644_853_626_951) - 0.9).abs() < 1e-9);
    }
}
