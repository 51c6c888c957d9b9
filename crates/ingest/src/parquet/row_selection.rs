//! Row selection: all rows of a table, or the segments in which the sample filters hold.
//!
//! Pages without a selected row are not decompressed. Whether a page is decompressed changes no value:
//! rows outside the segments are removed from pages that hold both.

use std::ops::Range;

/// Selected rows of a table: stretches in order and apart from each other; `None` for every row.
pub(crate) type RowSelection<'a> = Option<&'a [Range<usize>]>;

/// Whether any of these rows is selected.
pub(crate) fn intersects(selection: RowSelection<'_>, rows: &Range<usize>) -> bool {
    selection.is_none_or(|stretches| {
        let next = stretches.partition_point(|stretch| stretch.end <= rows.start);
        stretches.get(next).is_some_and(|stretch| stretch.start < rows.end)
    })
}
