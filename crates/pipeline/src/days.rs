//! Time between instants, as people count it.

use jiff::Timestamp;

/// Days from one instant to another.
pub(crate) fn days(from: Timestamp, to: Timestamp) -> f64 {
    to.duration_since(from).as_secs_f64() / 86_400.0
}
