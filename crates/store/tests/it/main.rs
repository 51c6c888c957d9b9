//! The public door of the store.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod commits;
mod exports;
mod folder;
mod made;
mod queries;
mod round_trip;
