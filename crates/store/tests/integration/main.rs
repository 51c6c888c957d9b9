//! Public API of the store.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod commits;
mod crash_recovery;
mod fixtures;
mod folder;
mod fuzz;
mod maintenance;
mod queries;
mod round_trip;
mod runs;
