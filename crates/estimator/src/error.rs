//! Why an estimate could not be made.

/// Error of the filter, the model or the gap statistic.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "each field is named for what it holds, with its unit")]
pub enum Error {
    /// A parameter that no actuator, sensor or clock can have.
    #[error("`{name}` is {value}, which no actuator can have")]
    Parameter { name: &'static str, value: f64 },
    /// The prior covariance or `V_d` is negative or not a number.
    #[error("innovation covariance is {s_m2:e} m², which must be positive and finite")]
    InnovationCovariance { s_m2: f64 },
    /// The gain does not settle: the noise levels contradict each other.
    #[error("the gain does not settle within {steps} steps; check the noise levels")]
    Unsettled { steps: usize },
    /// Channels of different length, or a segment outside them.
    #[error("channels hold {dx} positions and {load} loads, and a segment ends at {end}")]
    Lengths { dx: usize, load: usize, end: usize },
    /// Every sample of δX is missing.
    #[error("no sample holds a relative position")]
    NothingMeasured,
    /// S does not move, so one mean of equation 29 is empty.
    #[error("backlash stays at {s_m:e} m over {samples} samples")]
    Constant { samples: usize, s_m: f64 },
}
