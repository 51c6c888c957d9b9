//! Sparkline: a series of numbers as `▁▂▃▅▇`.

/// Characters by height.
const BLOCKS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
/// Maximum length, characters.
const WIDTH: usize = 12;
/// Minimum full scale as a share of the largest value, so that noise does not look like growth.
const LEAST_SHARE: f64 = 0.2;

/// Sparkline of at most twelve means of neighbours, oldest first; empty for fewer than two values. With a limit, a full
/// block is the limit and an empty one zero; otherwise the values' own range.
pub(crate) fn sparkline(values: &[f64], limit: Option<f64>) -> String {
    if values.len() < 2 {
        return String::new();
    }
    let buckets = values.len().min(WIDTH);
    let edge = |k: usize| k * values.len() / buckets;
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
    let means: Vec<f64> = (0..buckets).map(|k| mean(&values[edge(k)..edge(k + 1)])).collect();
    let (low, high) =
        means.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &v| (l.min(v), h.max(v)));
    let range = (high - low).max(LEAST_SHARE * high.abs()).max(f64::MIN_POSITIVE);
    let (low, height) = limit.map_or((low, range), |limit| (0.0, limit));
    let last = BLOCKS.len() - 1;
    means.iter().map(|v| BLOCKS[(((v - low) / height * last as f64).round() as usize).min(last)]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn growth_climbs_and_rest_lies_flat() {
        assert_eq!(sparkline(&[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0], None), "▁▂▃▄▅▆▇█");
        assert_eq!(sparkline(&[100.0, 100.5, 99.8], None), "▁▁▁");
        assert_eq!(sparkline(&[0.0; 3], None), "▁▁▁");
    }

    #[test]
    fn a_limit_is_a_full_block() {
        assert_eq!(sparkline(&[0.0, 75e-6, 150e-6, 160e-6], Some(150e-6)), "▁▅██");
        assert_eq!(sparkline(&[-1e-6, 20e-6], Some(150e-6)), "▁▂");
    }

    #[test]
    fn many_values_are_twelve_characters() {
        let values: Vec<f64> = (0..1000).map(f64::from).collect();
        assert_eq!(sparkline(&values, None).chars().count(), 12);
        assert_eq!(sparkline(&[1.0], None), "");
    }
}
