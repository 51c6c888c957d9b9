//! Plot of estimate against inspection: pairs, line of equality, bias and limits of agreement.

use plotters::prelude::*;

use crate::charts::axes::{Area, Axes, DATA, DrawError, INK, PLAN, picture};
use crate::page::Error;
use crate::stats::agreement::Agreement;

/// Draws pairs of estimate and inspection, m; an empty string without a pair.
pub(crate) fn agreement_plot(pairs: &[(f64, f64)]) -> Result<String, Error> {
    let um: Vec<(f64, f64)> = pairs.iter().map(|(estimate, play)| (play * 1e6, estimate * 1e6)).collect();
    if um.is_empty() {
        return Ok(String::new());
    }
    let all = || um.iter().flat_map(|(play, estimate)| [*play, *estimate]);
    let (low, high) = (all().fold(0.0, f64::min), all().fold(1.0, f64::max) * 1.08);
    picture((560, 420), |root| draw(root, &um, Agreement::of(pairs), (low, high)))
}

fn draw(
    root: &Area<'_>,
    points: &[(f64, f64)],
    agreement: Option<Agreement>,
    (low, high): (f64, f64),
) -> Result<(), DrawError> {
    let axes = Axes {
        x: low..high,
        y: low..high,
        names: ["Inspection [µm]", "Estimate [µm]"],
        margins: [8, 44, 52],
        text_px: 13,
        dates: None,
    };
    let mut chart = axes.draw(root)?;
    let shifted = |by_um: f64| [(low.max(low - by_um), low.max(low - by_um) + by_um), upper(high, by_um)];
    chart.draw_series(LineSeries::new(shifted(0.0), INK.stroke_width(1)))?;
    if let Some(a) = agreement {
        chart.draw_series(LineSeries::new(shifted(a.bias_m * 1e6), PLAN.stroke_width(2)))?;
        for limit_m in [a.lower_m, a.upper_m] {
            let line = DashedLineSeries::new(shifted(limit_m * 1e6), 6, 4, PLAN.stroke_width(1));
            chart.draw_series(line)?;
        }
    }
    chart.draw_series(points.iter().map(|p| Circle::new(*p, 3, DATA.filled()))).map(drop)
}

/// Upper end of a line of slope 1 that is `by_um` above the diagonal.
fn upper(high: f64, by_um: f64) -> (f64, f64) {
    if by_um > 0.0 { (high - by_um, high) } else { (high, high + by_um) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_pair_is_a_mark_and_no_pair_is_no_plot() {
        let pairs = [(30e-6, 33e-6), (40e-6, 42e-6), (50e-6, 51e-6)];
        assert_eq!(agreement_plot(&pairs).unwrap().matches("<circle").count(), 3);
        assert_eq!(agreement_plot(&[]).unwrap(), "");
    }

    #[test]
    fn a_line_leaves_the_plot_at_its_corner() {
        assert_eq!(upper(100.0, 10.0), (90.0, 100.0));
        assert_eq!(upper(100.0, -10.0), (100.0, 90.0));
    }
}
