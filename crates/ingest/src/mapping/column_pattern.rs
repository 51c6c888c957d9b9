//! Column names in which `{position}` stands for the actuator's place.

use std::borrow::Cow;

use icu_normalizer::ComposingNormalizerBorrowed;

/// The word that stands for a position.
pub const PLACEHOLDER: &str = "{position}";

/// A column name, with at most one `{position}`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct ColumnPattern<'a> {
    before: Cow<'a, str>,
    after: Option<Cow<'a, str>>,
}

/// A name with its accents composed (Unicode's NFC): files of some systems write them as characters of their own.
pub(crate) fn composed(name: &str) -> Cow<'_, str> {
    if name.is_ascii() { Cow::Borrowed(name) } else { ComposingNormalizerBorrowed::new_nfc().normalize(name) }
}

impl<'a> ColumnPattern<'a> {
    /// Splits the name at its first placeholder.
    pub(crate) fn new(column: &'a str) -> Self {
        match column.split_once(PLACEHOLDER) {
            Some((before, after)) => Self { before: composed(before), after: Some(composed(after)) },
            None => Self { before: composed(column), after: None },
        }
    }

    /// Whether the name holds the placeholder.
    pub(crate) fn is_open(&self) -> bool {
        self.after.is_some()
    }

    /// The position a column's name speaks of, if it fits.
    pub(crate) fn position_in<'c>(&self, column: &'c str) -> Option<&'c str> {
        let middle = column.strip_prefix(&*self.before)?.strip_suffix(self.after.as_deref()?)?;
        (!middle.is_empty()).then_some(middle)
    }

    /// The column that holds this channel of that position.
    pub(crate) fn column_for(&self, position: &str) -> String {
        match &self.after {
            Some(after) => [&self.before, position, after].concat(),
            None => self.before.clone().into_owned(),
        }
    }
}

/// The known name nearest to a misspelled one, if any is near enough to be meant.
pub fn nearest<'n>(wanted: &str, known: impl IntoIterator<Item = &'n str>) -> Option<&'n str> {
    /// Jaro–Winkler similarity below which two names have nothing to do with each other.
    const NEAR: f64 = 0.8;
    let wanted = wanted.to_lowercase();
    let scored = known.into_iter().map(|name| (strsim::jaro_winkler(&wanted, &name.to_lowercase()), name));
    let best = scored.max_by(|a, b| a.0.total_cmp(&b.0))?;
    (best.0 >= NEAR).then_some(best.1)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn a_position_written_into_a_pattern_is_read_back(before in "[a-z_.]{0,6}", after in "[a-z_.]{0,6}", position in "[a-z0-9_]{1,8}") {
            let name = format!("{before}{PLACEHOLDER}{after}");
            let pattern = ColumnPattern::new(&name);
            let column = pattern.column_for(&position);
            prop_assert_eq!(pattern.position_in(&column), Some(position.as_str()));
        }
    }
}
