//! The public door of `trend`.

#![allow(
    clippy::unwrap_used,
    clippy::float_cmp,
    reason = "a test may fail loudly, and exact values are meant"
)]

mod classic;
mod degenerate;
mod fleet;
mod kept;
mod outlook;
mod random;
mod series;
mod statement;
