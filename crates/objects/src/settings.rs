//! How patiently a store is asked.

use std::sync::{PoisonError, RwLock};
use std::time::Duration;

/// Patience with object stores, the same for the whole process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Settings {
    /// A request without a whole answer is given up after this long, and made again.
    pub timeout: Duration,
    /// After this long no request is made again.
    pub give_up: Duration,
}

impl Settings {
    /// What holds where nothing is said.
    pub const DEFAULT: Self = Self { timeout: Duration::from_secs(30), give_up: Duration::from_mins(3) };
}

impl Default for Settings {
    fn default() -> Self {
        Self::DEFAULT
    }
}

static SETTINGS: RwLock<Settings> = RwLock::new(Settings::DEFAULT);

/// Says how stores that are not yet known are asked from now on.
pub fn configure(settings: Settings) {
    *SETTINGS.write().unwrap_or_else(PoisonError::into_inner) = settings;
}

pub(crate) fn settings() -> Settings {
    *SETTINGS.read().unwrap_or_else(PoisonError::into_inner)
}
