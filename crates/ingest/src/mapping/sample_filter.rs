//! Which stretches of a log count: those in which every condition on other columns holds.

use std::ops::Range;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_with::skip_serializing_none;

/// A raw value of a column: a number, a truth value, or a text.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum RawValue {
    /// A number.
    Number(f64),
    /// True, which is also 1, or false, which is also 0.
    Truth(bool),
    /// A text, compared without the blanks around it.
    Text(String),
}

impl RawValue {
    #[expect(clippy::float_cmp, reason = "a raw value is compared as it was written")]
    fn is(&self, number: f64) -> bool {
        match self {
            Self::Number(own) => *own == number,
            Self::Truth(own) => f64::from(u8::from(*own)) == number,
            Self::Text(_) => false,
        }
    }

    /// The value as a column of texts holds it.
    fn as_text(&self) -> String {
        match self {
            Self::Number(number) => number.to_string(),
            Self::Truth(is_true) => is_true.to_string(),
            Self::Text(text) => text.trim().to_owned(),
        }
    }

    /// Whether any of these values is a text: the column is then read as text.
    fn has_text(values: &[Self]) -> bool {
        values.iter().any(|value| matches!(value, Self::Text(_)))
    }

    /// The texts that these values are, where the column is read as text.
    pub(crate) fn texts(values: &[Self]) -> Vec<String> {
        if Self::has_text(values) { values.iter().map(Self::as_text).collect() } else { Vec::new() }
    }

    /// Whether a number is one of these values; a column of texts is read as 1 where it holds one of them.
    pub(crate) fn is_one_of(values: &[Self], number: f64) -> bool {
        if Self::has_text(values) { number > 0.5 } else { values.iter().any(|value| value.is(number)) }
    }
}

/// `[[channel.when]]`: samples count only while a column meets a condition, e.g. airborne, or powered.
#[skip_serializing_none]
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SampleFilter {
    /// The column; `{position}` stands for the actuator's position.
    pub column: String,
    /// Raw values that meet the condition.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub equals: Vec<RawValue>,
    /// Lowest raw value that meets the condition.
    pub at_least: Option<f64>,
    /// Highest raw value that meets the condition.
    pub at_most: Option<f64>,
    /// Time that is excluded after the condition begins to hold and before it ends, s.
    pub margin_s: Option<f64>,
    /// The `[group.…]` whose files hold the column. Default: the main logs.
    pub group: Option<String>,
    /// The column's own time column.
    pub time_column: Option<String>,
    /// The column's own rate, Hz, where it is slower than its rows.
    pub rate_hz: Option<f64>,
}

impl SampleFilter {
    /// Whether the filter has a condition on its column.
    pub fn has_condition(&self) -> bool {
        !self.equals.is_empty() || self.at_least.is_some() || self.at_most.is_some()
    }

    /// Whether a raw value will do. A missing one does not.
    fn holds(&self, value: f64) -> bool {
        let one_of = self.equals.is_empty() || RawValue::is_one_of(&self.equals, value);
        let reaches = self.at_least.is_none_or(|least| value >= least);
        let stays = self.at_most.is_none_or(|most| value <= most);
        !value.is_nan() && one_of && reaches && stays
    }

    /// The parts of stretches in which it holds, less the margin at either end.
    pub(crate) fn within(
        &self,
        values: &[f64],
        stretches: &[Range<usize>],
        step_s: f64,
    ) -> Vec<Range<usize>> {
        let margin = (self.margin_s.unwrap_or(0.0) / step_s).ceil() as usize;
        let mut parts = Vec::new();
        for stretch in stretches {
            let mut start = None;
            for i in stretch.clone() {
                if self.holds(values[i]) {
                    start.get_or_insert(i);
                } else if let Some(from) = start.take() {
                    parts.push(from + margin..i.saturating_sub(margin));
                }
            }
            parts.extend(start.map(|from| from + margin..stretch.end.saturating_sub(margin)));
        }
        parts.retain(|part| part.start < part.end);
        parts
    }
}

#[cfg(test)]
#[expect(clippy::single_range_in_vec_init, reason = "one stretch is a list of one")]
mod tests {
    use super::*;

    fn when(equals: &[f64], at_least: Option<f64>, margin_s: Option<f64>) -> SampleFilter {
        let equals = equals.iter().copied().map(RawValue::Number).collect();
        SampleFilter { equals, at_least, margin_s, ..SampleFilter::default() }
    }

    #[test]
    fn stretches_are_cut_to_where_it_holds_less_the_margin_at_both_ends() {
        let values = [0.0, 1.0, 1.0, 0.0, 1.0, f64::NAN, 1.0, 1.0];
        assert_eq!(when(&[1.0], None, None).within(&values, &[0..7, 7..8], 0.1), [1..3, 4..5, 6..7, 7..8]);
        assert_eq!(when(&[], Some(0.5), None).within(&values, &[2..5], 0.1), [2..3, 4..5]);
        let values = [1.0; 20];
        assert_eq!(when(&[1.0], None, Some(0.25)).within(&values, &[0..20], 0.1), [3..17]);
        assert!(when(&[1.0], None, Some(2.0)).within(&values, &[0..20], 0.1).is_empty());
    }
}
