//! Time bases of logs: timestamps, their repair, and bringing channels to a common clock.

pub(crate) mod clock;
#[cfg(test)]
mod fuzz;
pub(crate) mod resample;
pub(crate) mod slow_channel;
pub(crate) mod timestamps;
pub(crate) mod zero_order_hold;
