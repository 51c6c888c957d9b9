//! Queries: every result is read from one version of a table.

pub(crate) mod column_scan;
pub(crate) mod frame;
pub(crate) mod join;
pub(crate) mod latest_rows;
pub(crate) mod query;
pub(crate) mod scan;
pub(crate) mod store_read;
