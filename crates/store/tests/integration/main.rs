//! Public API of the store.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]
#![allow(clippy::print_stdout, reason = "measurements are printed")]

mod commits;
mod crash_recovery;
mod exports;
mod fixtures;
mod folder;
mod fuzz;
mod maintenance;
mod queries;
mod round_trip;
mod runs;
mod timings;

/// Whether exhaustive tests run in full (`FREEPLAY_TESTS=gate`).
fn is_gate() -> bool {
    std::env::var_os("FREEPLAY_TESTS").is_some_and(|value| value == "gate")
}
