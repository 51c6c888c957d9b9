//! Checkpoints, so that assessments at several dates share the fit of the earlier flights.

pub(crate) mod checkpoint;
pub(crate) mod snapshot;
pub(crate) mod tail;
