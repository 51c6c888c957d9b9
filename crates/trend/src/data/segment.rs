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
