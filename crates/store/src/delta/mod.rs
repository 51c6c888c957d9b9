//! Delta tables: log, data files, statistics and durable writes.

pub(crate) mod data_file;
pub(crate) mod durable_fs;
pub(crate) mod file_stats;
pub(crate) mod location;
pub(crate) mod log_digests;
pub(crate) mod log_storage;
pub(crate) mod snapshot;
pub(crate) mod table;
pub(crate) mod versioned;
