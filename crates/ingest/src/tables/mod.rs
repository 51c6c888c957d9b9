//! Tables in addition to the logs (CSV or Parquet): installations, aliases, flights, maintenance, estimates.
//!
//! A small table is read whole as text ([`TableBatch::read`]), a long one in batches with typed columns ([`TableSplits`]).

pub(crate) mod cell;
mod column_batches;
pub mod flights;
mod installations;
mod table;

pub use cell::{name, number, utc};
pub use column_batches::{ColumnAliases, StringColumn, TableBatch, TableSplits};
pub use installations::{aliases, installations};
