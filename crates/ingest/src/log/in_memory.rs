//! In-memory channels: SI, at the screw axis, one row for each timestamp.

use std::path::Path;

use records::Position;

use crate::channel::si_conversion::reading;
use crate::error::{Error, Fault, bad_table, channel_empty};
use crate::log::assemble::assemble;
use crate::log::selection::SampleSelection;
use crate::log::types::ActuatorChannels;
use crate::mapping::{ChannelMapping, Channels, ClockMapping};
use crate::time::clock::{self, TimeOrigin, Timestamps};

/// Stamps and readings of one actuator, of one length; NaN where a reading is missing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChannelArrays<'a> {
    /// Time, s, from any zero.
    pub time_s: &'a [f64],
    /// Motor position X₁ brought to the screw axis, m.
    pub motor_m: &'a [f64],
    /// Screw position X₂, m.
    pub screw_m: &'a [f64],
    /// Load, N.
    pub load_n: &'a [f64],
}

impl ChannelArrays<'_> {
    /// The channels as a log of the same numbers gives them: on one clock, with statistics and δX.
    ///
    /// # Errors
    /// When the arrays differ in length, the stamps are no clock, or a channel holds no number.
    pub fn to_channels(&self, position: Position) -> Result<ActuatorChannels, Error> {
        let fail = |fault: Fault| fault.in_file(Path::new("arrays"));
        let named = [("motor_m", self.motor_m), ("screw_m", self.screw_m), ("load_n", self.load_n)];
        for (column, values) in named {
            let (rows, wanted) = (values.len(), self.time_s.len());
            if rows != wanted {
                let detail = format!("{rows} values for {wanted} timestamps");
                return Err(fail(bad_table(detail).column(column)));
            }
            if !values.iter().any(|value| value.is_finite()) {
                return Err(fail(channel_empty(column, rows)));
            }
        }
        let first_s = self.time_s.iter().copied().find(|s| s.is_finite()).unwrap_or(0.0);
        let seconds = self.time_s.iter().map(|s| s - first_s).collect();
        let mut stamps =
            Timestamps { column: "time_s".into(), seconds, origin: TimeOrigin::Counted(first_s) };
        let base = clock::build_time_base(&mut stamps, &ClockMapping::default());
        let base = base.map_err(|fault| fail(fault.column(&stamps.column)))?;
        let read = named.map(|(_, values)| base.keep(values.iter().copied().map(reading).collect()).into());
        let channels = Channels { screw_position: Some(ChannelMapping::default()), ..Channels::default() };
        Ok(assemble(position, read, &channels, SampleSelection::whole(&base), &base, None))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arrays<'a>(time_s: &'a [f64], values: &'a [f64]) -> ChannelArrays<'a> {
        ChannelArrays { time_s, motor_m: values, screw_m: values, load_n: values }
    }

    /// By hand: rows 2 and 1 change places, the infinite reading is missing, and δX of equal positions is zero.
    #[test]
    fn rows_come_in_order_of_time_and_an_infinite_reading_is_missing() {
        let found = arrays(&[5.0, 5.2, 5.1, 5.3], &[1.0, 3.0, 2.0, f64::INFINITY]);
        let found = found.to_channels(Position::new("rudder").unwrap()).unwrap();
        assert_eq!(found.motor_m[..3], [1.0, 2.0, 3.0]);
        assert!(found.motor_m[3].is_nan() && (found.missing_share - 0.25).abs() < 1e-15);
        assert_eq!(found.dx_m[..3], [0.0; 3]);
        assert!((found.step_s - 0.1).abs() < 1e-9);
    }

    #[test]
    fn arrays_of_two_lengths_are_refused_by_name() {
        let short = ChannelArrays { load_n: &[1.0], ..arrays(&[0.0, 0.1], &[1.0, 2.0]) };
        let diagnostic = short.to_channels(Position::new("rudder").unwrap()).unwrap_err().diagnostic();
        assert!(diagnostic.to_string().contains("load_n"), "{diagnostic}");
    }
}
