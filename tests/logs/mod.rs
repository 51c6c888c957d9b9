//! Logs: layouts, corrupt files, reference logs and logs with known gaps.

mod ground_truth;
mod hostile_names;
pub(crate) mod layouts;
