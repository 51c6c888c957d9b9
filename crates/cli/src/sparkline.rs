//! Sparkline: a series of numbers as `▁▂▃▅▇`.

/// Characters by height.
const BLOCKS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
/// Maximum length, characters.
const WIDTH: usize = 12;
/// Least full scale as a share of the limit, or of the largest value, so that noise does not look like growth.
const LEAST_SHARE: f64 = 0.2;

/// Heading of a column of sparklines: their scale.
pub(crate) const SCALE: &str = "▁ lowest █ limit";

/// Sparkline of at most twelve means of neighbours, oldest first; empty for fewer than two values. An empty block is the
/// lowest value and a full one the limit, or the highest value without a limit.
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
    let (low, top) = match limit {
        Some(limit) => (low.min((1.0 - LEAST_SHARE) * limit), limit),
        None => (low, high.max(low + LEAST_SHARE * high.abs())),
    };
    let height = (top - low).max(f64::MIN_POSITIVE);
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
    fn the_lowest_value_is_an_empty_block_and_the_limit_a_full_one() {
        assert_eq!(sparkline(&[0.0, 75e-6, 150e-6, 160e-6], Some(150e-6)), "▁▅██");
        assert_eq!(sparkline(&[100e-6, 110e-6, 125e-6, 140e-6], Some(150e-6)), "▁▂▅▇", "wear shows");
        assert_eq!(
            sparkline(&[140e-6, 141e-6, 139e-6], Some(150e-6)),
            "▆▆▅",
            "noise near the limit does not"
        );
        assert_eq!(sparkline(&[20e-6, 21e-6, 20e-6], Some(150e-6)), "▁▁▁");
    }

    #[test]
    fn many_values_are_twelve_characters() {
        let values: Vec<f64> = (0..1000).map(f64::from).collect();
        assert_eq!(sparkline(&values, None).chars().count(), 12);
        assert_eq!(sparkline(&[1.0], None), "");
    }
}
