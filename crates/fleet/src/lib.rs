//! The names of things: who flew, what was installed where, and the record one flight leaves behind.
//!
//! This crate holds no mathematics and touches no file. Everything else in the house speaks its
//! words, so a tail number can never be handed over where a serial number is meant.

pub mod complaint;
pub mod flight;
pub mod ids;
pub mod installation;
pub mod record;

pub use complaint::Complaint;
pub use flight::Flight;
pub use ids::{FlightId, PartNumber, Position, SerialNumber, TailNumber};
pub use installation::{Installation, Installations};
pub use record::{Estimate, GapRecord, Provenance, Status};
