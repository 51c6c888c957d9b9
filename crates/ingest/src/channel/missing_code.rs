//! Codes that a recorder writes where it has no value, such as −9999, and that no mapping lists.
//!
//! Such samples would count as measured: every seventh load at −9999 N makes a gap a fifth too small.

/// Samples that are looked at, in all and in one window.
const LOOKS: usize = 1 << 14;
const WINDOW: usize = 256;

/// Fewest samples with a code, and their least share of those that are looked at.
const FEWEST: usize = 20;
const LEAST_SHARE: f64 = 0.005;

/// How far a code lies from both neighbours, in lower quartiles of the steps between samples.
const FAR: f64 = 10.0;

/// Least share of the samples with a value that lie far from both neighbours, and of those far samples that have this value.
const MOSTLY: f64 = 0.75;

/// Where a channel holds a missing-value code, and the share of its changes that lead to it: one value that lies, nearly
/// wherever it comes, far to the same side of the value before and of the one after.
///
/// Vibration leaps as well, but neither to one value nor so far in its own steps.
pub(crate) fn missing_code(values: &[f64]) -> Option<(usize, f64)> {
    let every = (values.len() / (LOOKS / WINDOW)).max(WINDOW);
    let windows = (0..values.len()).step_by(every).map(|start| start..values.len().min(start + WINDOW));
    let windows: Vec<Vec<usize>> = windows.map(|window| changes(values, window)).collect();
    let mut steps: Vec<f64> = windows
        .iter()
        .flat_map(|window| window.array_windows().map(|[a, b]| (values[*b] - values[*a]).abs()))
        .collect();
    if steps.len() < FEWEST {
        return None;
    }
    let quartile = steps.len() / 4;
    let far = FAR * *steps.select_nth_unstable_by(quartile, f64::total_cmp).1;
    let is_far = |[a, b, c]: &&[usize; 3]| {
        let (from, to) = (values[*b] - values[*a], values[*b] - values[*c]);
        from.abs() > far && to.abs() > far && from.signum() == to.signum()
    };
    let mut leaps: Vec<usize> = windows
        .iter()
        .flat_map(|window| window.array_windows().filter(is_far).map(|[_, at, _]| *at))
        .collect();
    leaps.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let same = |a: &usize, b: &usize| values[*a].to_bits() == values[*b].to_bits();
    let of_code = leaps.chunk_by(same).max_by_key(|some| some.len())?;
    let all = windows.iter().flatten().filter(|at| same(at, &of_code[0])).count();
    let (count, looked_at) = (of_code.len() as f64, windows.iter().map(Vec::len).sum::<usize>() as f64);
    let is_code = of_code.len() >= FEWEST
        && count >= LEAST_SHARE * looked_at
        && count >= MOSTLY * all as f64
        && count >= MOSTLY * leaps.len() as f64;
    is_code.then(|| (of_code[0], count / looked_at))
}

/// The samples of a window at which the value changes: a code may last for several.
fn changes(values: &[f64], window: std::ops::Range<usize>) -> Vec<usize> {
    let mut kept: Vec<usize> = Vec::with_capacity(window.len());
    for at in window.filter(|at| values[*at].is_finite()) {
        if kept.last().is_none_or(|last| values[*last].to_bits() != values[at].to_bits()) {
            kept.push(at);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::channel::noise_floor::tests::noise_of;

    /// A load of 3 kN at 1 Hz with noise and vibration, logged at 200 Hz in steps of `resolution`.
    fn load(vibration_n: f64, resolution: f64, seed: u64) -> Vec<f64> {
        let noise = noise_of(seed, 40_000, vibration_n.hypot(5.0));
        let value = |(k, noise_n): (usize, f64)| {
            let clean_n = 3000.0 * (k as f64 * 0.0337).sin() + noise_n;
            (clean_n / resolution).round() * resolution
        };
        noise.into_iter().enumerate().map(value).collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]

        /// Codes from every fifth to every fiftieth row, alone and in pairs. Vibration and coarse steps are no codes, and hide
        /// one within the range of the load.
        #[test]
        fn a_code_is_found_and_nothing_else(
            (lasts, every) in (1_usize..3).prop_flat_map(|lasts| (Just(lasts), 2 * lasts + 3..50)),
            vibration_n in 0.0_f64..600.0, resolution in prop_oneof![Just(1e-9), 0.1_f64..200.0], seed in 0_u64..1000,
            code in prop_oneof![Just(-9999.0_f64), Just(0.0), Just(1e5), Just(-999.25)],
        ) {
            prop_assert_eq!(missing_code(&load(vibration_n, resolution, seed)), None);
            let is_within = code.abs() < 3000.0;
            let mut coded = load(if is_within { 0.0 } else { vibration_n / 6.0 }, if is_within { 1.0 } else { resolution }, seed);
            for at in (every..coded.len() - 2).step_by(every) {
                coded[at..at + lasts].fill(code);
            }
            let found = missing_code(&coded);
            prop_assert!(found.is_some_and(|(at, _)| coded[at].to_bits() == code.to_bits()), "{:?}", found);
        }
    }

    /// A load that alternates between two values, as under vibration at half of the rate, has no code.
    #[test]
    fn vibration_at_half_of_the_rate_is_no_code() {
        let values: Vec<f64> =
            (0..40_000).map(|k| f64::from(k % 2 * 2 - 1) * 500.0 + f64::from(k / 4000)).collect();
        assert_eq!(missing_code(&values), None);
    }
}
