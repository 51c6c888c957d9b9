//! Gaps of a unit with its limit, without labels: in a row of a table, and on the page of its part.

use crate::charts::frame::{DATA, Frame, INK, LIMIT};

/// Draws points, µm, and a dashed limit, µm, on shared axes as an SVG picture; empty for fewer than two points.
pub(crate) fn sparkline(
    size: [f64; 2],
    x: [f64; 2],
    full: f64,
    points: &[[f64; 2]],
    limit: Option<f64>,
) -> String {
    if points.len() < 2 {
        return String::new();
    }
    let mut frame = Frame::new(size, [2.0; 4], x[0]..x[1], 0.0..full);
    if let Some(limit) = limit {
        frame.horizontal(limit, &format!(r#"{} stroke-dasharray="4 3""#, LIMIT.replace("\"2\"", "\"1\"")));
    }
    let area: Vec<[f64; 3]> = points.iter().map(|[at, gap]| [*at, 0.0, *gap]).collect();
    frame.band(&area, DATA);
    frame.line(points.iter().map(|[at, gap]| (*at, *gap)), INK);
    frame.finish(r#"class="spark" aria-hidden="true""#)
}
