//! Join of bookkeeping to records, as a caller supplies it.

use std::sync::Arc;

use arrow::array::RecordBatch;
use arrow::error::ArrowError;

type Function = dyn Fn(&RecordBatch) -> Result<RecordBatch, ArrowError> + Send + Sync;

/// Replaces the bookkeeping columns among a batch's columns. The batch also has tail number, position, departure and flight.
#[derive(Clone)]
pub struct Join(Arc<Function>);

impl Join {
    /// A join by a function from a batch to one with the same columns.
    pub fn new(
        join: impl Fn(&RecordBatch) -> Result<RecordBatch, ArrowError> + Send + Sync + 'static,
    ) -> Self {
        Self(Arc::new(join))
    }

    pub(crate) fn apply(&self, batch: &RecordBatch) -> Result<RecordBatch, ArrowError> {
        (self.0)(batch)
    }
}

impl std::fmt::Debug for Join {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Join")
    }
}
