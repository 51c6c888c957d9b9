//! Quantiles of weighted samples.

/// Values with weights, in order.
pub(crate) struct WeightedSamples {
    values: Vec<(f64, f64)>,
    pub(crate) total: f64,
}

impl WeightedSamples {
    pub(crate) fn new(values: impl Iterator<Item = (f64, f64)>) -> Self {
        let mut values: Vec<(f64, f64)> = values.collect();
        values.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let total = values.iter().map(|v| v.1).sum();
        Self { values, total }
    }

    /// The first value at which this share of the weight is reached; zero of nothing.
    pub(crate) fn quantile(&self, share: f64) -> f64 {
        let mut sum = 0.0;
        let reached = self.values.iter().find(|(_, weight)| {
            sum += weight;
            sum >= share * self.total
        });
        reached.or(self.values.last()).map_or(0.0, |(value, _)| *value)
    }

    /// The share of the weight of values up to one; at most one, and zero of nothing.
    pub(crate) fn share_below(&self, value: f64) -> f64 {
        let below = &self.values[..self.values.partition_point(|v| v.0 <= value)];
        if self.total > 0.0 { (below.iter().map(|v| v.1).sum::<f64>() / self.total).min(1.0) } else { 0.0 }
    }
}
