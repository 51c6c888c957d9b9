//! Public API of `pipeline`: runs, trends, reports, alerts and work requests of small fleets.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod alerts;
mod bookkeeping;
mod distributed;
#[path = "../../../../tests/gate.rs"]
mod gate;
mod quantities;
mod report;
mod scatter;
mod trends;
mod work_requests;
