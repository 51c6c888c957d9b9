//! Commands that read logs without a store.

pub(crate) mod check;
pub(crate) mod estimate;
pub(crate) mod normalize;
