//! The simulator through its public door: flights as specified, and books that must balance.
#![allow(clippy::unwrap_used, reason = "helpers of tests, too, may fail loudly")]
#![allow(clippy::float_cmp, reason = "what is compared with == is exact by construction")]

mod fleet;
mod flight;
