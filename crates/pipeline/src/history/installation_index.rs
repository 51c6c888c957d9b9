//! The installations table, unit by unit.

use std::collections::HashMap;

use jiff::Timestamp;
use records::{Installation, Installations};

use crate::history::histories::UnitKey;

/// Installations by unit, earliest first.
pub(crate) struct InstallationIndex<'a>(HashMap<&'a str, Vec<&'a Installation>>);

impl<'a> InstallationIndex<'a> {
    pub(crate) fn new(installations: &'a Installations) -> Self {
        let mut by_serial: HashMap<&str, Vec<&Installation>> = HashMap::new();
        for installation in installations.iter() {
            by_serial.entry(installation.serial_number.as_str()).or_default().push(installation);
        }
        by_serial
            .values_mut()
            .for_each(|installations| installations.sort_by_key(|installation| installation.installed_utc));
        Self(by_serial)
    }

    /// The last installation of a unit that is in none on a date; nothing of a unit without installations before it.
    pub(crate) fn removal(&self, name: &UnitKey, as_of: Timestamp) -> Option<&'a Installation> {
        let mut before = self.of(name);
        before.retain(|installation| installation.installed_utc <= as_of);
        let is_open = |i: &&Installation| i.removed_utc.is_none_or(|removed| removed > as_of);
        if before.iter().any(is_open) { None } else { before.into_iter().max_by_key(|i| i.removed_utc) }
    }

    /// A unit's installations; where its part number is unknown, by its serial number.
    pub(crate) fn of(&self, (part, serial): &UnitKey) -> Vec<&'a Installation> {
        let is_of = |installation: &&&Installation| {
            part.as_deref().is_none_or(|part| installation.part_number.as_str() == part)
        };
        self.0.get(serial.as_str()).into_iter().flatten().filter(is_of).copied().collect()
    }
}
