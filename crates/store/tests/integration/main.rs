//! The public door of the store.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]
#![allow(clippy::print_stdout, reason = "what was measured is for people")]

mod care;
mod commits;
mod exports;
mod folder;
mod kills;
mod made;
mod measure;
mod queries;
mod round_trip;
mod runs;
