//! Why nothing could be simulated.

/// Why a specification cannot be flown.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "each field is named for what it holds; the key has the unit")]
pub enum Error {
    /// A number lies outside what the physics or the generator can use.
    #[error("`{key}` is {value}, which must be {must}")]
    Value { key: String, value: f64, must: String },
    /// The numbers of a specification cannot be listed.
    #[error("the specification cannot be checked: {problem}")]
    Unwritable { problem: String },
    /// A date is not written as year, month and day.
    #[error("`start_date` is \"{text}\", which must be a date such as \"2026-03-02\"")]
    Date { text: String },
    /// A list that must name something is empty, or has an empty name.
    #[error("`{key}` is empty or has an empty name; name at least one")]
    Empty { key: &'static str },
    /// A name is used that is not declared.
    #[error("{place} names {kind} \"{name}\", which is not declared; declared are: {known}")]
    Unknown { place: String, kind: &'static str, name: String, known: String },
    /// A name that must be unique is given twice.
    #[error("{kind} \"{name}\" is declared twice; keep one of them")]
    Twice { kind: &'static str, name: String },
    /// Two places that exchange units hold different part numbers.
    #[error("a swap at flight {flight} exchanges part {from} with part {to}; only like parts fit")]
    Misfit { flight: usize, from: String, to: String },
    /// Flights follow each other faster than they last.
    #[error(
        "a flight of {flight_hours} h does not fit into {days} days between flights; \
         raise `days_between_flights` or lower `flight_hours`"
    )]
    Crowded { flight_hours: f64, days: f64 },
}
