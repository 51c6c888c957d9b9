//! Trend of the gap of one unit: level, wear rate, change points and remaining life.
//!
//! The crate works on usage and gaps only; it reads no file and no clock. The date of an assessment is an argument,
//! and data after that date are ignored.
//!
//! A [`Series`] accumulates a unit's usage, a [`FleetPrior`] is learned from the units of a part number, and
//! [`assess()`] fits a bank of wear curves to the series under that prior.
//!
//! ```
//! use trend::{FleetPrior, Observation, SerialExecutor, Series, Settings, State, assess};
//!
//! // One flight of 1.5 h a day; the gap grows from 30 µm by 10 nm per flight, with a scatter of 1 µm.
//! let day_us = |day: i64| day * 86_400_000_000;
//! let flight = |day: i64| Observation {
//!     departure_us: day_us(day),
//!     flight_hours: Some(1.5),
//!     gap_m: Some(30e-6 + 1e-8 * day as f64 + 1e-6 * (day as f64).sin()),
//!     gap_se_m: Some(1e-6),
//!     ..Observation::default()
//! };
//! let series = Series::new((0..500).map(flight))?;
//!
//! let settings = Settings::for_limit(100e-6);
//! let prior = FleetPrior::learn([&series], day_us(500), settings.limit_m, None, &SerialExecutor);
//! let assessment = assess(&series, day_us(500), &settings, Some(&prior))?;
//! let level = assessment.level.ok_or("no record")?;
//! assert!((level.gap_m - 35e-6).abs() < 1e-6);
//! assert_eq!(assessment.state, State::Normal);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Limitations
//!
//! - A wear law far from every curve of the bank: a change of rate that no unit has shown yet is not learned.
//! - Life that ends other than by growth to the limit, or growth that depends on what no usage axis measures.
//! - A measurement whose bias drifts for years is taken for wear. A yearly seasonal component is not.
//! - Maintenance that lowers the gap by less than about 5 % of the limit: no step is found, and wear is underestimated.
//! - A fleet of fewer than about thirty units: the prior is then mostly the assumed one.

mod assess;
mod data;
mod error;
mod executor;
mod forecast;
mod inference;
mod learn;
mod math;
mod measured;
mod prior;
pub mod quantity;
mod settings;
mod statement;
mod tail_wide;
mod unit_fit;
mod wear;

pub use assess::assess;
pub use data::series::{MaintenanceEvent, Observation, RowFaults, Series, UsageSource};
pub use error::Error;
pub use executor::{Executor, SerialExecutor};
pub use forecast::{Forecast, Interval, forecast};
pub use measured::level::Level;
pub use measured::record::Record;
pub use prior::{FleetPrior, UsageAxis};
pub use settings::Settings;
pub use statement::assessment::Assessment;
pub use statement::state::{Reason, State};
pub use statement::types::{
    ChangePoint, ChangePointKind, Crossing, ForecastMethod, Rate, Utilization, WearStatus,
};
pub use tail_wide::{TailWideStep, UnitOnTail, tail_wide_steps};
pub use wear::bank::WearClass;
