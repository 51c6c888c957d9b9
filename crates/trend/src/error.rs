//! Errors of histories and settings.

/// Why a series, a statistic or a trend could not be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "each field is named for what it holds, with its unit")]
pub enum Error {
    /// A number of an observation is not finite, or negative where that has no meaning.
    #[error(
        "{what} of the flight departing at {departure_us} µs is {value}: leave it out when it is not known"
    )]
    Observation { what: &'static str, departure_us: i64, value: f64 },
    /// A limit or horizon that must be positive and plausible is not.
    #[error("setting {name} is {value}, which must be positive and of a plausible size")]
    Setting { name: &'static str, value: f64 },
    /// The watch limit does not lie below the act limit.
    #[error("watch limit is {watch_m:e} m and act limit {limit_m:e} m: watch must come first")]
    LimitOrder { watch_m: f64, limit_m: f64 },
}
