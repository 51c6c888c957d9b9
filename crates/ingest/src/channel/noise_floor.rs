//! How noisy a channel is, from the channel itself: what is left where motion is smoothest.

/// Samples of a window.
const WINDOW: usize = 64;
/// Of the windows, from the quietest on, this share is passed over: motion is in the rest.
const QUIET: f64 = 0.25;
/// Variance of the third difference of white noise over its own: 1² + 3² + 3² + 1².
const THIRD: f64 = 20.0;
/// A quarter of the windows lie below this share of the true variance, by chance alone: third differences of
/// 64 samples overlap, and scatter as 26 free ones would.
const QUARTILE: f64 = 0.80;

/// Rms of the white noise of a channel, without what its resolution alone would make; none where no window of
/// 64 samples is whole.
///
/// Third differences leave of a motion of 1 mm at 1 Hz no more than 0.02 µm at 250 samples a second, 0.5 µm at
/// 50. Rounding to steps adds step²/12 to the variance, as the noise model has it; where that is all there is,
/// the noise is zero.
pub fn white_noise_rms(values: &[f64], resolution: Option<f64>) -> Option<f64> {
    let mut variances: Vec<f64> = values.chunks_exact(WINDOW).filter_map(variance).collect();
    if variances.is_empty() {
        return None;
    }
    let at = ((variances.len() - 1) as f64 * QUIET) as usize;
    let quiet = *variances.select_nth_unstable_by(at, f64::total_cmp).1 / QUARTILE;
    let rounding = resolution.map_or(0.0, |step| step * step / 12.0);
    Some((quiet - rounding).max(0.0).sqrt())
}

/// Variance of a window's noise; none where a sample is missing.
fn variance(window: &[f64]) -> Option<f64> {
    let thirds = window.windows(4).map(|w| w[3] - w[0] - 3.0 * (w[2] - w[1]));
    let sum: f64 = thirds.map(|d| d * d).sum();
    sum.is_finite().then(|| sum / (THIRD * (window.len() - 3) as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// White noise of a given rms: sums of twelve even numbers, the same in every run.
    fn noise(count: usize, rms: f64) -> Vec<f64> {
        let mut state = 42_u64;
        let mut even = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..count).map(|_| rms * ((0..12).map(|_| even()).sum::<f64>() - 6.0)).collect()
    }

    #[test]
    fn noise_is_found_beneath_a_motion_ten_thousand_times_larger() {
        let values: Vec<f64> = noise(30_000, 2e-6)
            .iter()
            .enumerate()
            .map(|(k, n)| n + 0.02 * (0.004 * k as f64).sin())
            .collect();
        let found = white_noise_rms(&values, None).unwrap();
        assert!((found / 2e-6 - 1.0).abs() < 0.1, "{found}");
    }

    #[test]
    fn rounding_is_not_noise() {
        let rounded: Vec<f64> =
            (0..20_000).map(|k| ((0.02 * (0.003 * f64::from(k)).sin()) / 1e-6).round() * 1e-6).collect();
        assert!(white_noise_rms(&rounded, Some(1e-6)).unwrap() < 0.2e-6);
        let both: Vec<f64> = noise(20_000, 3e-6).iter().map(|n| (n / 2e-6).round() * 2e-6).collect();
        let found = white_noise_rms(&both, Some(2e-6)).unwrap();
        assert!((found / 3e-6 - 1.0).abs() < 0.1, "{found}");
    }

    #[test]
    fn without_a_whole_window_nothing_is_said() {
        assert_eq!(white_noise_rms(&[f64::NAN; 200], None), None);
        assert_eq!(white_noise_rms(&[1.0; 63], None), None);
    }
}
