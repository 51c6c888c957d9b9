//! Ranges of the numbers of a specification: one table, `ranges.toml`, for all keys.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use serde::{Deserialize, Serialize};
use toml::Value;

use crate::error::Error;

/// Contents of `ranges.toml`: each key is the end of a path, and stands for all keys with that end.
#[derive(Deserialize)]
struct Ranges {
    positive: Vec<String>,
    not_negative: Vec<String>,
    between: BTreeMap<String, [f64; 2]>,
}

static RANGES: LazyLock<Result<Ranges, toml::de::Error>> =
    LazyLock::new(|| toml::from_str(include_str!("ranges.toml")));

/// Pairs of keys of one table; the second value must not be below the first.
const ORDERED: [(&str, &str); 2] = [("low_hz", "high_hz"), ("from_flight", "to_flight")];

/// Keys whose value is a list of a least and a greatest value.
const RANGE_LISTS: [&str; 2] = ["gap_m", "unit_hours"];

/// Checks every number of a value; `path` is the key that holds it.
pub(crate) fn check(path: &str, checked: &impl Serialize) -> Result<(), Error> {
    let tree = Value::try_from(checked).map_err(|e| Error::Unwritable { problem: e.to_string() })?;
    check_value(path, &tree)
}

fn check_value(path: &str, value: &Value) -> Result<(), Error> {
    match value {
        Value::Float(number) => check_number(path, *number),
        Value::Integer(number) => check_number(path, *number as f64),
        Value::Array(values) => {
            let place = |k: usize| format!("{path}[{k}]");
            values.iter().enumerate().try_for_each(|(k, value)| check_value(&place(k), value))?;
            if RANGE_LISTS.iter().any(|key| ends_with(path, key)) {
                let [least, greatest] = [0, 1].map(|k| values.get(k).and_then(Value::as_float));
                check_order(path, least, greatest, "a range, the least value first")?;
            }
            Ok(())
        }
        Value::Table(table) => {
            let place = |key: &str| if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") };
            table.iter().try_for_each(|(key, value)| check_value(&place(key), value))?;
            let number =
                |key: &str| table.get(key).and_then(|v| v.as_float().or(Some(v.as_integer()? as f64)));
            ORDERED.iter().try_for_each(|(low, high)| {
                check_order(&place(high), number(low), number(high), &format!("no less than `{low}`"))
            })
        }
        Value::String(_) | Value::Boolean(_) | Value::Datetime(_) => Ok(()),
    }
}

fn check_number(path: &str, value: f64) -> Result<(), Error> {
    // The path without the indices of lists.
    let names: String = path.split(['[', ']']).step_by(2).collect();
    let is = |key: &String| ends_with(path, key) || ends_with(&names, key);
    let ranges = RANGES.as_ref().map_err(|e| Error::Unwritable { problem: e.to_string() })?;
    let (is_in_range, must) = if let Some((_, [least, most])) = ranges.between.iter().find(|(key, _)| is(key))
    {
        ((*least..=*most).contains(&value), format!("between {least} and {most}"))
    } else if ranges.positive.iter().any(is) {
        (value > 0.0, "greater than zero and finite".to_owned())
    } else if ranges.not_negative.iter().any(is) {
        (value >= 0.0, "zero or more and finite".to_owned())
    } else {
        (true, "finite".to_owned())
    };
    if is_in_range && value.is_finite() {
        return Ok(());
    }
    Err(Error::Value { key: path.to_owned(), value, must })
}

fn check_order(path: &str, low: Option<f64>, high: Option<f64>, must: &str) -> Result<(), Error> {
    match low.zip(high).filter(|(low, high)| low > high) {
        Some((_, value)) => Err(Error::Value { key: path.to_owned(), value, must: must.to_owned() }),
        None => Ok(()),
    }
}

/// Whether a path ends with a key, at the begin of a name.
fn ends_with(path: &str, key: &str) -> bool {
    path.strip_suffix(key).is_some_and(|above| above.is_empty() || above.ends_with('.'))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::Spec;

    /// Paths of all numbers, without the indices of lists.
    fn paths(above: &str, value: &Value, found: &mut BTreeSet<String>) {
        match value {
            Value::Table(table) => table.iter().for_each(|(k, v)| paths(&format!("{above}.{k}"), v, found)),
            Value::Array(values) => values.iter().for_each(|value| paths(above, value, found)),
            _ => drop(found.insert(above.to_owned())),
        }
    }

    /// A renamed key must not lose its range.
    #[test]
    fn every_range_is_that_of_a_key() {
        let rest = r#"
            units = [{ tail = "A", position = "P", stiffness_factor = 1.0, wear.onset.onset_hours = 1.0, wear.onset.rate_m_per_hour = 0.0 }]
            parts = [{ plant.contact.law.hertz.share = 0.1, plant.contact.law.hertz.reference_m = 1e-6 }]
        "#;
        let specs = [
            crate::SAMPLE_SPEC,
            include_str!("../specs/three_aircraft.toml"),
            include_str!("../specs/rough.toml"),
            include_str!("../specs/harsh.toml"),
        ];
        let mut found = BTreeSet::new();
        for text in specs.into_iter().chain([rest]) {
            let spec: Spec = toml::from_str(text).unwrap();
            paths("", &Value::try_from(spec).unwrap(), &mut found);
        }
        let Ranges { positive, not_negative, between } = RANGES.as_ref().unwrap();
        for key in between.keys().chain(positive).chain(not_negative) {
            let key = key.trim_end_matches("[1]");
            assert!(found.iter().any(|path| ends_with(path, key)), "no key ends with {key}");
        }
    }
}
