//! Queries: every result is read from one version of a table.

pub(crate) mod column_scan;
pub(crate) mod latest_rows;
pub(crate) mod polars_scan;
pub(crate) mod query;
pub(crate) mod store_read;
