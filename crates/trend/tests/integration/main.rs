//! Public API of `trend`.

#![allow(
    clippy::unwrap_used,
    clippy::float_cmp,
    reason = "a test may fail loudly, and exact values are meant"
)]

mod assessment;
mod cost;
mod fleet;
mod forecast;
mod forecasts;
mod fuzz;
mod histories;
mod quantities;
mod random;
mod scale;
mod series;
mod states;
mod steps;
