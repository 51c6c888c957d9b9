//! Column names in which `{position}` stands for the actuator's place.

use std::borrow::Cow;

use icu_normalizer::ComposingNormalizerBorrowed;

/// The word that stands for a position.
pub const PLACEHOLDER: &str = "{position}";

/// A name with its accents composed (Unicode's NFC): files of some systems write them as characters of their own.
pub(crate) fn composed(name: &str) -> Cow<'_, str> {
    if name.is_ascii() { Cow::Borrowed(name) } else { ComposingNormalizerBorrowed::new_nfc().normalize(name) }
}

/// The position a column's name speaks of, if it fits the pattern.
pub(crate) fn position_in<'c>(pattern: &str, column: &'c str) -> Option<&'c str> {
    let pattern = composed(pattern);
    let (before, after) = pattern.split_once(PLACEHOLDER)?;
    column.strip_prefix(before)?.strip_suffix(after).filter(|position| !position.is_empty())
}

/// The column of that position.
pub(crate) fn column_for(pattern: &str, position: &str) -> String {
    composed(pattern).replacen(PLACEHOLDER, position, 1)
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
