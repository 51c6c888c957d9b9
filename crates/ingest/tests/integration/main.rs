//! Integration tests of the public API of `ingest`: files in, channels or an error out.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod clocks;
mod foreign_writers;
mod fuzz;
mod layouts;
mod sample_filters;
mod simulated_channels;
mod turns;
