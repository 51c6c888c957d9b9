//! Public API of `job`: configurations good and bad, and one flight's way to its records.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod config;
mod estimates;
mod reference;
