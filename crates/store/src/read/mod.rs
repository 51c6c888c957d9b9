//! Queries: every result is read from one version of a table.

pub(crate) mod column_scan;
pub(crate) mod frame;
pub(crate) mod latest_rows;
pub(crate) mod query;
pub(crate) mod scan;
