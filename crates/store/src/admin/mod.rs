//! Store administration: run log, summary, verification and withdrawal.

pub(crate) mod follow_up;
pub(crate) mod info;
pub(crate) mod run_log;
pub(crate) mod verify;
pub(crate) mod withdraw;
