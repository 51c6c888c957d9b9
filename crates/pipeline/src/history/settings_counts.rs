//! Gaps of a unit by the settings that they were estimated with.

use std::collections::BTreeMap;

/// Number of gaps and latest departure, µs since 1970 UTC, by the digest of the settings of the estimate.
pub(crate) type SettingsCounts = BTreeMap<String, (usize, i64)>;

/// Adds gaps to the count of their settings.
pub(crate) fn add_settings(counts: &mut SettingsCounts, settings: &str, (gaps, latest_us): (usize, i64)) {
    let known = counts.entry(settings.to_owned()).or_insert((0, i64::MIN));
    *known = (known.0 + gaps, known.1.max(latest_us));
}
