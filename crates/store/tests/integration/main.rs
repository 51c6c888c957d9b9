//! Public API of the store.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod commits;
mod fixtures;
mod folder;
mod fuzz;
#[path = "../../../../tests/made_up.rs"]
mod made_up;
mod maintenance;
mod queries;
mod round_trip;
mod runs;
