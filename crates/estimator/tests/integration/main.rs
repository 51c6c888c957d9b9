//! Public API of `estimator`: reference vectors of independent libraries, flights of independent simulators,
//! and properties of a linear filter.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod contact;
mod flights;
mod parquet_fixture;
mod properties;
mod stream;
mod vectors;
