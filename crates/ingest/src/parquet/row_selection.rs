//! Row selection: all rows of a table, or the segments in which the sample filters hold.
//!
//! Pages without a selected row are not decompressed. Whether a page is decompressed changes no value:
//! rows outside the segments are removed from pages that hold both.

use std::ops::Range;

/// Selected rows.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RowSelection<'a> {
    /// Rows, in order and apart from each other; none when all are wanted.
    stretches: Option<&'a [Range<usize>]>,
    /// Rows of the table before the one that is called the first here.
    before: usize,
}

impl<'a> RowSelection<'a> {
    /// Every row.
    pub(crate) const ALL: Self = Self { stretches: None, before: 0 };

    /// The rows of these stretches, which are in order.
    pub(crate) fn of(stretches: &'a [Range<usize>]) -> Self {
        Self { stretches: Some(stretches), before: 0 }
    }

    /// Whether every row is.
    pub(crate) fn is_all(self) -> bool {
        self.stretches.is_none()
    }

    /// The same, counted from a row on.
    pub(crate) fn offset(self, row: usize) -> Self {
        Self { before: self.before + row, ..self }
    }

    /// Whether any of these rows is wanted.
    pub(crate) fn intersects(self, rows: Range<usize>) -> bool {
        let Some(stretches) = self.stretches else { return true };
        let (start, end) = (self.before + rows.start, self.before + rows.end);
        let next = stretches.partition_point(|stretch| stretch.end <= start);
        stretches.get(next).is_some_and(|stretch| stretch.start < end)
    }
}
