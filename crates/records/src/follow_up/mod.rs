//! What follows from a finding: alerts about changes of state, and work requests.

pub(crate) mod alert_record;
pub(crate) mod work_event;
pub(crate) mod work_request;
