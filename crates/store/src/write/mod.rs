//! Changes to a store: commits and compaction, under one lock.

pub(crate) mod compact;
pub(crate) mod lock;
pub(crate) mod writer;
