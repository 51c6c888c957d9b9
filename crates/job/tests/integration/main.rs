//! The public door of `job`: configurations good and bad, and one flight's way to its records.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod config;
mod fixtures;
mod method;
mod part_identification;
mod reference;
mod unusual_parts;
