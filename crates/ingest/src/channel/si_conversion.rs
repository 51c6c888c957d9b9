//! Conversion of raw readings to SI at the screw axis: a linear map.

use multiversion::multiversion;

use crate::error::Fault;
use crate::mapping::ChannelMapping;
use crate::mapping::units::{Dimension, Unit};

/// Geometry that converts a part's angles and torques to the screw axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Geometry {
    /// A part that pushes: x = θ·lead/2π (the paper's X₁ = θ·r/2π).
    Linear {
        /// Metres for a turn; needed only when a channel is an angle or a torque.
        lead_m_per_rev: Option<f64>,
    },
    /// A part that only turns: x = r·θ, F = T/r.
    Rotary {
        /// The radius at which the gap is stated, m.
        reference_radius_m: f64,
    },
}

impl Geometry {
    /// Metres at the screw axis per radian, where it is known: r/2π of X₁ = θ·r/2π (the paper, section 2), or the radius of
    /// a rotary part.
    pub(crate) fn metres_per_radian(self) -> Option<f64> {
        match self {
            Self::Linear { lead_m_per_rev } => lead_m_per_rev.map(|lead| lead / std::f64::consts::TAU),
            Self::Rotary { reference_radius_m } => Some(reference_radius_m),
        }
    }
}

/// No position in m, load in N or temperature reaches this: larger ones are fill values, such as the 9.97e36 of netCDF.
const LARGEST_READING: f64 = 1e12;

/// The value of a reading; missing (NaN) where it is infinite or a fill value.
#[inline]
pub(crate) fn reading(value: f64) -> f64 {
    if value.abs() < LARGEST_READING { value } else { f64::NAN }
}

/// One straight line from raw to SI.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SiConversion {
    scale: f64,
    offset: f64,
    factor: f64,
    shift: f64,
}

impl SiConversion {
    /// SI value of a raw reading; NaN where it is none.
    #[inline]
    pub(crate) fn apply(self, raw: f64) -> f64 {
        reading((raw * self.scale + self.offset) * self.factor + self.shift)
    }

    /// The same, of raw readings on another line: `unit = raw · scale + offset`.
    pub(crate) fn with_line(self, scale: f64, offset: f64) -> Self {
        Self { scale, offset, ..self }
    }

    /// Length of a stretch of raw readings, m.
    pub(crate) fn length(self, raw: f64) -> f64 {
        (raw * self.scale * self.factor).abs()
    }
}

/// Converts raw readings in place. Vectors change no number: sums and products are not fused.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq", "x86_64+avx2"))]
pub(crate) fn apply_to_all(line: SiConversion, values: &mut [f64]) {
    for value in values {
        *value = line.apply(*value);
    }
}

/// The line of a channel on a part.
pub(crate) fn to_si(column: &str, map: &ChannelMapping, geometry: Geometry) -> Result<SiConversion, Fault> {
    let (unit_factor, shift) = map.unit.to_si();
    let lever = lever(map.unit, geometry).map_err(|wanted| {
        let unit = map.unit.as_str();
        let message = format!(
            "column `{column}` is logged in {unit}, which cannot be converted to screw travel for this part"
        );
        let hint = match geometry {
            Geometry::Rotary { .. } => {
                "correct the channel's `unit`, or remove `kind = \"rotary\"` of the part"
            }
            Geometry::Linear { .. } => {
                "give the part `lead_m_per_rev`, or `kind = \"rotary\"` with `reference_radius_m`"
            }
        };
        Fault::new("unit_for_part", message, hint).column(column).expected(wanted)
    })?;
    let gear = match map.unit.dimension() {
        Dimension::Torque => map.gear_ratio,
        Dimension::Angle => map.gear_ratio.recip(),
        _ => 1.0,
    };
    Ok(SiConversion {
        scale: map.scale,
        offset: map.offset,
        factor: f64::from(map.sign) * unit_factor * lever * gear,
        shift,
    })
}

/// Factor that converts the unit's dimension to the screw axis; the error names the units that are needed instead.
fn lever(unit: Unit, geometry: Geometry) -> Result<f64, &'static str> {
    let rotary = matches!(geometry, Geometry::Rotary { .. });
    let metres_per_radian = geometry.metres_per_radian();
    match unit.dimension() {
        Dimension::Length if rotary => Err("an angle (deg, rad, rev): the part only turns"),
        Dimension::Force if rotary => Err("a torque (N.m, lbf.in, lbf.ft): the part only turns"),
        Dimension::Length | Dimension::Force | Dimension::Temperature => Ok(1.0),
        Dimension::Angle => metres_per_radian.ok_or("a length, or the part's `lead_m_per_rev`"),
        Dimension::Torque => {
            metres_per_radian.map(f64::recip).ok_or("a force, or the part's `lead_m_per_rev`")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fill_value_is_missing_and_a_length_on_a_part_that_only_turns_is_refused() {
        let of = |geometry| to_si("x", &ChannelMapping::default(), geometry);
        let metres = of(Geometry::Linear { lead_m_per_rev: None }).unwrap();
        assert!([f64::INFINITY, 9.969_21e36, -1e30].iter().all(|fill| metres.apply(*fill).is_nan()));
        let fault = of(Geometry::Rotary { reference_radius_m: 0.1 }).unwrap_err();
        assert!(fault.0.code == "unit_for_part" && fault.0.message.contains("logged in m,"), "{fault:?}");
    }
}
