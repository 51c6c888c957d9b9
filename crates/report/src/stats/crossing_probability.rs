//! Probability of reaching the limit by a time, from the three quantiles of the time to limit.

use crate::model::Assessment;

/// Linear interpolation through 0 now and the 5 %, 50 % and 95 % points of the time to limit.
///
/// If a later quantile is beyond the horizon, the probability stays at the last known one and is a lower bound.
/// `None` without the 5 % point.
pub(crate) fn probability_within(assessment: &Assessment, hours: f64) -> Option<f64> {
    let known = [
        (assessment.crossing_hours_p05, 0.05),
        (assessment.crossing_hours_p50, 0.50),
        (assessment.crossing_hours_p95, 0.95),
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

/// Probability as text.
pub(crate) fn probability_text(assessment: &Assessment, hours: f64) -> String {
    if assessment.limit_m.is_none() || assessment.gap_m.is_none() {
        return crate::format::NO_DATA.to_owned();
    }
    if let Some(chance) = assessment.check_probability {
        return crate::format::percent(chance);
    }
    match probability_within(assessment, hours) {
        None => "below 5 %".to_owned(),
        Some(chance) if chance >= 0.95 => "95 % or more".to_owned(),
        Some(chance) => format!("about {}", crate::format::percent(chance)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assessment(hours: [Option<f64>; 3]) -> Assessment {
        let [p05, p50, p95] = hours;
        Assessment {
            crossing_hours_p05: p05,
            crossing_hours_p50: p50,
            crossing_hours_p95: p95,
            ..Assessment::default()
        }
    }

    #[test]
    fn the_quantiles_themselves_are_reproduced() {
        let s = assessment([Some(100.0), Some(200.0), Some(400.0)]);
        assert_eq!(probability_within(&s, 0.0), Some(0.0));
        assert_eq!(probability_within(&s, 100.0), Some(0.05));
        assert_eq!(probability_within(&s, 200.0), Some(0.50));
        assert_eq!(probability_within(&s, 400.0), Some(0.95));
    }

    #[test]
    fn a_limit_that_is_already_reached_is_certain() {
        assert_eq!(probability_within(&assessment([Some(0.0); 3]), 10.0), Some(1.0));
    }

    #[test]
    fn beyond_the_horizon_there_is_only_a_lower_bound() {
        assert_eq!(probability_within(&assessment([None; 3]), 1e6), None);
        assert_eq!(probability_within(&assessment([Some(100.0), None, None]), 1e6), Some(0.05));
    }
}
