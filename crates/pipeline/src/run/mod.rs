//! A run: workers, the single writer, and the run summary.

pub mod distributed;
pub mod event;
mod flight_ownership;
mod memory_budget;
pub mod scheduler;
pub mod summary;
pub mod time_limit;
mod worker_pool;
