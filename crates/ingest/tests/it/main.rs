//! The public door of `ingest`: files in, channels or a reason out.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod clocks;
mod layouts;
mod lying;
mod selected;
mod writers;
