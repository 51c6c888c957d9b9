//! Changes to a store: commits, compaction and promotion of a trial, under one lock.

pub(crate) mod compact;
pub(crate) mod lock;
pub(crate) mod promote;
pub(crate) mod writer;
