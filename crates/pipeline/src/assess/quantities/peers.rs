//! Comparison with peers: a unit or a tail whose quantities differ from those of its part from the first day.
//!
//! Changes in time show nothing of what was always so: a load cell with a wrong zero, a position with a delay, settings of
//! another part. A unit is compared with the units of its part on other tails, by median and robust spread.

use std::collections::{BTreeMap, BTreeSet};

use records::{Quantity, QuantityRow};

/// Quantities that are compared; a gap differs by wear.
const COMPARED: [Quantity; 6] = [
    Quantity::StiffnessNPerM,
    Quantity::FrictionN,
    Quantity::SkewS,
    Quantity::LoadZeroN,
    Quantity::LoadDelayS,
    Quantity::Nis,
];
/// Fewest peers.
const MIN_PEERS: usize = 6;
/// Spreads from the peers' median from which a unit differs, for many peers; fewer ask for more. Of 60,000 draws each of
/// normal and of t-distributed values (5 degrees of freedom), with 6 to 30 peers, at most 1.2 in 1,000 differ by as much.
const SPREADS: f64 = 6.0;
/// Share of the standard deviation that the spread is at least: the median deviation of few values may be far too small.
const LEAST_SPREAD: f64 = 0.7;
/// Fewest units of a tail that make a difference the tail's, and their share.
const TAIL: (usize, f64) = (3, 0.75);

/// A unit's deviation from its peers.
struct Deviation<'a> {
    row: &'a QuantityRow,
    quantity: Quantity,
    peers: usize,
    median: f64,
    spread: f64,
    /// Deviation over what is allowed; beyond 1 the unit differs.
    share: f64,
}

/// What differs of the selected units, in words: tails first, then units.
pub(crate) fn notes(rows: &[QuantityRow], is_selected: impl Fn(&QuantityRow) -> bool) -> Vec<String> {
    let (mut tails, mut units) = (Vec::new(), Vec::new());
    for quantity in COMPARED {
        let found = deviations(rows, quantity);
        let of_tails = of_tails(&found);
        let is_tails = |deviation: &&Deviation<'_>| {
            deviation.row.tail_number.as_deref().is_some_and(|tail| of_tails.contains_key(tail))
        };
        let is_named = |d: &&Deviation<'_>| d.share.abs() > 1.0 && !is_tails(d) && is_selected(d.row);
        units.extend(found.iter().filter(is_named).map(unit_note));
        let selected = of_tails.iter().filter(|(_, members)| members.iter().any(|d| is_selected(d.row)));
        tails.extend(selected.map(|(tail, members)| tail_note(tail, members)));
    }
    tails.extend(units);
    tails
}

fn deviations(rows: &[QuantityRow], quantity: Quantity) -> Vec<Deviation<'_>> {
    let mut parts = BTreeMap::<&str, Vec<(&QuantityRow, f64)>>::new();
    for row in rows.iter().filter(|row| row.quantity == quantity.as_str()) {
        let Some(level) = row.level.filter(|level| level.is_finite()) else { continue };
        parts.entry(row.part_number.as_deref().unwrap_or_default()).or_default().push((row, level));
    }
    parts.into_values().flat_map(|units| of_part(&units, quantity)).collect()
}

/// The deviations of the units of one part, each from the units on other tails.
fn of_part<'a>(units: &[(&'a QuantityRow, f64)], quantity: Quantity) -> Vec<Deviation<'a>> {
    let deviation = |&(row, level): &(&'a QuantityRow, f64)| {
        let others = units.iter().filter(|(peer, _)| peer.tail_number != row.tail_number);
        let peers: Vec<f64> = others.map(|(_, level)| *level).collect();
        let (median, spread) = centre_and_spread(&peers)?;
        let factor = SPREADS * (1.0 + MIN_PEERS as f64 / peers.len() as f64);
        let allowed = factor * spread.hypot(row.level_se.unwrap_or(0.0));
        let share = (level - median) / allowed.max(row.change_limit.unwrap_or(0.0));
        Some(Deviation { row, quantity, peers: peers.len(), median, spread, share })
    };
    units.iter().filter_map(deviation).collect()
}

/// Median and robust spread of enough values.
fn centre_and_spread(values: &[f64]) -> Option<(f64, f64)> {
    const NORMAL: f64 = 1.482_6;
    if values.len() < MIN_PEERS {
        return None;
    }
    let median = trend::quantity::median(values.to_vec())?;
    let deviation = trend::quantity::median(values.iter().map(|value| (value - median).abs()).collect())?;
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / values.len() as f64;
    Some((median, (NORMAL * deviation).max(LEAST_SPREAD * variance.sqrt())))
}

/// Tails most of whose units deviate by half of what is allowed, in one direction, and one of them by more.
fn of_tails<'d, 'a>(found: &'d [Deviation<'a>]) -> BTreeMap<&'a str, Vec<&'d Deviation<'a>>> {
    let mut tails = BTreeMap::<&str, Vec<&Deviation<'_>>>::new();
    for deviation in found {
        if let Some(tail) = deviation.row.tail_number.as_deref() {
            tails.entry(tail).or_default().push(deviation);
        }
    }
    tails.retain(|_, members| {
        let with = |sign: f64| members.iter().filter(|d| sign * d.share > 0.5).count();
        let most = with(1.0).max(with(-1.0));
        most >= TAIL.0
            && most as f64 >= TAIL.1 * members.len() as f64
            && members.iter().any(|d| d.share.abs() > 1.0)
    });
    tails
}

fn unit_note(deviation: &Deviation<'_>) -> String {
    let Deviation { row, quantity, peers, median, spread, .. } = deviation;
    let (unit, factor) = quantity.display_unit();
    let word = |text: &Option<String>| text.clone().unwrap_or_else(|| "–".to_owned());
    format!(
        "{} {} ({} / {}): {} {:.3} {unit} where {peers} peers on other tails read {:.3} ± {:.3}: check sensors, mapping \
         and settings of the position",
        word(&row.tail_number),
        word(&row.position),
        word(&row.part_number),
        row.serial_number,
        quantity.label(),
        row.level.unwrap_or_default() * factor,
        median * factor,
        spread * factor,
    )
}

fn tail_note(tail: &str, members: &[&Deviation<'_>]) -> String {
    let first = members[0];
    let (unit, factor) = first.quantity.display_unit();
    let apart: Vec<f64> =
        members.iter().map(|d| (d.row.level.unwrap_or_default() - d.median) * factor).collect();
    let apart = trend::quantity::median(apart).unwrap_or_default();
    let positions: BTreeSet<&str> = members.iter().filter_map(|d| d.row.position.as_deref()).collect();
    format!(
        "{tail}: {} differs by {apart:+.3} {unit} from other tails at {} positions ({}): its sensors or recorder are the \
         likelier cause, and its gaps are as uncertain",
        first.quantity.label(),
        members.len(),
        positions.into_iter().collect::<Vec<_>>().join(", ")
    )
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]
mod tests {
    use super::*;

    /// Stiffnesses of twelve tails with four units each, with a scatter of 2 % between units.
    fn fleet(seed: u64, plant: impl Fn(usize, usize) -> f64) -> Vec<QuantityRow> {
        let mut state = seed.wrapping_mul(2_862_933_555_777_941_757).wrapping_add(3_037_000_493);
        let mut normal = || {
            let mut sum = -6.0;
            for _ in 0..12 {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                sum += (state >> 11) as f64 / (1_u64 << 53) as f64;
            }
            sum
        };
        let mut rows = Vec::new();
        for tail in 0..12 {
            for position in 0..4 {
                let level = 50e6 * (1.0 + 0.02 * normal()) * plant(tail, position);
                rows.push(QuantityRow {
                    part_number: Some("P".into()),
                    serial_number: format!("{tail}-{position}"),
                    tail_number: Some(format!("T{tail}")),
                    position: Some(format!("p{position}")),
                    as_of_utc: jiff::Timestamp::UNIX_EPOCH,
                    quantity: Quantity::StiffnessNPerM.as_str(),
                    flights: 40,
                    outliers: 0,
                    since_utc: None,
                    baseline: None,
                    level: Some(level),
                    level_se: Some(1e5),
                    change: None,
                    change_se: None,
                    rate_per_hour: None,
                    rate_se_per_hour: None,
                    change_limit: Some(0.05 * 50e6),
                    steps: Vec::new(),
                    state: None,
                    reason: None,
                });
            }
        }
        rows
    }

    #[test]
    fn a_unit_and_a_tail_that_always_differed_are_named_and_no_other() {
        for seed in 0..50 {
            let rows = fleet(seed, |tail, position| if (tail, position) == (3, 1) { 0.7 } else { 1.0 });
            let unit = notes(&rows, |_| true);
            assert_eq!(unit.len(), 1, "{unit:?}");
            let of_others = notes(&rows, |row| row.tail_number.as_deref() != Some("T3"));
            assert!(of_others.is_empty(), "{of_others:?}");
            assert!(unit[0].starts_with("T3 p1 (P / 3-1): stiffness 3"), "{unit:?}");
            let tail = notes(&fleet(seed, |tail, _| if tail == 5 { 1.3 } else { 1.0 }), |_| true);
            assert_eq!(tail.len(), 1, "{tail:?}");
            assert!(tail[0].starts_with("T5: stiffness differs by +1"), "{tail:?}");
        }
    }

    #[test]
    fn of_a_thousand_sound_units_at_most_one_is_named() {
        let named: usize = (0..250).map(|seed| notes(&fleet(seed + 1_000, |_, _| 1.0), |_| true).len()).sum();
        assert!(named <= 12, "{named} of 12,000");
        // Fewer peers than a spread needs are compared with nothing.
        let few: Vec<QuantityRow> =
            fleet(1, |tail, _| if tail == 0 { 2.0 } else { 1.0 }).into_iter().take(8).collect();
        assert!(notes(&few, |_| true).is_empty());
    }
}
