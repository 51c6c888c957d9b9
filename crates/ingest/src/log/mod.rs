//! Flight logs: identity, actuators, and their channels in SI on one clock.

mod assemble;
mod channel_reader;
mod flight_log;
pub mod flight_rows;
pub mod identity;
pub mod in_memory;
pub mod normalized;
pub(crate) mod row_partition;
pub(crate) mod row_table;
mod selection;
mod types;

pub use flight_log::Log;
pub use types::{ActuatorChannels, ActuatorColumns, LogFiles};
