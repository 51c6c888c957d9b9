//! Samples of one clock at the instants of another: nothing is invented across a hole, nothing is
//! smoothed by more than a straight line between two neighbours.

use crate::time::clock::BREAK_STEPS;

/// What a channel does between its samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Interpolation {
    /// It moves: a straight line to the next sample, if that is at most a step and a half away.
    Line,
    /// Zero-order hold: a sample is returned at the first instant at or after its own, and the caller
    /// holds it until the next one.
    First,
}

/// A channel's samples, whose instants `at_s` rise and have the usual step `step_s`, at other instants, which rise too; NaN
/// where a sample is missing or cannot be known.
///
/// An instant that is one of the channel's own takes that sample as it is. Shorter times than a
/// millionth of a step are rounding of the stamps and count as none.
pub(crate) fn interpolate_at(
    at_s: &[f64],
    values: &[f64],
    step_s: f64,
    instants_s: &[f64],
    between: Interpolation,
) -> Vec<f64> {
    // Seconds since 1970 are rounded to 2.4e-7 s.
    let same_s = (1e-6 * step_s).max(1e-6_f64.min(1e-2 * step_s));
    let known: Vec<u32> = (0..values.len() as u32).filter(|&i| !values[i as usize].is_nan()).collect();
    let (mut next, mut given) = (0, 0);
    let mut interpolated = |instant: f64| {
        while next < known.len() && at_s[known[next] as usize] <= instant + same_s {
            next += 1;
        }
        let before = known[next.checked_sub(1)?] as usize;
        let since = instant - at_s[before];
        match between {
            Interpolation::First => {
                let is_new = next > given && since < step_s;
                given = next;
                is_new.then(|| values[before])
            }
            Interpolation::Line if since <= same_s => Some(values[before]),
            Interpolation::Line => {
                let after = *known.get(next)? as usize;
                let apart = at_s[after] - at_s[before];
                let share = since / apart;
                (apart <= BREAK_STEPS * step_s)
                    .then(|| values[before] + share * (values[after] - values[before]))
            }
        }
    };
    instants_s.iter().map(|&instant| interpolated(instant).unwrap_or(f64::NAN)).collect()
}

/// The rows of a channel that is recorded every `every`-th row and repeated, or left empty, in between.
///
/// Where it is left empty those rows are the ones that hold a value. Where it is repeated they are the
/// ones at which it changes: the phase at which most changes fall.
pub(crate) fn decimated_rows(values: &[f64], every: usize) -> Vec<u32> {
    let all = 0..values.len() as u32;
    if every <= 1 {
        return all.collect();
    }
    let empty = values.iter().filter(|v| v.is_nan()).count();
    if empty * 2 >= values.len() {
        return all.filter(|&i| !values[i as usize].is_nan()).collect();
    }
    let mut changes = vec![0_usize; every];
    for (i, pair) in values.windows(2).enumerate() {
        changes[(i + 1) % every] += usize::from(pair[0].to_bits() != pair[1].to_bits());
    }
    let phase = (0..every).max_by_key(|&phase| (changes[phase], every - phase)).unwrap_or(0);
    (phase as u32..values.len() as u32).step_by(every).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_joins_neighbours_and_never_spans_a_hole() {
        let nan = f64::NAN;
        let (at_s, values) = ([0.0, 1.0, 2.0, 3.0, 4.0], [0.0, 10.0, nan, 30.0, 40.0]);
        let instants_s = [-0.5, 0.0, 0.25, 1.0, 1.5, 3.0, 3.5, 4.0, 4.5];
        let found = interpolate_at(&at_s, &values, 1.0, &instants_s, Interpolation::Line);
        let wanted = [nan, 0.0, 2.5, 10.0, nan, 30.0, 35.0, 40.0, nan];
        let is_equal = |(f, w): (&f64, &f64)| (f.is_nan() && w.is_nan()) || (f - w).abs() < 1e-12;
        assert!(found.len() == wanted.len() && found.iter().zip(&wanted).all(is_equal), "{found:?}");
    }
}
