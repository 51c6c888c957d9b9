//! Contract types shared by every crate: identifiers, installations, row types with their Arrow columns, diagnostics.
//!
//! This crate holds no mathematics and opens no file. Identifiers are distinct types, so a tail number cannot
//! be passed where a serial number is expected.

mod alert_record;
pub mod assessment;
mod diagnostic;
mod gap_record;
pub mod ids;
pub mod installation;
mod log_record;
pub mod row_schema;
mod run_record;
pub mod sanitize;
pub mod time;
pub mod uncertainty;
mod work_request;

pub use alert_record::{AlertRecord, AlertStatus};
pub use assessment::action::Action;
pub use assessment::quantity_row::{
    ChangeScope, Quantity, QuantityChange, QuantityRow, QuantityStep, significant,
};
pub use assessment::report_rows;
pub use assessment::trend_row::{ChangePoint, TrendRow};
pub use assessment::unit_state::UnitState;
pub use diagnostic::Diagnostic;
pub use gap_record::{Flight, GapEstimate, GapRecord, Provenance, RecordKey, Status};
pub use ids::{FlightId, PartNumber, Position, SerialNumber, TailNumber};
pub use installation::{Alias, Installation, Installations};
pub use log_record::{LogOutcome, LogRecord};
pub use run_record::RunRecord;
pub use time::sample_time_s;
pub use work_request::{WorkEvent, WorkEventKind, WorkRequest};
