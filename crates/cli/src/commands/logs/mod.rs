//! Commands that read logs without a store.

pub(crate) mod check;
pub(crate) mod estimate;
mod estimate_plot;
pub(crate) mod normalize;
