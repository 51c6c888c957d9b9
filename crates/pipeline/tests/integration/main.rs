//! Public API of `pipeline`: runs, trends, reports, alerts and work requests of small fleets.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod alerts;
mod bookkeeping;
mod distributed;
mod fleet;
#[path = "../../../../tests/gate.rs"]
mod gate;
mod quantities;
mod report;
mod trends;
mod work_requests;
