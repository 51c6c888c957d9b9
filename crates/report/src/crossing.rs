//! The chance that a limit is met by a time, from the three quantiles a statement gives.

use crate::model::Statement;

/// Straight lines through nothing now, 5 % at *not before*, 50 % at *likely* and 95 % at *not after*.
///
/// Where the later quantiles lie beyond the horizon, the chance stays at the last one that is known,
/// which makes it a lower bound; nothing is known without the first.
pub(crate) fn chance_within(statement: &Statement, hours: f64) -> Option<f64> {
    let known = [
        (statement.crossing_hours_p05, 0.05),
        (statement.crossing_hours_p50, 0.50),
        (statement.crossing_hours_p95, 0.95),
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
    // Over already: the crossing is behind us with certainty, not at its last quantile.
    Some(if before.0 == 0.0 { 1.0 } else { 0.95 })
}

/// The same in words.
pub(crate) fn chance_in_words(statement: &Statement, hours: f64) -> String {
    if statement.limit_m.is_none() || statement.gap_m.is_none() {
        return crate::words::NO_DATA.to_owned();
    }
    if let Some(chance) = statement.check_probability {
        return crate::words::percent(chance);
    }
    match chance_within(statement, hours) {
        None => "below 5 %".to_owned(),
        Some(chance) if chance >= 0.95 => "95 % or more".to_owned(),
        Some(chance) => format!("about {}", crate::words::percent(chance)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stated(hours: [Option<f64>; 3]) -> Statement {
        let [p05, p50, p95] = hours;
        Statement {
            crossing_hours_p05: p05,
            crossing_hours_p50: p50,
            crossing_hours_p95: p95,
            ..Statement::default()
        }
    }

    #[test]
    fn the_quantiles_themselves_are_met() {
        let s = stated([Some(100.0), Some(200.0), Some(400.0)]);
        assert_eq!(chance_within(&s, 0.0), Some(0.0));
        assert_eq!(chance_within(&s, 100.0), Some(0.05));
        assert_eq!(chance_within(&s, 200.0), Some(0.50));
        assert_eq!(chance_within(&s, 400.0), Some(0.95));
    }

    #[test]
    fn a_limit_that_is_met_already_is_certain() {
        assert_eq!(chance_within(&stated([Some(0.0); 3]), 10.0), Some(1.0));
    }

    #[test]
    fn beyond_the_horizon_nothing_is_made_up() {
        assert_eq!(chance_within(&stated([None; 3]), 1e6), None);
        assert_eq!(chance_within(&stated([Some(100.0), None, None]), 1e6), Some(0.05));
    }
}
