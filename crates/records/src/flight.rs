//! Flight: tail, departure and duration.

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use crate::ids::{FlightId, TailNumber};
use crate::stored_row;

stored_row! {
    /// Identity of a flight, and its hours if known.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    pub struct Flight {
        /// The aircraft.
        pub tail_number: TailNumber,
        /// The operator's flight identifier, unique within the tail.
        pub flight_id: FlightId,
        /// Departure.
        pub departure_utc: Timestamp,
        /// Length of the flight, hours.
        pub flight_hours: Option<f64>,
        /// The tail's total hours after the flight.
        pub tail_hours_end: Option<f64>,
    }
}
