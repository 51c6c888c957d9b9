//! Assessments of all units of a fleet, their priors, and backtests.

pub mod assess;
pub mod backtest;
pub mod changes;
mod limits;
mod priors;
mod tail_wide_steps;
pub(crate) mod trend_row;
