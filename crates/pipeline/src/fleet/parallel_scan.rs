//! ColumnScan of the records, read by all workers and handed over one by one.

use arrow::array::RecordBatch;
use rayon::prelude::*;
use store::ColumnScan;

use crate::error::Error;

/// Hands over all rows in the order of the parts; as many parts as there are workers are held at once.
///
/// # Errors
/// When a part cannot be read, and what the caller cannot take.
pub(crate) fn read_each(
    parts: &ColumnScan,
    mut take: impl FnMut(&RecordBatch) -> Result<(), ingest::Error>,
) -> Result<(), Error> {
    let all: Vec<usize> = (0..parts.len()).collect();
    for some in all.chunks(rayon::current_num_threads()) {
        let read: Vec<_> = some.par_iter().map(|part| parts.read(*part)).collect::<Result<_, _>>()?;
        for batch in read.iter().flatten() {
            take(batch).map_err(|e| Error::refused(e.diagnostic()))?;
        }
    }
    Ok(())
}
