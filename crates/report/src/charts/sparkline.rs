//! Sparkline of a unit's gaps in a table row, with its limit.

use std::fmt::Write as _;

use crate::model::UnitView;

const WIDTH: f64 = 88.0;
const HEIGHT: f64 = 22.0;
/// Height of the limit, as a share of the picture.
const LIMIT_AT: f64 = 0.9;

/// Gaps from zero to the limit, oldest first, as an SVG picture; empty for fewer than two gaps. Without a limit, from zero
/// to the largest gap.
pub(crate) fn sparkline(unit: &UnitView) -> String {
    let gaps_m = &unit.sketch_m;
    if gaps_m.len() < 2 {
        return String::new();
    }
    let limit_m = unit.assessment.limit_m;
    let most_m = gaps_m.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let full_m = limit_m.unwrap_or(most_m);
    let y = |gap_m: f64| HEIGHT * (1.0 - LIMIT_AT * (gap_m / full_m).clamp(0.0, 1.0 / LIMIT_AT));
    let mut points = String::new();
    for (k, gap_m) in gaps_m.iter().enumerate() {
        let x = WIDTH * k as f64 / (gaps_m.len() - 1) as f64;
        let _ = write!(points, "{x:.1},{:.1} ", y(*gap_m));
    }
    let limit = limit_m.map_or_else(String::new, |limit_m| {
        let y = y(limit_m);
        format!("<line x1=\"0\" y1=\"{y:.1}\" x2=\"{WIDTH}\" y2=\"{y:.1}\" stroke=\"#7A0044\" stroke-dasharray=\"3 2\"/>")
    });
    format!(
        "<svg class=\"spark\" width=\"{WIDTH}\" height=\"{HEIGHT}\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" aria-hidden=\"true\">\
         {limit}<polyline fill=\"none\" stroke=\"#1C2530\" stroke-width=\"1.5\" points=\"{}\"/></svg>",
        points.trim_end()
    )
}
