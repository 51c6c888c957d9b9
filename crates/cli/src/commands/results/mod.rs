//! Commands that read results: estimates, trends, forecasts.

pub(crate) mod backtest;
pub(crate) mod diff;
pub(crate) mod explain;
pub(crate) mod query;
pub(crate) mod report;
pub(crate) mod trend;
