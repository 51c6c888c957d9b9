//! The study's pictures: errors by method, errors by gap, and whether the stated errors are the real ones.

use std::f64::consts::FRAC_1_SQRT_2;

use crate::drawing::{Axis, BLUE, GREEN, GREY, INK, ORANGE, Panel, Series, Shape, picture};
use crate::methods::METHODS;
use crate::metrics::ErrorStats;
use crate::scenarios::Kind;

const COLOURS: [&str; METHODS.len()] = [ORANGE, BLUE, GREEN, GREY];
/// Errors smaller than this are drawn at the edge.
const LEAST: f64 = 0.03;

/// Median (dot) and 95 % quantile (end of the bar) of each method in each scenario with one gap.
pub(crate) fn errors(stats: &[ErrorStats]) -> String {
    let rows: Vec<&ErrorStats> = stats.iter().filter(|t| t.kind == Kind::Single).rev().collect();
    let mut series = Vec::new();
    for (method, (name, colour)) in METHODS.iter().zip(COLOURS).enumerate() {
        let of_row = |(k, row): (usize, &&ErrorStats)| {
            let (errors, y) = (row.errors[method], k as f64 + 0.27 - 0.18 * method as f64);
            (errors.count > 0).then(|| [errors.median, errors.p95].map(|error| (error.max(LEAST), y)))
        };
        let bars: Vec<[(f64, f64); 2]> = rows.iter().enumerate().filter_map(of_row).collect();
        let medians = bars.iter().map(|[median, _]| *median).collect();
        series.push(Series::new(colour, Shape::Bars(2.0), bars.concat()).named(name));
        series.push(Series::new(colour, Shape::Dots(3.0), medians));
    }
    let labels = rows.iter().enumerate().map(|(k, row)| (k as f64, row.name.to_owned())).collect();
    let y = Axis { labels, ..Axis::new("", -0.5..rows.len() as f64 - 0.5) };
    let panel = Panel::new(Axis::log("absolute error, % of the gap", LEAST..20e3), y, series);
    picture(&[panel], 1, [960.0, 60.0 + 34.0 * rows.len() as f64])
}

/// Contact regression's error against the true gap, for each flight of the classes `wide`.
pub(crate) fn scatter(stats: &[ErrorStats]) -> String {
    let panels: Vec<Panel> = wide(stats).map(|row| error_panel(row, 4.0)).collect();
    picture(&panels, panels.len().max(1), [320.0, 340.0])
}

/// The same, one panel for each class with drawn gaps.
pub(crate) fn classes(stats: &[ErrorStats]) -> String {
    let rows = stats.iter().filter(|t| t.kind == Kind::Drawn);
    picture(&rows.map(|row| error_panel(row, 8.0)).collect::<Vec<_>>(), 4, [300.0, 220.0])
}

/// The classes `wide`, whose intervals are counted.
fn wide(stats: &[ErrorStats]) -> impl Iterator<Item = &ErrorStats> {
    stats.iter().filter(|t| matches!(t.kind, Kind::Wide | Kind::Foreign))
}

/// Errors against the true gap; errors beyond a bound, µm, are drawn at the edge in another colour.
fn error_panel(row: &ErrorStats, bound_um: f64) -> Panel {
    let (inside, beyond): (Vec<_>, Vec<_>) =
        row.scatter_um.iter().partition(|(_, error)| error.abs() <= bound_um);
    let beyond = beyond.into_iter().map(|(gap, error)| (gap, error.clamp(-bound_um, bound_um))).collect();
    let series = [(COLOURS[0], inside), (COLOURS[1], beyond)];
    let series = series.map(|(colour, points)| Series::new(colour, Shape::Dots(2.0), points));
    let (x, y) = (Axis::new("true gap [µm]", 0.0..310.0), Axis::new("error [µm]", -bound_um..bound_um));
    Panel { title: row.name.to_owned(), ..Panel::new(x, y, series.into()) }
}

/// Share of intervals that hold against the share they promise, from error over standard error.
pub(crate) fn calibration(stats: &[ErrorStats]) -> String {
    // P(|Z| ≤ z) of a standard normal.
    let normal = (0..=300).map(|k| 0.01 * f64::from(k)).map(|z| (z, libm::erf(z * FRAC_1_SQRT_2))).collect();
    let mut series = vec![Series::new(INK, Shape::Dashed, normal).named("dashed: normal errors")];
    for (row, colour) in wide(stats).zip(COLOURS) {
        let mut sizes: Vec<f64> = row.deviations.iter().map(|z| z.abs()).collect();
        sizes.sort_unstable_by(f64::total_cmp);
        let n = sizes.len() as f64;
        let steps = sizes.iter().enumerate().map(|(k, z)| (z.min(3.0), (k + 1) as f64 / n));
        series.push(Series::new(colour, Shape::Line(2.0), steps.collect()).named(row.name));
    }
    let x = Axis::new("half width of the interval, standard errors", 0.0..3.0);
    let y = Axis::new("share of flights whose truth lies within", 0.0..1.0);
    picture(&[Panel::new(x, y, series)], 1, [560.0, 460.0])
}
