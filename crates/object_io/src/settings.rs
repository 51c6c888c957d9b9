//! Timeouts of object-store requests.

use std::sync::{PoisonError, RwLock};
use std::time::Duration;

/// Timeouts of object-store requests, process-wide.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Settings {
    /// Time after which an incomplete request is aborted and repeated.
    pub timeout: Duration,
    /// Time after which a request is no longer repeated.
    pub give_up: Duration,
}

impl Settings {
    /// Default timeouts.
    pub const DEFAULT: Self = Self { timeout: Duration::from_secs(30), give_up: Duration::from_mins(3) };
}

static SETTINGS: RwLock<Settings> = RwLock::new(Settings::DEFAULT);

/// Sets the timeouts of clients that are created from now on.
pub fn configure(settings: Settings) {
    *SETTINGS.write().unwrap_or_else(PoisonError::into_inner) = settings;
}

#[cfg(feature = "cloud")]
pub(crate) fn settings() -> Settings {
    *SETTINGS.read().unwrap_or_else(PoisonError::into_inner)
}
