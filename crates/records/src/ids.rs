//! Identifier types: distinct types for text identifiers, so that they cannot be interchanged.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Maximum length of an identifier, bytes: every record, file name and message contains it.
const ID_BYTES: usize = 256;

/// Error of a text that is blank or too long for an identifier.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("a {0}")]
pub struct IdError(String);

macro_rules! identifiers {
    ($($(#[$doc:meta])* $name:ident = $what:literal,)*) => {$(
        $(#[$doc])*
        #[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
        #[serde(try_from = "String")]
        pub struct $name(Box<str>);

        impl $name {
            /// Creates the identifier from a text of 1 to 256 bytes; white space around the text is removed.
            ///
            /// # Errors
            /// [`IdError`] when the text is blank or longer than 256 bytes.
            pub fn new(text: impl AsRef<str>) -> Result<Self, IdError> {
                let text = text.as_ref().trim();
                match text.len() {
                    0 => Err(IdError(concat!($what, " must not be empty").to_owned())),
                    1..=ID_BYTES => Ok(Self(text.into())),
                    bytes => Err(IdError(format!(
                        concat!($what, " of {} bytes is longer than {}"),
                        bytes, ID_BYTES
                    ))),
                }
            }

            /// The identifier as logged.
            pub fn as_str(&self) -> &str {
                &self.0
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.pad(&self.0)
            }
        }

        impl TryFrom<String> for $name {
            type Error = IdError;
            fn try_from(text: String) -> Result<Self, IdError> {
                Self::new(text)
            }
        }
    )*};
}

identifiers! {
    /// Aircraft: the tail on which an actuator is installed.
    TailNumber = "tail number",
    /// Position on the aircraft, e.g. `aileron_left`. Logs identify actuators by position.
    Position = "position",
    /// Part number: the design, which determines stiffness, damping and mass.
    PartNumber = "part number",
    /// Serial number: the unit that wears and has a trend; unique only together with its part number.
    SerialNumber = "serial number",
    /// One flight of one tail.
    FlightId = "flight id",
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_trimmed_and_neither_empty_nor_long() {
        assert_eq!(TailNumber::new(" N412FP\n").unwrap().as_str(), "N412FP");
        assert_eq!(SerialNumber::new("  ").unwrap_err().to_string(), "a serial number must not be empty");
        assert!(FlightId::new("F".repeat(256)).is_ok());
        let error = FlightId::new("F".repeat(257)).unwrap_err();
        assert_eq!(error.to_string(), "a flight id of 257 bytes is longer than 256");
        assert!(serde_json::from_str::<Position>("\"\"").is_err());
    }
}
