//! Remedies of rejection codes, and the codes that point to a fault of the mapping.

use std::collections::BTreeMap;

use estimator::contact::Rejection;

const BEFORE_ESTIMATOR: [(&str, &str); 3] = [
    ("nothing_selected", "check column and values of each `[[channel.when]]`: no sample meets all of them"),
    ("channel_zero", "check wiring and mapping: a channel that is zero throughout is not connected"),
    ("channel_unmapped", "map the missing channel, or exclude the actuator from `{position}`"),
];

/// Codes of a wrong sign, exchange, ratio, rate, selection, load or missing channel; a worn place may leave motion
/// unexplained as well.
const MAPPING: [&str; 8] = [
    "load_sign_flipped",
    "positions_swapped",
    "position_ratio",
    "rate_too_low",
    "motion_unexplained",
    "nothing_selected",
    "channel_zero",
    "channel_unmapped",
];

/// Codes that single flights have for other causes; on most flights of a part number, a unit is wrong.
const UNIT: [(&str, &str); 6] = [
    (
        "rate_too_low",
        "check `clock.unit` (ms against s), and `clock.tick_s` if rows share timestamps: by these times the log has too \
         few samples a second; if they are right, record at 20 samples a second or more",
    ),
    (
        "load_too_small",
        "check `unit` and `scale` of the load channel (N against kN), and `unknown_force_n` of the part",
    ),
    (
        "travel_too_small",
        "check `unit` and `scale` of the load channel (N against kN), the part's stiffness, and the units of the \
         positions: the wind-up by this load exceeds the travel",
    ),
    (
        "too_short",
        "check the unit of the clock (ms against s): by its times no flight has 9 s of valid samples under load",
    ),
    (
        "motion_unexplained",
        "check that load and positions are of the same actuator, `stiffness_n_per_m` of the part, and `wraps_at` of a \
         motor angle that starts again at each turn",
    ),
    (
        STIFFNESS_UNLIKE,
        "check the `unit` of load and positions first (a load in lbf read as N makes it 4.4 times too soft), then set \
         `stiffness_n_per_m` of the part to what `freeplay check` identifies: the gap is fitted with a stiffness of its \
         own, but `gap_midrange_m`, loads and limits of other quantities assume the configured one",
    ),
];

/// A code that single actuators have for a broken sensor; on most flights of a part number, the mapping is wrong.
const OF_PART: &str = "channel_constant";

/// The fitted stiffness of most flights of a part number is not the configured one, by a factor of two or more.
pub const STIFFNESS_UNLIKE: &str = "stiffness_unlike";

/// A fitted stiffness is another than the configured one beyond this factor.
const STIFFNESS_FACTOR: f64 = 2.0;

/// The codes that most flights of an actuator or a part number have where its mapping or a unit is wrong.
pub fn fault_codes() -> impl Iterator<Item = &'static str> {
    MAPPING.into_iter().chain(UNIT.map(|(code, _)| code)).chain([OF_PART])
}

/// Whether a fitted stiffness is not that of the part; both in N/m.
pub fn is_stiffness_unlike(fitted_n_per_m: f64, configured_n_per_m: f64) -> bool {
    let ratio = fitted_n_per_m / configured_n_per_m;
    !(STIFFNESS_FACTOR.recip()..=STIFFNESS_FACTOR).contains(&ratio)
}

/// Remedy of a rejection; `None` for an unknown code.
pub fn remedy(code: &str) -> Option<&'static str> {
    let before = || BEFORE_ESTIMATOR.iter().find(|(known, _)| *known == code).map(|(_, remedy)| *remedy);
    code.parse().ok().map(Rejection::remedy).or_else(before)
}

/// Whether a rejection of most flights of an actuator points to a fault of its mapping.
pub fn is_mapping_fault(code: &str) -> bool {
    MAPPING.contains(&code)
}

/// The rejection code of more than half of some flights, and of how many of them; each flight has its code or none.
pub fn majority<'c>(codes: &[Option<&'c str>]) -> Option<(&'c str, usize)> {
    let mut counts = BTreeMap::<&str, usize>::new();
    codes.iter().flatten().for_each(|code| *counts.entry(code).or_default() += 1);
    counts.into_iter().max_by_key(|(_, count)| *count).filter(|(_, count)| 2 * count > codes.len())
}

/// Remedy of a rejection of most flights of a part number, where it points to a wrong mapping or unit.
pub fn part_remedy(code: &str) -> Option<&'static str> {
    let unit = UNIT.iter().find(|(known, _)| *known == code).map(|(_, remedy)| *remedy);
    unit.or_else(|| remedy(code).filter(|_| is_mapping_fault(code) || code == OF_PART))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against the table of codes in the documentation.
    #[test]
    fn every_documented_rejection_has_a_remedy() {
        let page = include_str!("../../../docs/errors.md");
        let section = page.split("## Rejections").nth(1).unwrap().split("\n## ").next().unwrap();
        let codes: Vec<&str> =
            section.lines().filter_map(|line| line.strip_prefix("| `")?.split('`').next()).collect();
        assert!(codes.len() >= 14, "{codes:?}");
        for code in codes {
            assert!(remedy(code).is_some(), "{code}");
        }
    }

    #[test]
    fn codes_of_the_mapping_have_a_remedy_for_a_part_and_those_of_a_flight_have_none() {
        assert!(MAPPING.iter().all(|code| part_remedy(code).is_some()));
        assert!(part_remedy("travel_too_small").unwrap().contains("kN"));
        assert_eq!((part_remedy("no_load_reversal"), part_remedy("load_reversals")), (None, None));
    }
}
