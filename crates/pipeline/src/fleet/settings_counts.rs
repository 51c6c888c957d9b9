//! Gaps of a unit by the settings that they were estimated with.

use jiff::Timestamp;

/// Number of gaps and latest departure, µs since 1970 UTC, by the digest of the settings of the estimate. A unit has one or
/// two, so each row's is found by comparing.
#[derive(Debug, Clone, Default)]
pub(crate) struct SettingsCounts(Vec<(String, usize, i64)>);

impl SettingsCounts {
    /// Adds gaps of some settings.
    pub(crate) fn add(&mut self, settings: &str, gaps: usize, latest_us: i64) {
        match self.0.iter_mut().find(|(known, ..)| known == settings) {
            Some((_, count, latest)) => {
                *count += gaps;
                *latest = latest_us.max(*latest);
            }
            None => self.0.push((settings.to_owned(), gaps, latest_us)),
        }
    }

    /// Adds those of another part of the unit's rows.
    pub(crate) fn add_all(&mut self, others: &Self) {
        others.0.iter().for_each(|(settings, gaps, latest_us)| self.add(settings, *gaps, *latest_us));
    }

    /// Number of gaps with other settings than the latest gap, the departure of the last of them, and the number of all
    /// gaps; `None` if all have the same settings.
    pub(crate) fn others(&self) -> Option<(usize, Timestamp, usize)> {
        let latest_us = self.0.iter().map(|(_, _, us)| *us).max()?;
        let others = || self.0.iter().filter(|(_, _, us)| *us < latest_us);
        let last_us = others().map(|(_, _, us)| *us).max()?;
        let all = self.0.iter().map(|(_, gaps, _)| gaps).sum();
        Some((others().map(|(_, gaps, _)| gaps).sum(), Timestamp::from_microsecond(last_us).ok()?, all))
    }
}
