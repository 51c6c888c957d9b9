//! Column builder: converts values to SI and updates their statistics while they are in the cache.

use crate::channel::buffer_pool;
use crate::channel::si_conversion::{SiConversion, apply_to_all};
use crate::channel::stats::{ChannelStats, StatsAccumulator};

/// Numbers that are read and added at a time: few enough to stay in the first-level cache.
pub(crate) const BATCH: usize = 2048;

#[derive(Debug)]
pub(crate) struct ColumnBuilder {
    to_si: Option<SiConversion>,
    values: Vec<f64>,
    /// `None` where the statistics are not needed.
    scanner: Option<StatsAccumulator>,
}

impl ColumnBuilder {
    /// An empty column with room for `values` values, which become SI or stay raw, with statistics of them or without.
    pub(crate) fn new(values: usize, to_si: Option<SiConversion>, has_stats: bool) -> Self {
        let scanner = has_stats.then(StatsAccumulator::default);
        Self { to_si, values: buffer_pool::acquire(values), scanner }
    }

    pub(crate) fn len(&self) -> usize {
        self.values.len()
    }

    pub(crate) fn append_nulls(&mut self, values: usize) {
        self.values.resize(self.values.len() + values, f64::NAN);
    }

    /// The values, and their statistics where requested.
    pub(crate) fn finish(self) -> (Vec<f64>, Option<ChannelStats>) {
        let seen = self.scanner.map(|scanner| scanner.end(&self.values));
        (self.values, seen)
    }
}

impl Extend<f64> for ColumnBuilder {
    fn extend<T: IntoIterator<Item = f64>>(&mut self, numbers: T) {
        let before = self.values.len();
        self.values.extend(numbers);
        if let Some(to_si) = self.to_si {
            apply_to_all(to_si, &mut self.values[before..]);
        }
        if let Some(scanner) = &mut self.scanner {
            scanner.advance(&self.values);
        }
    }
}
