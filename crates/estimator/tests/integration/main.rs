//! The public door of `estimator`: vectors of independent libraries, flights of independent simulators,
//! and laws a linear filter obeys.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod contact;
mod flights;
mod laws;
mod stream;
mod table;
mod vectors;
