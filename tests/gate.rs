//! The switch between seeded samples and exhaustive tests.

/// Whether exhaustive tests run in full (`FREEPLAY_TESTS=gate`) instead of a seeded sample of their cases.
pub(crate) fn is_gate() -> bool {
    std::env::var_os("FREEPLAY_TESTS").is_some_and(|value| value == "gate")
}
