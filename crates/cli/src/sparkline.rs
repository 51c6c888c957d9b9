//! Sparkline: a series of numbers as `▁▂▃▅▇`.

/// Characters by height.
const BLOCKS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
/// Maximum length, characters.
const WIDTH: usize = 12;
/// Minimum full scale as a share of the largest value, so that noise does not look like growth.
const LEAST_SHARE: f64 = 0.2;

/// Sparkline of at most twelve means of neighbours, oldest first; empty for fewer than two values.
pub(crate) fn sparkline(values: &[f64]) -> String {
    if values.len() < 2 {
        return String::new();
    }
    let buckets = values.len().min(WIDTH);
    let edge = |k: usize| k * values.len() / buckets;
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
    let means: Vec<f64> = (0..buckets).map(|k| mean(&values[edge(k)..edge(k + 1)])).collect();
    let (low, high) =
        means.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &v| (l.min(v), h.max(v)));
    let height = (high - low).max(LEAST_SHARE * high.abs()).max(f64::MIN_POSITIVE);
    let last = BLOCKS.len() - 1;
    means.iter().map(|v| BLOCKS[(((v - low) / height * last as f64).round() as usize).min(last)]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn growth_climbs_and_rest_lies_flat() {
        assert_eq!(sparkline(&[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]), "▁▂▃▄▅▆▇█");
        assert_eq!(sparkline(&[100.0, 100.5, 99.8]), "▁▁▁");
        assert_eq!(sparkline(&[0.0; 3]), "▁▁▁");
    }

    #[test]
    fn many_values_are_twelve_characters() {
        let values: Vec<f64> = (0..1000).map(f64::from).collect();
        assert_eq!(sparkline(&values).chars().count(), 12);
        assert_eq!(sparkline(&[1.0]), "");
    }
}
