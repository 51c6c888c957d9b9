//! Bytes of local files and objects: where they come from, and positional reads.

pub(crate) mod byte_source;
pub(crate) mod foreign_format;
pub(crate) mod retry;
