//! A channel that changes at every n-th sample only: recorded more slowly than the log's rows, and repeated or left empty
//! in between. Between its own samples it moves along a straight line, as the machine does, and not in steps.

use std::ops::Range;

/// First changes of a log by which a slow channel is recognised, at least and at most.
const CHANGES: Range<usize> = 20..500;
/// Least share of changes that come after the usual number of samples, or one more.
const REGULAR_SHARE: f64 = 0.5;
/// Least ratio of the median change to the 10 % quantile of the changes. A coarse sensor that follows a slow motion changes
/// by one step of its resolution each time: ratio 1.
const UNLIKE: f64 = 2.0;
/// Longest interval that is interpolated, in the channel's own steps.
const LONGEST_STEPS: usize = 4;

/// Draws a line between the samples of a slow channel; leaves any other as it is.
pub(crate) fn join_samples(values: &mut [f64], segments: &[Range<usize>]) {
    let Some(step) = own_step(values) else { return };
    for segment in segments {
        let mut last: Option<(usize, f64)> = None;
        for i in segment.clone() {
            let value = values[i];
            match last {
                Some((_, before)) if value.is_nan() || value.to_bits() == before.to_bits() => {}
                Some((from, before)) => {
                    if i - from <= LONGEST_STEPS * step {
                        let length = (i - from).min(step + 1);
                        values[from..=i - length].fill(before);
                        for k in 1..length {
                            values[i - length + k] = before + (value - before) * k as f64 / length as f64;
                        }
                    }
                    last = Some((i, value));
                }
                None => last = (!value.is_nan()).then_some((i, value)),
            }
        }
    }
}

/// Samples of the log from one of the channel's own to the next, where that is more than one.
fn own_step(values: &[f64]) -> Option<usize> {
    let (mut lengths, mut changes) = (Vec::new(), Vec::new());
    let mut last: Option<(usize, f64)> = None;
    for (i, value) in values.iter().enumerate().filter(|(_, value)| !value.is_nan()) {
        match last {
            Some((_, before)) if before.to_bits() == value.to_bits() => continue,
            Some((from, before)) => {
                lengths.push(i - from);
                changes.push((value - before).abs());
            }
            None => {}
        }
        if lengths.len() == CHANGES.end {
            break;
        }
        last = Some((i, *value));
    }
    if lengths.len() < CHANGES.start {
        return None;
    }
    let (tenth, middle) = (lengths.len() / 10, lengths.len() / 2);
    let step = *lengths.select_nth_unstable(tenth).1;
    let regular = lengths.iter().filter(|&&length| length == step || length == step + 1).count();
    let small = *changes.select_nth_unstable_by(tenth, f64::total_cmp).1;
    let usual = *changes.select_nth_unstable_by(middle, f64::total_cmp).1;
    let is_slow =
        step > 1 && regular as f64 >= REGULAR_SHARE * lengths.len() as f64 && usual >= UNLIKE * small;
    is_slow.then_some(step)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sine of 2 Hz at 200 Hz, of which a channel of 25 Hz keeps every eighth sample.
    fn sine(k: usize) -> f64 {
        (std::f64::consts::TAU * 2.0 * k as f64 / 200.0).sin()
    }

    /// A straight line between samples h apart is off by at most h²·max|f″|/8.
    #[test]
    fn a_slow_channel_moves_in_lines_whether_it_is_repeated_or_left_empty() {
        let most = (8.0 / 200.0_f64).powi(2) * (2.0 * std::f64::consts::TAU).powi(2) / 8.0;
        for is_repeated in [true, false] {
            let slow = |k: usize| if is_repeated || k.is_multiple_of(8) { sine(k - k % 8) } else { f64::NAN };
            let mut values: Vec<f64> = (0..2000).map(slow).collect();
            join_samples(&mut values, &[0..1000, 1000..2000]);
            let off = (0..990).chain(1000..1990).map(|k| (values[k] - sine(k)).abs()).fold(0.0, f64::max);
            assert!(off <= 1.01 * most, "{off} {most}");
        }
    }

    #[test]
    fn a_coarse_sensor_a_dropout_and_a_channel_of_the_logs_own_rate_stay_as_they_are() {
        let coarse = |k: usize| (k / 3) as f64;
        let dropped = |k: usize| if k % 7 < 2 { f64::NAN } else { sine(k) };
        for channel in [coarse, dropped, sine] {
            let values: Vec<f64> = (0..2000).map(channel).collect();
            let mut joined = values.clone();
            join_samples(&mut joined, std::slice::from_ref(&(0..2000)));
            assert!(joined.iter().zip(&values).all(|(a, b)| a.to_bits() == b.to_bits()));
        }
    }
}
