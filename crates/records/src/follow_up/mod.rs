//! What follows from a finding: alerts about changes of state, and work requests.

pub mod alert_record;
pub mod work_event;
pub mod work_request;
