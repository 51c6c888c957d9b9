//! Parts of an assessment: history, level, limit crossing and alert state.

pub(crate) mod assessment;
pub(crate) mod crossing;
pub(crate) mod history;
pub(crate) mod level;
pub(crate) mod state;
pub(crate) mod types;
pub(crate) mod utilization;
