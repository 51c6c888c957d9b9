//! Result types of an assessment.

use strum::{Display, IntoStaticStr};

/// Number of estimates below which no wear law is fitted.
pub(crate) const MIN_ESTIMATES: usize = 8;

/// What a crossing was computed by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, IntoStaticStr)]
#[strum(serialize_all = "snake_case")]
pub enum ForecastMethod {
    /// The records are at the limit: nothing is left to forecast.
    Measured,
    /// Wear laws weighted by the part number's fleet.
    Fleet,
    /// Wear laws weighted by the unit's own records.
    SingleUnit,
    /// The line through the last records: no wear law explains them.
    Line,
}

/// Growth in metres per flight hour, with its 90 % interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rate {
    /// 5 % bound.
    pub p05_m_per_hour: f64,
    /// Median.
    pub m_per_hour: f64,
    /// 95 % bound.
    pub p95_m_per_hour: f64,
}

/// Flight hours from the end of the last flight to the first with a gap at the act limit: zero when
/// already over, nothing beyond the horizon.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossing {
    /// Not before.
    pub p05_hours: Option<f64>,
    /// Likely.
    pub p50_hours: Option<f64>,
    /// Not after.
    pub p95_hours: Option<f64>,
}

/// Present utilisation of a unit, from its last ninety days of flights or its last busier weeks.
///
/// Dates, forecasts, removals and probabilities all convert flight hours by this one figure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Utilization {
    /// Flight hours per day.
    pub hours_per_day: f64,
    /// Standard error of the flight hours per day: flights arrive at random, so it falls with the square root of their
    /// number.
    pub hours_per_day_se: f64,
    /// Flights per day, those without a row included as far as the hour meter or the flights table shows them.
    pub flights_per_day: f64,
    /// Flight hours per flight.
    pub hours_per_flight: f64,
}

/// Whether a unit wears.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, IntoStaticStr)]
#[strum(serialize_all = "snake_case")]
pub enum WearStatus {
    /// It has grown by 2 % of the limit or more with a probability above 95 %.
    Wearing,
    /// It has not grown that much, more likely than not.
    Steady,
    /// Too little is known, or growth is likely and not certain.
    #[default]
    Unknown,
}

/// A change that wear does not make.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChangePoint {
    /// The first flight after it, microseconds since 1970 UTC.
    pub departure_us: i64,
    /// What it is.
    pub kind: ChangePointKind,
    /// Its size, metres; zero for an onset.
    pub step_m: f64,
    /// Standard error of its size, metres; zero for an onset.
    pub se_m: f64,
    /// Probability that it is one: of a step that it has the given sign, of an onset that
    /// wear began at all; one for a recorded event.
    pub certainty: f64,
}

/// Kinds of change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, IntoStaticStr, Display)]
#[strum(serialize_all = "snake_case")]
pub enum ChangePointKind {
    /// The measurement moved: re-rigging, another reference. The wear did not.
    Step,
    /// The gap fell to near a new unit's: re-shimmed, overhauled or replaced.
    Reset,
    /// Wear began, or sped up.
    Onset,
    /// Recorded: an installation or a maintenance entry; without a step where the gap shows none.
    Recorded,
    /// Records above the limit, confirmed by a second one.
    Exceedance,
    /// One record above the limit that the next ones did not confirm.
    #[strum(serialize = "exceedance_not_confirmed")]
    UnconfirmedExceedance,
}

impl ChangePointKind {
    /// A change of the gap that no record explains.
    pub fn is_unexplained(self) -> bool {
        matches!(self, Self::Step | Self::Reset | Self::Onset)
    }
}
