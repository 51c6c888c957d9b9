//! A run: discovery, plan, workers, the single writer, and the run summary.

pub mod discover;
mod discover_remote;
pub mod distributed;
pub mod event;
pub mod file_stat;
mod flight_ownership;
mod memory_budget;
pub mod plan;
pub mod scheduler;
pub mod summary;
mod worker_pool;
