//! Small multiple of a unit: its gaps against time, on the axes that all units of a part share.

use std::fmt::Write as _;

use jiff::Timestamp;

use crate::charts::axes::thinned;
use crate::model::UnitView;

const WIDTH: f64 = 200.0;
const HEIGHT: f64 = 64.0;
/// Most points that are drawn: neighbouring flights are averaged.
const MAX_POINTS: usize = 60;

/// Axes that the units of a part share: time span and largest gap, with room above it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SharedAxes {
    from_s: f64,
    to_s: f64,
    full_m: f64,
}

impl SharedAxes {
    /// Axes that hold all gaps and limits of units; none without a gap.
    pub(crate) fn of(units: &[&UnitView]) -> Option<Self> {
        let times_s = units.iter().flat_map(|unit| gaps(unit)).map(|(at_s, _)| at_s);
        let (from_s, to_s) =
            times_s.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), t| (low.min(t), high.max(t)));
        let gaps_m = units.iter().flat_map(|unit| gaps(unit)).map(|(_, gap_m)| gap_m);
        let limits_m = units.iter().filter_map(|unit| unit.assessment.limit_m);
        let full_m = 1.08 * gaps_m.chain(limits_m).fold(f64::MIN_POSITIVE, f64::max);
        from_s.is_finite().then_some(Self { from_s, to_s: to_s.max(from_s + 1.0), full_m })
    }

    /// First and last time, and the largest gap shown, m.
    pub(crate) fn extent(self) -> (Option<Timestamp>, Option<Timestamp>, f64) {
        let at = |s: f64| Timestamp::from_second(s as i64).ok();
        (at(self.from_s), at(self.to_s), self.full_m)
    }

    /// A unit's gaps and its limit as an SVG picture.
    pub(crate) fn draw(self, unit: &UnitView) -> String {
        let y = |gap_m: f64| HEIGHT * (1.0 - (gap_m / self.full_m).clamp(0.0, 1.0));
        let x = |at_s: f64| WIDTH * (at_s - self.from_s) / (self.to_s - self.from_s);
        let gaps: Vec<[f64; 2]> = gaps(unit).map(|(at_s, gap_m)| [at_s, gap_m]).collect();
        let mut points = String::new();
        for [at_s, gap_m] in thinned(&gaps, MAX_POINTS) {
            let _ = write!(points, "{:.1},{:.1} ", x(at_s), y(gap_m));
        }
        let limit = unit.assessment.limit_m.map_or_else(String::new, |limit_m| {
            let y = y(limit_m);
            format!("<line x1=\"0\" y1=\"{y:.1}\" x2=\"{WIDTH}\" y2=\"{y:.1}\" stroke=\"#7A0044\" stroke-dasharray=\"4 3\"/>")
        });
        format!(
            "<svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" aria-hidden=\"true\">{limit}<polyline fill=\"none\" stroke=\"#1C2530\" \
             stroke-width=\"1.5\" stroke-linecap=\"round\" points=\"{}\"/></svg>",
            points.trim_end()
        )
    }
}

/// Times, s, and gaps, m, of a unit's estimates.
fn gaps(unit: &UnitView) -> impl Iterator<Item = (f64, f64)> {
    unit.flights.iter().filter_map(|flight| Some((flight.departure_utc.as_second() as f64, flight.gap_m?)))
}
