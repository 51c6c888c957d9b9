//! Row types and their Arrow columns.

pub(crate) mod accounts;
pub mod gap_columns;
pub(crate) mod row_schema;
pub(crate) mod versioned;
