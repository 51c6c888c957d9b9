//! Row selection: all rows of a table, or the segments in which the sample filters hold.
//!
//! Pages without a selected row are not decompressed. Whether a page is decompressed changes no value:
//! rows outside the segments are removed from pages that hold both.

use std::ops::Range;

/// Selected rows.
///
/// They are stretches of rows of a table, in order and apart from each other; none when all rows are wanted.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RowSelection<'a>(Option<&'a [Range<usize>]>);

impl<'a> RowSelection<'a> {
    /// Every row.
    pub(crate) const ALL: Self = Self(None);

    /// The rows of these stretches, which are in order.
    pub(crate) fn of(stretches: &'a [Range<usize>]) -> Self {
        Self(Some(stretches))
    }

    /// Whether every row is.
    pub(crate) fn is_all(self) -> bool {
        self.0.is_none()
    }

    /// Whether any of these rows is wanted.
    pub(crate) fn intersects(self, rows: Range<usize>) -> bool {
        let Some(stretches) = self.0 else { return true };
        let next = stretches.partition_point(|stretch| stretch.end <= rows.start);
        stretches.get(next).is_some_and(|stretch| stretch.start < rows.end)
    }
}
