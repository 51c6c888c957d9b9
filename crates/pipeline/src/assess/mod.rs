//! Assessments of all units of a fleet: trends of the gap, other quantities, priors, and backtests.

pub mod backtest;
pub mod changes;
mod limits;
mod priors;
pub mod quantities;
mod tail_wide_steps;
mod trend_row;
pub mod trends;
