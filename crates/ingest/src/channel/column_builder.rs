//! Column builder: converts values to SI and updates their statistics while they are in the cache.

use crate::channel::buffer_pool;
use crate::channel::si_conversion::SiConversion;
use crate::channel::stats::{ChannelStats, StatsAccumulator};

/// Numbers that are brought in between two looks: few enough to stay in the first cache.
pub(crate) const BATCH: usize = 2048;

/// A column that more raw numbers are added to.
#[derive(Debug)]
pub(crate) struct ColumnBuilder {
    to_si: Option<SiConversion>,
    values: Vec<f64>,
    /// `None` where the statistics are not needed.
    scanner: Option<StatsAccumulator>,
}

/// How far a column was, to come back to.
#[derive(Debug)]
pub(crate) struct Checkpoint {
    values: usize,
    scanner: Option<StatsAccumulator>,
}

impl ColumnBuilder {
    /// An empty column with room for so many values, which become SI or stay raw.
    pub(crate) fn with_capacity(values: usize, to_si: Option<SiConversion>) -> Self {
        Self { to_si, values: buffer_pool::acquire(values), scanner: None }
    }

    /// The same, with statistics of the appended values.
    pub(crate) fn with_stats(self) -> Self {
        Self { scanner: Some(StatsAccumulator::new()), ..self }
    }

    pub(crate) fn len(&self) -> usize {
        self.values.len()
    }

    pub(crate) fn checkpoint(&self) -> Checkpoint {
        Checkpoint { values: self.values.len(), scanner: self.scanner.clone() }
    }

    /// Leaves out some values: they are missing.
    pub(crate) fn append_nulls(&mut self, values: usize) {
        self.values.resize(self.values.len() + values, f64::NAN);
    }

    /// Forgets what was added since.
    pub(crate) fn rollback(&mut self, mark: Checkpoint) {
        self.values.truncate(mark.values);
        self.scanner = mark.scanner;
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
            to_si.apply_to_all(&mut self.values[before..]);
        }
        if let Some(scanner) = &mut self.scanner {
            scanner.advance(&self.values);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_taken_back_was_never_seen() {
        let mut column = ColumnBuilder::with_capacity(4, None).with_stats();
        column.extend((0..50).map(f64::from));
        let mark = column.checkpoint();
        column.extend([f64::NAN, 1e9, f64::NAN].into_iter().cycle().take(40));
        column.rollback(mark);
        column.extend((50..99).map(f64::from));
        let wanted: Vec<f64> = (0..99).map(f64::from).collect();
        assert_eq!(column.finish(), (wanted.clone(), Some(ChannelStats::of(&wanted))));
    }
}
