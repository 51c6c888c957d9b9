//! reqwest 0.12, for a dependency that asks for 0.13 and uses nothing that differs.

pub use reqwest_0_12::*;
