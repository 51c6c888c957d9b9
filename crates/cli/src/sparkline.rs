//! Sparkline: a series of numbers as `▁▂▃▅▇`.

const BLOCKS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
const WIDTH: usize = 12;
/// Least full scale as a share of the limit, or of the largest value, so that noise does not look like growth.
const LEAST_SHARE: f64 = 0.2;

/// Heading of a column of sparklines: their scale.
pub(crate) const SCALE: &str = "▁ lowest █ limit";

/// Sparkline of at most twelve means of neighbours, oldest first; empty for fewer than two values. `▁` is
/// the lowest value, or 80 % of the limit if that is lower; `█` is the limit, or without one the highest value, or more where
/// values differ little.
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

    /// Wear shows, and noise near the limit does not.
    #[test]
    fn values_are_blocks_between_the_lowest_and_the_limit() {
        for (values, limit, blocks) in [
            (&[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0][..], None, "▁▂▃▄▅▆▇█"),
            (&[100.0, 100.5, 99.8], None, "▁▁▁"),
            (&[0.0; 3], None, "▁▁▁"),
            (&[1.0], None, ""),
            (&[0.0, 75.0, 150.0, 160.0], Some(150.0), "▁▅██"),
            (&[100.0, 110.0, 125.0, 140.0], Some(150.0), "▁▂▅▇"),
            (&[140.0, 141.0, 139.0], Some(150.0), "▆▆▅"),
            (&[20.0, 21.0, 20.0], Some(150.0), "▁▁▁"),
        ] {
            assert_eq!(sparkline(values, limit), blocks, "{values:?}");
        }
        let values: Vec<f64> = (0..1000).map(f64::from).collect();
        assert_eq!(sparkline(&values, None).chars().count(), 12);
    }
}
