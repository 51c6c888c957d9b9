//! Names that are all text, kept apart by type: mixing them would compile, run and ruin a trend.

use std::fmt;

use serde::{Deserialize, Serialize};

/// A name was empty or blank.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("a {what} must not be empty")]
pub struct EmptyName {
    /// Which kind of name it was, e.g. `tail number`.
    pub what: &'static str,
}

macro_rules! name {
    ($(#[$doc:meta])* $name:ident, $what:literal) => {
        $(#[$doc])*
        #[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
        #[serde(try_from = "String", into = "String")]
        pub struct $name(String);

        impl $name {
            /// Takes the text without the white space around it.
            ///
            /// # Errors
            /// [`EmptyName`] when nothing is left.
            pub fn new(text: impl AsRef<str>) -> Result<Self, EmptyName> {
                let text = text.as_ref().trim();
                if text.is_empty() {
                    return Err(EmptyName { what: $what });
                }
                Ok(Self(text.to_owned()))
            }

            /// The name as it was logged.
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
            type Error = EmptyName;
            fn try_from(text: String) -> Result<Self, EmptyName> {
                Self::new(text)
            }
        }

        impl From<$name> for String {
            fn from(name: $name) -> Self {
                name.0
            }
        }
    };
}

name!(
    /// The aircraft: where an actuator flies today.
    TailNumber,
    "tail number"
);
name!(
    /// The place on the aircraft, e.g. `aileron_left`: what a log knows.
    Position,
    "position"
);
name!(
    /// The design: whose stiffness, damping and mass we use.
    PartNumber,
    "part number"
);
name!(
    /// The unit that wears and the owner of a trend; unique only with its part number.
    SerialNumber,
    "serial number"
);
name!(
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
