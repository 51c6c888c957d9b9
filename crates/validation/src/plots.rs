//! The study's pictures: errors by method, errors by gap, and whether the stated errors are the real ones.

use plotters::coord::ranged1d::SegmentedCoord;
use plotters::prelude::*;

use crate::drawing::{
    Axes, BLUE, Drawn, GREEN, GREY, GRID, INK, ORANGE, builder, chart, drawing, mesh, text,
};
use crate::methods::METHODS;
use crate::metrics::ErrorStats;
use crate::scenarios::Kind;

const COLOURS: [RGBColor; METHODS.len()] = [ORANGE, BLUE, GREEN, GREY];
/// Errors smaller than this are drawn at the edge.
const LEAST: f64 = 0.03;

/// Median (dot) and 95 % quantile (end of the bar) of each method in each scenario with one gap.
///
/// # Errors
/// The drawing backend fails.
pub fn errors(tallies: &[ErrorStats]) -> Drawn {
    let rows: Vec<&ErrorStats> = tallies.iter().filter(|t| t.kind == Kind::Single).rev().collect();
    drawing((960, 60 + 34 * rows.len() as u32), |root| {
        let rows_axis: SegmentedCoord<_> = (0..rows.len()).into_segmented();
        let mut chart = ChartBuilder::on(root)
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
        Ok(())
    })
}

/// Contact regression's error against the true gap, for each flight of the classes `wide`.
///
/// # Errors
/// The drawing backend fails.
pub fn scatter(stats: &[ErrorStats]) -> Drawn {
    let rows: Vec<&ErrorStats> =
        stats.iter().filter(|t| matches!(t.kind, Kind::Wide | Kind::Foreign)).collect();
    error_panels(&rows, rows.len().max(1), (320, 340), 4.0)
}

/// The same, one panel for each class with drawn gaps.
///
/// # Errors
/// The drawing backend fails.
pub fn classes(stats: &[ErrorStats]) -> Drawn {
    let rows: Vec<&ErrorStats> = stats.iter().filter(|t| t.kind == Kind::Drawn).collect();
    error_panels(&rows, 4, (300, 220), 8.0)
}

/// Errors against the true gap: panels of a size, px, side by side, with errors cut at a bound, µm.
fn error_panels(rows: &[&ErrorStats], columns: usize, panel_px: (u32, u32), bound_um: f64) -> Drawn {
    let lines = rows.len().div_ceil(columns).max(1);
    drawing((panel_px.0 * columns as u32, panel_px.1 * lines as u32), |root| {
        for (area, row) in root.split_evenly((lines, columns)).iter().zip(rows) {
            let axes = Axes { x: ("true gap [µm]", 0.0, 310.0), y: ("error [µm]", -bound_um, bound_um) };
            let mut chart = builder(area)
                .caption(row.name, text(13))
                .build_cartesian_2d(axes.x.1..axes.x.2, axes.y.1..axes.y.2)?;
            mesh(&mut chart, &axes)?;
            let dots = row.scatter_um.iter().map(|(gap, error)| {
                let colour = COLOURS[usize::from(error.abs() > bound_um)];
                Circle::new((*gap, error.clamp(-bound_um, bound_um)), 2, colour.mix(0.6).filled())
            });
            chart.draw_series(dots)?;
        }
        Ok(())
    })
}

/// Share of intervals that hold against the share they promise, from error over standard error.
///
/// # Errors
/// The drawing backend fails.
pub fn calibration(tallies: &[ErrorStats]) -> Drawn {
    drawing((560, 460), |root| {
        let axes = Axes {
            x: ("half width of the interval, standard errors", 0.0, 3.0),
            y: ("share of flights whose truth lies within", 0.0, 1.0),
        };
        let mut chart = chart(root, &axes)?;
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
        Ok(())
    })
}

/// P(|Z| ≤ z) of a standard normal.
fn within(z: f64) -> f64 {
    libm::erf(z * std::f64::consts::FRAC_1_SQRT_2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nine_in_ten_normal_errors_lie_within_1_645() {
        assert!((within(1.644_853_626_951) - 0.9).abs() < 1e-9);
    }
}
