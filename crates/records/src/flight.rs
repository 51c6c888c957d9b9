//! Flight: tail, departure and duration.

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use crate::ids::{FlightId, TailNumber};

/// Identity of a flight, and its hours if known.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Flight {
    /// The aircraft.
    pub tail_number: TailNumber,
    /// The operator's flight identifier; unique within the tail.
    pub flight_id: FlightId,
    /// Departure, UTC.
    pub departure_utc: Timestamp,
    /// Duration of this flight, hours.
    pub flight_hours: Option<f64>,
    /// The tail's total hours after this flight.
    pub tail_hours_end: Option<f64>,
}
