//! Contract types shared by every crate: identifiers, installations, the gap record and the diagnostic.
//!
//! This crate holds no mathematics and opens no file. Identifiers are distinct types, so a tail number cannot
//! be passed where a serial number is expected.

pub mod diagnostic;
pub mod flight;
pub mod gap_record;
pub mod ids;
pub mod installation;
mod sample_time;
pub mod sanitize;

pub use diagnostic::Diagnostic;
pub use flight::Flight;
pub use gap_record::{GapEstimate, GapRecord, Provenance, RecordKey, Status};
pub use ids::{FlightId, PartNumber, Position, SerialNumber, TailNumber};
pub use installation::{Installation, Installations};
pub use sample_time::sample_time_s;
