//! Which stretches of a log count: those in which every condition on other columns holds.

use std::ops::Range;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[[channel.when]]`: samples count only while a column meets a condition, e.g. airborne, or powered.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SampleFilter {
    /// The column's name; `{position}` stands for the actuator's place.
    pub column: String,
    /// Raw values that will do; true is 1.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub equals: Vec<f64>,
    /// The least raw value that will do.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_least: Option<f64>,
    /// The greatest raw value that will do.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_most: Option<f64>,
    /// Left out after it begins to hold and before it ends, s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub margin_s: Option<f64>,
    /// The name of the `[group.…]` whose files hold the column; the main logs when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub group: Option<String>,
    /// The column's own time column.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_column: Option<String>,
    /// The column's own rate, Hz, where it is recorded more slowly than its rows.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate_hz: Option<f64>,
}

impl SampleFilter {
    /// Whether the filter has a condition on its column.
    pub fn has_condition(&self) -> bool {
        !self.equals.is_empty() || self.at_least.is_some() || self.at_most.is_some()
    }

    /// Whether a raw value will do. A missing one does not.
    fn holds(&self, value: f64) -> bool {
        let one_of = self.equals.is_empty() || self.equals.contains(&value);
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
        SampleFilter { equals: equals.to_vec(), at_least, margin_s, ..SampleFilter::default() }
    }

    #[test]
    fn stretches_are_cut_to_where_it_holds() {
        let values = [0.0, 1.0, 1.0, 0.0, 1.0, f64::NAN, 1.0, 1.0];
        assert_eq!(when(&[1.0], None, None).within(&values, &[0..7, 7..8], 0.1), [1..3, 4..5, 6..7, 7..8]);
        assert_eq!(when(&[], Some(0.5), None).within(&values, &[2..5], 0.1), [2..3, 4..5]);
    }

    #[test]
    fn the_margin_is_left_out_at_both_ends() {
        let values = [1.0; 20];
        assert_eq!(when(&[1.0], None, Some(0.25)).within(&values, &[0..20], 0.1), [3..17]);
        assert!(when(&[1.0], None, Some(2.0)).within(&values, &[0..20], 0.1).is_empty());
    }

    #[test]
    fn a_missing_value_never_holds() {
        assert!(when(&[], None, None).within(&[f64::NAN; 4], &[0..4], 0.1).is_empty());
    }
}
