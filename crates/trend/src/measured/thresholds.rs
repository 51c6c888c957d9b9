//! Thresholds of the measured state.

/// A rise of the level that counts as a jump, a share of the limit, and in standard errors.
pub(crate) const JUMP_SHARE: f64 = 0.15;
pub(crate) const JUMP_ERRORS: f64 = 6.0;

/// Records for which a jump is reported, however long they take.
pub(crate) const JUMP_RECORDS: usize = 12;

/// A level that was at the watch limit stays there until it is this share of it, or for this many records.
pub(crate) const HYSTERESIS: f64 = 0.97;
pub(crate) const RECALLED: usize = 24;
