//! Comparison with peers finds units and tails whose quantities differ from those of their part from the first day.
//!
//! Changes in time do not show a fault that exists from the start: a wrong load zero, a delayed position, settings of another
//! part. A unit is compared with the units of its part on other tails, by median and robust spread. Quantities of sensors and
//! recorders are compared with all units on other tails if the part has too few.

use std::collections::{BTreeMap, BTreeSet};

use job::config::QuantityLimits;
use records::{Quantity, QuantityRow};

use crate::assess::quantities::limits::Treatment;
use crate::assess::quantities::rows::short;

/// Quantities that are compared. Gaps are not: they differ by wear.
const COMPARED: [Quantity; 6] = [
    Quantity::StiffnessNPerM,
    Quantity::FrictionN,
    Quantity::SkewS,
    Quantity::LoadZeroN,
    Quantity::LoadDelayS,
    Quantity::Nis,
];
const MIN_PEERS: usize = 6;
/// Number of peers above which an even selection of them is used: it gives the median to a tenth of the spread, and ten times
/// as many units take ten times as long, not a hundred times.
const ENOUGH_PEERS: usize = 256;
/// Spreads from the peers' median beyond which a unit differs, for many peers; few peers need more spreads. With 6 to 30
/// peers, at most 1.2 in 1,000 of 60,000 draws each of normal and of t-distributed values (5 degrees of freedom) differ.
const SPREADS: f64 = 6.0;
/// Lower bound of the spread, as a share of the standard deviation: the median deviation of few values may be far too small.
const LEAST_SPREAD: f64 = 0.7;
/// Fewest units of a tail, and their share, that must differ for a difference to be the tail's.
const TAIL: (usize, f64) = (3, 0.75);

struct Deviation<'a> {
    row: &'a QuantityRow,
    quantity: Quantity,
    peers: usize,
    median: f64,
    spread: f64,
    /// Deviation over the allowed deviation, with its sign; beyond ±1 the unit differs.
    share: f64,
}

/// Differences of the selected units from their peers, in words: tails first, then units.
pub(crate) fn notes(rows: &[QuantityRow], is_selected: impl Fn(&QuantityRow) -> bool) -> Vec<String> {
    let (mut tails, mut units, mut named) = (Vec::new(), Vec::new(), BTreeSet::new());
    // Unselected units on the tail of a selected unit count too: they decide whether a difference is the tail's.
    let selected = rows.iter().filter(|row| is_selected(row));
    let with_selected: BTreeSet<&str> = selected.filter_map(|row| row.tail_number.as_deref()).collect();
    let is_near = |row: &QuantityRow| {
        is_selected(row) || row.tail_number.as_deref().is_some_and(|tail| with_selected.contains(tail))
    };
    for quantity in COMPARED {
        let found = deviations(rows, quantity, is_near);
        let of_tails = of_tails(&found);
        let is_tails = |deviation: &&Deviation<'_>| {
            deviation.row.tail_number.as_deref().is_some_and(|tail| of_tails.contains_key(tail))
        };
        let is_unit = |d: &&Deviation<'_>| d.share.abs() > 1.0 && !is_tails(d) && is_selected(d.row);
        units.extend(found.iter().filter(is_unit).map(unit_note));
        for (tail, members) in &of_tails {
            // Every sensor fault raises the NIS: a tail already named for another quantity needs no note about it.
            let is_new = quantity != Quantity::Nis || !named.contains(tail);
            if is_new && members.iter().any(|d| is_selected(d.row)) {
                named.insert(*tail);
                tails.push(tail_note(tail, members));
            }
        }
    }
    tails.into_iter().chain(units).collect()
}

fn deviations(
    rows: &[QuantityRow],
    quantity: Quantity,
    is_asked: impl Fn(&QuantityRow) -> bool,
) -> Vec<Deviation<'_>> {
    let mut parts = BTreeMap::<Option<&str>, Vec<(&QuantityRow, f64)>>::new();
    for row in rows.iter().filter(|row| row.quantity == quantity.as_str()) {
        let Some(level) = row.level.filter(|level| level.is_finite()) else { continue };
        parts.entry(row.part_number.as_deref()).or_default().push((row, level));
    }
    let is_of_sensor = Treatment::of(quantity, &QuantityLimits::default()).is_of_sensor();
    let all: Vec<(&QuantityRow, f64)> = parts.values().flatten().copied().filter(|_| is_of_sensor).collect();
    let each = parts.values().flat_map(|units| units.iter().map(move |unit| (unit, units)));
    each.filter(|(unit, _)| is_asked(unit.0))
        .filter_map(|(unit, units)| {
            deviation(unit, units, quantity).or_else(|| deviation(unit, &all, quantity))
        })
        .collect()
}

/// Deviation of a unit from `others` on other tails; `None` if these are fewer than [`MIN_PEERS`].
fn deviation<'a>(
    &(row, level): &(&'a QuantityRow, f64),
    others: &[(&QuantityRow, f64)],
    quantity: Quantity,
) -> Option<Deviation<'a>> {
    let some = others.iter().step_by(others.len().div_ceil(ENOUGH_PEERS).max(1));
    let peers: Vec<_> = some.filter(|(peer, _)| peer.tail_number != row.tail_number).collect();
    let (median, spread) = centre_and_spread(&peers.iter().map(|(_, level)| *level).collect::<Vec<_>>())?;
    // A limit may be a share of the level: the peers' limit counts, since the unit's own level may be wrong.
    let limits = peers.iter().filter_map(|(peer, _)| peer.change_limit).collect();
    let factor = SPREADS * (1.0 + MIN_PEERS as f64 / peers.len() as f64);
    let allowed = factor * spread.hypot(row.level_se.unwrap_or(0.0));
    let share = (level - median) / allowed.max(trend::quantity::median(limits).unwrap_or(0.0));
    Some(Deviation { row, quantity, peers: peers.len(), median, spread, share })
}

/// Median and robust spread; `None` for fewer than [`MIN_PEERS`] values.
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

/// Tails with most units beyond half of the allowed deviation in one direction, and one unit beyond all of it.
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
    let quantity = members[0].quantity;
    let (unit, factor) = quantity.display_unit();
    let apart = |of: &dyn Fn(&Deviation<'_>) -> f64| {
        trend::quantity::median(members.iter().map(|d| of(d) * factor).collect()).unwrap_or_default()
    };
    format!(
        "{tail}: {} of its units reads {} {unit} where other tails read {}: {}",
        quantity.label(),
        short(apart(&|d| d.row.level.unwrap_or_default())),
        short(apart(&|d| d.median)),
        consequence(quantity),
    )
}

/// Effect of a tail's wrong sensor on its gaps, and who should act.
fn consequence(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::LoadZeroN => {
            "gaps of the contact regression are corrected for it; avionics: check the zero of the load cells"
        }
        Quantity::SkewS | Quantity::LoadDelayS => {
            "gaps of the contact regression are corrected for it; avionics: check the delays of sensors and recorder"
        }
        Quantity::Nis => {
            "the model does not explain its measurements; avionics: check load cells and position sensors"
        }
        _ => {
            "its sensors or recorder are the likelier cause, and its gaps are as uncertain; avionics: check the scale of \
             load and positions"
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Stiffnesses of twelve tails with four units each, with a scatter of 2 % between units.
    fn fleet(seed: u64, plant: impl Fn(usize, usize) -> f64) -> Vec<QuantityRow> {
        let mut random = fastrand::Rng::with_seed(seed);
        let mut normal = || (0..12).map(|_| random.f64()).sum::<f64>() - 6.0;
        let mut rows = Vec::new();
        for tail in 0..12 {
            for position in 0..4 {
                let level = 50e6 * (1.0 + 0.02 * normal()) * plant(tail, position);
                rows.push(QuantityRow {
                    part_number: Some("P".into()),
                    serial_number: format!("{tail}-{position}"),
                    tail_number: Some(format!("T{tail}")),
                    position: Some(format!("p{position}")),
                    quantity: Quantity::StiffnessNPerM.as_str(),
                    level: Some(level),
                    level_se: Some(1e5),
                    change_limit: Some(0.05 * 50e6),
                    ..QuantityRow::default()
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
            assert!(tail[0].starts_with("T5: stiffness of its units reads 6"), "{tail:?}");
        }
    }

    /// Three tails with four units of four parts each: no part has enough peers, and the load cells are alike.
    #[test]
    fn a_sensor_is_compared_across_parts_where_a_part_has_few_units() {
        let of = |quantity: Quantity| {
            let mut rows = fleet(3, |tail, _| if tail == 2 { 2.0 } else { 1.0 });
            rows.truncate(12);
            for row in &mut rows {
                (row.quantity, row.part_number) = (quantity.as_str(), row.position.clone());
                // A limit that is a share of the unit's own wrong level must not hide the deviation.
                row.change_limit = row.level;
            }
            notes(&rows, |_| true)
        };
        assert!(of(Quantity::StiffnessNPerM).is_empty());
        let found = of(Quantity::LoadZeroN);
        assert!(found.len() == 1 && found[0].starts_with("T2: load zero of its units reads "), "{found:?}");
    }

    #[test]
    fn of_a_thousand_sound_units_at_most_one_is_named() {
        let named: usize = (0..250).map(|seed| notes(&fleet(seed + 1_000, |_, _| 1.0), |_| true).len()).sum();
        assert!(named <= 12, "{named} of 12,000");
        // With too few peers for a spread, no comparison is made.
        let few: Vec<QuantityRow> =
            fleet(1, |tail, _| if tail == 0 { 2.0 } else { 1.0 }).into_iter().take(8).collect();
        assert!(notes(&few, |_| true).is_empty());
    }
}
