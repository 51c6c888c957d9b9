//! Parquet files: leaf columns as numbers, page by page, and a writer.

pub(crate) mod column_numbers;
pub(crate) mod leaf_columns;
pub(crate) mod log_file;
pub(crate) mod numeric;
pub(crate) mod page_header;
pub(crate) mod page_reader;
pub(crate) mod raw_footer;
pub mod writer;
