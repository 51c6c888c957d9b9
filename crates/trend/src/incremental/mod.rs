//! The state of one unit that makes the cost of one more flight independent of the history's length.

pub(crate) mod checkpoint;
pub(crate) mod departure_deltas;
pub(crate) mod encoding;
pub(crate) mod snapshot;
pub(crate) mod tail;
