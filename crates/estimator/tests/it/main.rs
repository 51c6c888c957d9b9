//! The public door of `estimator`: vectors of independent libraries, and laws a linear filter obeys.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod laws;
mod vectors;
