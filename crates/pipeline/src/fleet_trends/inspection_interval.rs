//! Advice on inspection intervals: the chance that a unit of a part meets its limit before the next inspection.

use std::collections::BTreeMap;

use records::{InspectionInterval, TrendRow};
use trend::State;

/// Chances of each part's units for each interval, and the longest interval within a risk.
///
/// Units in `plan` and `act` are left out: they have dates of their own, and no interval serves them.
pub fn inspection_intervals(rows: &[TrendRow], risk: f64) -> Vec<InspectionInterval> {
    let mut parts: BTreeMap<Option<&str>, Vec<Unit<'_>>> = BTreeMap::new();
    for row in rows.iter().filter(|row| is_inspected(row)) {
        let unit = Unit { serial_number: &row.serial_number, chances: &row.interval_chances.0 };
        parts.entry(row.part_number.as_deref()).or_default().push(unit);
    }
    parts.into_iter().flat_map(|(part, units)| of_part(part, &units, risk)).collect()
}

fn is_inspected(row: &TrendRow) -> bool {
    let is_calm = [State::Normal, State::Watch].map(State::as_str).iter().any(|s| row.state == Some(*s));
    is_calm && !row.interval_chances.0.is_empty()
}

/// A unit, and its chances by hours.
struct Unit<'a> {
    serial_number: &'a str,
    chances: &'a [(f64, f64)],
}

fn of_part(part: Option<&str>, units: &[Unit<'_>], risk: f64) -> Vec<InspectionInterval> {
    let chance = |unit: &Unit<'_>, index: usize| unit.chances.get(index).map_or(0.0, |(_, p)| *p);
    let row = |(index, interval_hours): (usize, f64)| {
        let worst = units.iter().max_by(|a, b| chance(a, index).total_cmp(&chance(b, index)))?;
        Some(InspectionInterval {
            part_number: part.map(str::to_owned),
            interval_hours,
            units: units.len() as i64,
            mean_chance: units.iter().map(|unit| chance(unit, index)).sum::<f64>() / units.len() as f64,
            largest_chance: chance(worst, index),
            serial_number: worst.serial_number.to_owned(),
            risk,
            longest_hours: None,
        })
    };
    let rows: Vec<InspectionInterval> =
        trend::INTERVAL_HOURS.into_iter().enumerate().filter_map(row).collect();
    let longest_hours = longest(&rows, risk);
    rows.into_iter().map(|row| InspectionInterval { longest_hours, ..row }).collect()
}

/// The advice for a part, in words.
pub fn interval_advice(row: &InspectionInterval) -> String {
    let part = row.part_number.as_deref().unwrap_or("units without a part number");
    let risk = 100.0 * row.risk;
    match row.longest_hours {
        Some(hours) => {
            format!("{part}: inspect at most every {hours:.0} FH for a chance of at most {risk} % per unit")
        }
        None => format!("{part}: no listed interval keeps the chance of every unit at or below {risk} %"),
    }
}

/// The hours at which the largest chance passes the risk, between two intervals by the chance; rounded down to 5 h.
fn longest(rows: &[InspectionInterval], risk: f64) -> Option<f64> {
    let beyond = rows.iter().position(|row| row.largest_chance > risk);
    let hours = match beyond {
        None => rows.last()?.interval_hours,
        Some(0) => return None,
        Some(k) => {
            let (before, after) = (&rows[k - 1], &rows[k]);
            let share = (risk - before.largest_chance) / (after.largest_chance - before.largest_chance);
            before.interval_hours + share * (after.interval_hours - before.interval_hours)
        }
    };
    Some((hours / 5.0).floor() * 5.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Chances that grow with the hours and are one at some hours.
    fn chances(hours_to_limit: f64) -> Vec<(f64, f64)> {
        trend::INTERVAL_HOURS.map(|h| (h, (h / hours_to_limit).min(1.0))).to_vec()
    }

    #[test]
    fn the_longest_interval_is_where_the_worst_unit_passes_the_risk() {
        let (early, late) = (chances(10_000.0), chances(20_000.0));
        let units =
            [Unit { serial_number: "A", chances: &early }, Unit { serial_number: "B", chances: &late }];
        let found = of_part(Some("EMA"), &units, 0.01);
        assert_eq!(found.len(), trend::INTERVAL_HOURS.len());
        // Unit A reaches 1 % at 100 h, where unit B has 0.5 %.
        let at_100 = found.iter().find(|row| row.interval_hours > 99.0).unwrap();
        assert_eq!((at_100.serial_number.as_str(), at_100.longest_hours), ("A", Some(100.0)));
        assert!((at_100.largest_chance - 0.01).abs() < 1e-12 && (at_100.mean_chance - 0.0075).abs() < 1e-12);
    }

    #[test]
    fn no_listed_interval_may_be_short_enough_and_the_longest_listed_is_the_most_that_is_said() {
        let (soon, never) = (chances(100.0), chances(1e9));
        let longest = |chances: &[(f64, f64)]| {
            of_part(None, &[Unit { serial_number: "A", chances }], 0.01)[0].longest_hours
        };
        assert_eq!(longest(&soon), None);
        assert_eq!(longest(&never), Some(3000.0));
    }
}
