//! Scale, offset and unit of a column in the metadata of its Arrow field, as pyarrow and others write them.

use arrow::datatypes::Field;
use smart_default::SmartDefault;

use crate::error::Fault;
use crate::mapping::ChannelMapping;
use crate::mapping::units::{Unit, from_symbol};

/// What a field notes of its column: `unit = raw · scale + offset`.
#[derive(Debug, Clone, Copy, PartialEq, SmartDefault)]
pub(crate) struct FieldMetadata {
    /// By the keys `scale` and `scale_factor` (the latter of the CF conventions 1.11, section 8.1); else 1.
    #[default(1.0)]
    pub(crate) scale: f64,
    /// By the keys `offset` and `add_offset`; else 0.
    pub(crate) offset: f64,
    /// By the keys `unit` and `units`, where it is one that a mapping knows.
    pub(crate) unit: Option<Unit>,
}

impl FieldMetadata {
    pub(crate) fn of(field: &Field) -> Self {
        let text =
            |keys: [&str; 2]| keys.iter().find_map(|key| field.metadata().get(*key)).map(|text| text.trim());
        let number =
            |keys| text(keys).and_then(|text| text.parse().ok()).filter(|number: &f64| number.is_finite());
        Self {
            scale: number(["scale", "scale_factor"]).filter(|scale| *scale != 0.0).unwrap_or(1.0),
            offset: number(["offset", "add_offset"]).unwrap_or(0.0),
            unit: text(["unit", "units"]).and_then(from_symbol),
        }
    }

    /// Scale and offset of the channel: those of the mapping, or those that are noted where it leaves both open.
    pub(crate) fn line(&self, column: &str, map: &ChannelMapping) -> Result<(f64, f64), Fault> {
        let mapped = Self { scale: map.scale, offset: map.offset, unit: Some(map.unit) };
        let is_open = |line: &Self| Self { unit: None, ..*line } == Self::default();
        let known =
            if is_open(&mapped) || is_open(self) { Self { unit: mapped.unit, ..*self } } else { mapped };
        self.check(column, &known)?;
        let of = if is_open(self) { &mapped } else { self };
        Ok((of.scale, of.offset))
    }

    /// Checks that scale, offset and unit in the metadata agree with those of the mapping.
    pub(crate) fn check(&self, column: &str, known: &Self) -> Result<(), Fault> {
        let differs = |noted: f64, known: f64| {
            ((noted - known).abs() > 1e-9 * known.abs()).then(|| (noted.to_string(), known.to_string()))
        };
        let units = self.unit.zip(known.unit).filter(|(noted, known)| noted != known);
        let found = [
            ("scale", differs(self.scale, known.scale)),
            ("offset", differs(self.offset, known.offset)),
            ("unit", units.map(|(noted, known)| (noted.as_str().to_owned(), known.as_str().to_owned()))),
        ];
        match found.into_iter().find_map(|(key, differs)| Some((key, differs?))) {
            None => Ok(()),
            Some((key, (noted, known))) => {
                let message = format!(
                    "the file notes {key} {noted} for column `{column}`, and the mapping has {known}"
                );
                let hint = format!(
                    "set `{key}` of the channel to {noted}; if the file is wrong, set its `ignore_metadata = true`"
                );
                let fault = Fault::new("metadata_contradicts", message, hint).column(column);
                Err(fault
                    .found(format!("`{key}` = {noted} in the Arrow metadata"))
                    .expected(format!("`{key}` = {known}")))
            }
        }
    }
}
