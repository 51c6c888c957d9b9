//! Channels that were recorded more slowly than the log's rows, and joined by straight lines.

use std::ops::Range;

/// First bends of a channel that are looked at, at least and at most.
const BENDS: Range<usize> = 20..500;
/// Least share of bends that come after the usual number of samples, or one more.
const REGULAR_SHARE: f64 = 0.5;
/// Least ratio of the median bend to the 10 % quantile of the bends: those of a triangle, or of a coarse sensor that follows
/// a slow motion, are all alike.
const UNLIKE: f64 = 2.0;
/// Samples that bend, beyond two at each end of a line, after which a channel is no sequence of lines.
const CURVED: usize = 1000;

/// Number of samples in one line of a channel that consists of straight lines of even length; `None` of any other.
///
/// `rounding` is the largest bend, in the channel's unit, that rounding explains.
pub(crate) fn line_length(values: &[f64], rounding: f64) -> Option<usize> {
    let (mut lengths, mut sizes) = (Vec::new(), Vec::new());
    // First sample of the last bend, and number of samples that bend there and beyond two at any bend.
    let (mut from, mut bent, mut curved) = (None, 0, 0);
    for (k, [a, b, c]) in values.array_windows().enumerate() {
        let bend = (a - 2.0 * b + c).abs();
        // A missing value makes no bend.
        let is_straight = bend.is_nan() || bend <= rounding;
        if is_straight {
            bent = 0;
            continue;
        }
        bent += 1;
        curved += usize::from(bent > 2);
        if bent == 1 {
            lengths.extend(from.map(|from| k - from));
            sizes.push(bend);
            from = Some(k);
        }
        if curved > CURVED || lengths.len() == BENDS.end {
            break;
        }
    }
    if lengths.len() < BENDS.start || curved > lengths.len() / 4 {
        return None;
    }
    let [tenth, middle] = [lengths.len() / 10, lengths.len() / 2];
    let length = *lengths.select_nth_unstable(tenth).1;
    let regular = lengths.iter().filter(|&&n| n == length || n == length + 1).count();
    let small = *sizes.select_nth_unstable_by(tenth, f64::total_cmp).1;
    let usual = *sizes.select_nth_unstable_by(middle, f64::total_cmp).1;
    let is_even = regular as f64 >= REGULAR_SHARE * lengths.len() as f64;
    (is_even && usual >= UNLIKE * small).then_some(length)
}

#[cfg(test)]
mod tests {
    use super::line_length;

    /// A wave of two frequencies at 100 Hz, and the same at another rate joined by lines.
    fn wave(s: f64) -> f64 {
        1e-3 * ((2.0 * s).sin() + (5.3 * s).cos())
    }

    fn joined(rate_hz: f64) -> Vec<f64> {
        let line = |s: f64| {
            let (low, share) = ((s * rate_hz).floor(), (s * rate_hz).fract());
            wave(low / rate_hz) * (1.0 - share) + wave((low + 1.0) / rate_hz) * share
        };
        (0..6000).map(|k| line(f64::from(k) / 100.0)).collect()
    }

    /// 100 Hz over the rate, also where a line ends between two samples (100/8).
    #[test]
    fn lines_are_as_long_as_the_channel_is_slow() {
        for (rate_hz, length) in [(1.0, 100), (4.0, 25), (8.0, 12), (20.0, 5)] {
            assert_eq!(line_length(&joined(rate_hz), 1e-12), Some(length), "{rate_hz} Hz");
        }
    }

    #[test]
    fn curves_triangles_and_coarse_sensors_are_no_lines() {
        let triangle = |k: i32| f64::from((k % 80 - 40).abs());
        let coarse = |k: i32| f64::from(k / 7);
        let of = |sample: &dyn Fn(i32) -> f64| line_length(&(0..6000).map(sample).collect::<Vec<_>>(), 1e-12);
        assert_eq!(of(&|k| wave(f64::from(k) / 100.0)), None);
        assert_eq!(of(&triangle), None);
        assert_eq!(of(&coarse), None);
    }
}
