//! A segment of a unit's history between two resets.

use crate::data::outliers::WeightedGap;

/// Segment of a unit's history between resets.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Segment<'a> {
    pub(crate) estimates: &'a [WeightedGap],
    /// Usage at its beginning and at the date of the assessment.
    pub(crate) begin: f64,
    pub(crate) now: f64,
    /// New or just reset when it began.
    pub(crate) fresh: bool,
    /// Age when it began, if the books know it.
    pub(crate) known_age: Option<f64>,
}

impl Segment<'_> {
    /// Whether the age at its begin needs no guessing.
    pub(crate) fn is_of_known_age(&self) -> bool {
        self.fresh || self.known_age.is_some()
    }
}
