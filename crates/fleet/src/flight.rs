//! A flight: which tail, when, how long.

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use crate::ids::{FlightId, TailNumber};

/// The identity of a flight, and the hours it added where they are known.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Flight {
    /// The aircraft.
    pub tail_number: TailNumber,
    /// The operator's name for the flight; unique within the tail.
    pub flight_id: FlightId,
    /// Departure, UTC.
    pub departure_utc: Timestamp,
    /// Length of this flight, hours.
    pub flight_hours: Option<f64>,
    /// The tail's total hours after this flight.
    pub tail_hours_end: Option<f64>,
}
