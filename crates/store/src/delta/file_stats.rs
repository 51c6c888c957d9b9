//! Statistics of data files in the Delta log: number of rows, and bounds of the columns.

use std::cmp::Ordering;
use std::collections::BTreeSet;

use arrow::array::{Array, AsArray, RecordBatch};
use arrow::compute::{max, max_string, min, min_string};
use arrow::datatypes::{DataType, TimestampMicrosecondType};
use jiff::Timestamp;
use serde::Deserialize;
use serde_json::{Map, Value, json};

/// Bounds of times are kept in whole milliseconds: other engines cut them there.
const MILLI_US: i64 = 1_000;

/// Largest number of units listed per file. Files sorted by tail hold few units, the file of a run holds all.
const LISTED_UNITS: usize = 256;

/// The column of units, and where in the statistics its values stand. Every engine passes over names it does
/// not know.
const UNITS: (&str, &str) = ("serial_number", "freeplaySerials");

/// A file's statistics as read from the log. Unknown values are missing, and exclude no file.
#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(crate) struct Stats {
    pub(crate) num_records: Option<i64>,
    min_values: Map<String, Value>,
    max_values: Map<String, Value>,
    /// The units in the file; a unit moves between tails, so bounds alone would rule out no file.
    freeplay_serials: Option<BTreeSet<String>>,
}

impl Stats {
    /// Statistics that cannot be parsed count as missing.
    pub(crate) fn parse(text: Option<&str>) -> Self {
        text.and_then(|text| serde_json::from_str(text).ok()).unwrap_or_default()
    }

    pub(crate) fn may_hold(&self, column: &str, first: &str, last: &str) -> bool {
        let bound =
            |bounds: &Map<String, Value>| bounds.get(column).and_then(Value::as_str).map(str::to_owned);
        let listed = self.freeplay_serials.as_ref().filter(|_| column == UNITS.0);
        let is_within = |unit: &String| (first..=last).contains(&unit.as_str());
        listed.is_none_or(|units| units.iter().any(is_within))
            && bound(&self.min_values).is_none_or(|low| low.as_str() <= last)
            && bound(&self.max_values).is_none_or(|high| first <= high.as_str())
    }

    /// Which column has values outside the statistics; `None` when they cover the content of the file.
    pub(crate) fn missed_by(&self, content: &Self) -> Option<String> {
        if self.num_records.is_some() && self.num_records != content.num_records {
            return Some("the number of rows".to_owned());
        }
        let is_outside = |bounds: &Map<String, Value>, of: &Map<String, Value>, order: Ordering| {
            let outside = |(name, bound): (&String, &Value)| {
                let (found, bound) = (of.get(name)?.as_str()?, bound.as_str()?);
                let compared = match (milliseconds(found), milliseconds(bound)) {
                    (Some(found), Some(bound)) => found.cmp(&bound),
                    _ => found.cmp(bound),
                };
                (compared == order).then(|| name.clone())
            };
            bounds.iter().find_map(outside)
        };
        let units = self.freeplay_serials.as_ref().zip(content.freeplay_serials.as_ref());
        is_outside(&self.min_values, &content.min_values, Ordering::Less)
            .or_else(|| is_outside(&self.max_values, &content.max_values, Ordering::Greater))
            .or_else(|| {
                units.is_some_and(|(listed, held)| !held.is_subset(listed)).then(|| UNITS.0.to_owned())
            })
    }

    /// The earliest and the latest time the column may hold, µs since 1970; a file without rows holds none,
    /// and its earliest is after its latest.
    pub(crate) fn times_us(&self, column: &str) -> (i64, i64) {
        if self.num_records == Some(0) {
            return (i64::MAX, i64::MIN);
        }
        let bound = |bounds: &Map<String, Value>| {
            let time: Timestamp = bounds.get(column)?.as_str()?.parse().ok()?;
            Some(time.as_microsecond())
        };
        let low = bound(&self.min_values).unwrap_or(i64::MIN);
        let high = bound(&self.max_values).map_or(i64::MAX, |high| high.saturating_add(MILLI_US));
        if low <= high { (low, high) } else { (i64::MIN, i64::MAX) }
    }
}

/// Statistics of a file about to be added: bounds of every column of text or time that is never empty.
pub(crate) fn of(batch: &RecordBatch) -> String {
    let (mut low, mut high, mut nulls) = (Map::new(), Map::new(), Map::new());
    for (field, array) in batch.schema().fields().iter().zip(batch.columns()) {
        if field.is_nullable() {
            continue;
        }
        if let Some((least, most)) = bounds(array) {
            low.insert(field.name().clone(), least);
            high.insert(field.name().clone(), most);
            nulls.insert(field.name().clone(), json!(0));
        }
    }
    let mut stats =
        json!({ "numRecords": batch.num_rows(), "minValues": low, "maxValues": high, "nullCount": nulls });
    if let Some(units) = units(batch) {
        stats[UNITS.1] = json!(units);
    }
    stats.to_string()
}

/// The units in a batch, where it has such a column and they are few.
fn units(batch: &RecordBatch) -> Option<BTreeSet<&str>> {
    let values = batch.column_by_name(UNITS.0)?.as_string_opt::<i32>()?;
    let mut units = BTreeSet::new();
    for unit in values.iter().flatten() {
        units.insert(unit);
        if units.len() > LISTED_UNITS {
            return None;
        }
    }
    Some(units)
}

fn bounds(array: &dyn Array) -> Option<(Value, Value)> {
    match array.data_type() {
        DataType::Utf8 => {
            let texts = array.as_string::<i32>();
            Some((json!(min_string(texts)?), json!(max_string(texts)?)))
        }
        DataType::Timestamp(..) => {
            let times = array.as_primitive::<TimestampMicrosecondType>();
            let low = min(times)?.div_euclid(MILLI_US);
            let high = max(times)?.saturating_add(MILLI_US - 1).div_euclid(MILLI_US);
            Some((json!(written(low)?), json!(written(high)?)))
        }
        _ => None,
    }
}

/// A bound of time; a checkpoint may write it in another form.
fn milliseconds(text: &str) -> Option<i64> {
    text.parse::<Timestamp>().ok().map(Timestamp::as_millisecond)
}

/// Years of four digits only: others are written differently by every engine.
fn written(milliseconds: i64) -> Option<String> {
    let time = Timestamp::from_millisecond(milliseconds).ok()?;
    let text = time.strftime("%Y-%m-%dT%H:%M:%S.%3fZ").to_string();
    (text.len() == "2026-11-21T00:00:00.000Z".len()).then_some(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bounds are widened to whole milliseconds and never narrowed; a file without rows widens no span; and what is not known,
    /// or cannot be, prunes nothing.
    #[test]
    fn bounds_of_time_hold_every_row() {
        const ALL: (i64, i64) = (i64::MIN, i64::MAX);
        assert_eq!(written(0).as_deref(), Some("1970-01-01T00:00:00.000Z"));
        let bounds = |low, high| format!(r#"{{"minValues":{{"t":"{low}"}},"maxValues":{{"t":"{high}"}}}}"#);
        for (text, expected) in [
            (&*bounds("1970-01-01T00:00:00.001Z", "1970-01-01T00:00:00.002Z"), (1_000, 3_000)),
            (&bounds("2026-01-02T00:00:00Z", "2026-01-01T00:00:00Z"), ALL),
            (r#"{"numRecords":0}"#, (i64::MAX, i64::MIN)),
            ("torn", ALL),
        ] {
            assert_eq!(Stats::parse(Some(text)).times_us("t"), expected, "{text}");
        }
        assert!(Stats::parse(Some("torn")).may_hold("tail_number", "N1", "N1"));
    }
}
