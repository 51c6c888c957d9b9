//! End-to-end tests of the `freeplay` command: on the sample fleet and a small one, on logs of other machines, and on
//! corrupt logs.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod docs;
mod fuzz;
mod gate;
mod harness;
mod logs;
mod markdown;
mod runs;
mod same_story;
mod table;
mod traces;
