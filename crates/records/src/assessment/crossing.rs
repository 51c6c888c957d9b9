//! Probability of reaching the limit by a time, from the three quantiles of the time to limit.

use crate::assessment::trend_row::TrendRow;

impl TrendRow {
    /// Probability that the limit is reached within `hours` flight hours of the last flight: linear interpolation through
    /// 0 at that flight and the 5 %, 50 % and 95 % points of the time to limit.
    ///
    /// If a later quantile is beyond the horizon, the probability stays at the last known one and is a lower bound.
    /// `None` without the 5 % point.
    pub fn crossing_probability(&self, hours: f64) -> Option<f64> {
        let known = [
            (self.crossing_hours_p05, 0.05),
            (self.crossing_hours_p50, 0.50),
            (self.crossing_hours_p95, 0.95),
        ];
        let mut before = (0.0, 0.0);
        known[0].0?;
        for (at, chance) in known {
            let Some(at) = at else { return Some(before.1) };
            if hours < at {
                let share = (hours - before.0) / (at - before.0);
                return Some(before.1 + share.clamp(0.0, 1.0) * (chance - before.1));
            }
            before = (at, chance);
        }
        // The limit is reached already: the probability is 1, not that of the last quantile.
        Some(if before.0 == 0.0 { 1.0 } else { 0.95 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_quantiles_are_reproduced_and_nothing_beyond_them_is_claimed() {
        let all = [Some(100.0), Some(200.0), Some(400.0)];
        let cases = [
            (all, 0.0, Some(0.0)),
            (all, 100.0, Some(0.05)),
            (all, 200.0, Some(0.50)),
            (all, 400.0, Some(0.95)),
            // At the limit already; and beyond the horizon, where there is only a lower bound.
            ([Some(0.0); 3], 10.0, Some(1.0)),
            ([None; 3], 1e6, None),
            ([Some(100.0), None, None], 1e6, Some(0.05)),
        ];
        for ([p05, p50, p95], hours, expected) in cases {
            let row = TrendRow {
                crossing_hours_p05: p05,
                crossing_hours_p50: p50,
                crossing_hours_p95: p95,
                ..TrendRow::default()
            };
            assert_eq!(row.crossing_probability(hours), expected);
        }
    }
}
