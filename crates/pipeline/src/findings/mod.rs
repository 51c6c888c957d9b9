//! What a run finds beside the assessments, and what follows from both: alerts about changes of state, and work requests.

pub mod alert_changes;
mod alert_message;
mod channel;
pub mod delivery;
pub mod finding;
pub mod monitoring;
mod run_step;
pub mod summary;
pub mod work_list;
pub mod work_requests;
pub mod work_update;

pub(crate) use run_step::FollowUp;
