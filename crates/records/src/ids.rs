//! Identifier types: distinct types for text identifiers, so that they cannot be interchanged.

use std::fmt;

use serde::{Deserialize, Serialize};

/// An identifier was empty or blank.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("a {what} must not be empty")]
pub struct EmptyIdError {
    /// Kind of the identifier, e.g. `tail number`.
    pub what: &'static str,
}

macro_rules! identifier {
    ($(#[$doc:meta])* $name:ident, $what:literal) => {
        $(#[$doc])*
        #[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
        #[serde(try_from = "String", into = "String")]
        pub struct $name(Box<str>);

        impl $name {
            /// Creates the identifier from text; surrounding white space is removed.
            ///
            /// # Errors
            /// [`EmptyIdError`] when the text is blank.
            pub fn new(text: impl AsRef<str>) -> Result<Self, EmptyIdError> {
                let text = text.as_ref().trim();
                if text.is_empty() {
                    return Err(EmptyIdError { what: $what });
                }
                Ok(Self(text.into()))
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

        impl AsRef<str> for $name {
            fn as_ref(&self) -> &str {
                &self.0
            }
        }

        impl TryFrom<String> for $name {
            type Error = EmptyIdError;
            fn try_from(text: String) -> Result<Self, EmptyIdError> {
                Self::new(text)
            }
        }

        impl From<$name> for String {
            fn from(name: $name) -> Self {
                name.0.into_string()
            }
        }
    };
}

identifier!(
    /// Aircraft: the tail on which an actuator is installed.
    TailNumber,
    "tail number"
);
identifier!(
    /// Position on the aircraft, e.g. `aileron_left`. Logs identify actuators by position.
    Position,
    "position"
);
identifier!(
    /// Part number: the design, which determines stiffness, damping and mass.
    PartNumber,
    "part number"
);
identifier!(
    /// Serial number: the unit that wears and has a trend; unique only together with its part number.
    SerialNumber,
    "serial number"
);
identifier!(
    /// One flight of one tail.
    FlightId,
    "flight id"
);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_trimmed_and_never_empty() {
        assert_eq!(TailNumber::new(" N412FP\n").unwrap().as_str(), "N412FP");
        assert_eq!(SerialNumber::new("  ").unwrap_err().to_string(), "a serial number must not be empty");
    }

    #[test]
    fn an_empty_name_is_refused_when_read_from_json_too() {
        assert!(serde_json::from_str::<Position>("\"\"").is_err());
    }
}
