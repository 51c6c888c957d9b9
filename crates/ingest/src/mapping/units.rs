//! Units, to SI, once.
//!
//! Factors are exact by definition: inch 0.0254 m, pound 0.453 592 37 kg, standard gravity
//! 9.806 65 m/s² (NIST SP 811, appendix B).

use std::f64::consts::{PI, TAU};

use schemars::JsonSchema;
use serde::de::value::{Error, StrDeserializer};
use serde::de::{DeserializeOwned, IntoDeserializer};
use serde::{Deserialize, Serialize};

const LBF_N: f64 = 4.448_221_615_260_5;
const INCH_M: f64 = 0.0254;

/// What a unit measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, strum::IntoStaticStr)]
#[strum(serialize_all = "snake_case")]
pub enum Dimension {
    /// SI: m.
    Length,
    /// SI: rad.
    Angle,
    /// SI: N.
    Force,
    /// SI: N·m.
    Torque,
    /// Here: °C.
    Temperature,
}

impl Dimension {
    /// The word for a person.
    pub fn as_str(self) -> &'static str {
        self.into()
    }
}

/// The units: what each is, its name in the configuration and other spellings there, words for it that only names of
/// columns use, what it measures, and factor and offset of `SI = value · factor + offset`.
macro_rules! units {
    ($($doc:literal $unit:ident = $name:literal [$($other:literal)*] [$($word:literal)*]
       $dimension:ident, $factor:expr, $offset:expr;)*) => {
        /// The unit of a logged channel.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
        pub enum Unit {
            $(#[doc = $doc] #[serde(rename = $name $(, alias = $other)*)] $unit,)*
        }

        /// Every unit by each of its spellings and words.
        pub(crate) const SPELLINGS: &[(&str, Unit)] =
            &[$(($name, Unit::$unit), $(($other, Unit::$unit),)* $(($word, Unit::$unit),)*)*];

        impl Unit {
            const fn entry(self) -> (&'static str, Dimension, f64, f64) {
                match self {
                    $(Self::$unit => ($name, Dimension::$dimension, $factor, $offset),)*
                }
            }
        }
    };
}

units! {
    "Metre." Metre = "m" [] ["meter" "meters" "metre" "metres"] Length, 1.0, 0.0;
    "Millimetre." Millimetre = "mm" [] ["millimeter" "millimeters" "millimetre" "millimetres"]
       Length, 1e-3, 0.0;
    "Micrometre." Micrometre = "um" ["µm" "μm"] [] Length, 1e-6, 0.0;
    "Centimetre." Centimetre = "cm" [] [] Length, 1e-2, 0.0;
    "Inch." Inch = "in" ["inch" "inches"] [] Length, INCH_M, 0.0;
    "Thousandth of an inch." Mil = "mil" ["mils" "thou"] [] Length, INCH_M / 1e3, 0.0;
    "Degree of arc." Degree = "deg" ["°" "degree" "degrees"] [] Angle, PI / 180.0, 0.0;
    "Radian." Radian = "rad" ["radian" "radians"] [] Angle, 1.0, 0.0;
    "Milliradian." Milliradian = "mrad" [] [] Angle, 1e-3, 0.0;
    "Turn." Revolution = "rev" ["turn" "turns"] ["revs" "revolution" "revolutions" "rotations"]
       Angle, TAU, 0.0;
    "Newton." Newton = "N" ["newton"] ["newtons"] Force, 1.0, 0.0;
    "Kilonewton." Kilonewton = "kN" [] ["kilonewton" "kilonewtons"] Force, 1e3, 0.0;
    "Decanewton." Decanewton = "daN" [] [] Force, 10.0, 0.0;
    "Pound-force." PoundForce = "lbf" ["lb" "lbs"] ["pound" "pounds"] Force, LBF_N, 0.0;
    "Thousand pounds-force." KilopoundForce = "klbf" ["kip"] [] Force, 1e3 * LBF_N, 0.0;
    "Newton metre." NewtonMetre = "N.m" ["N·m" "Nm" "N m"] ["newtonmeter" "newtonmetre"] Torque, 1.0, 0.0;
    "Kilonewton metre." KilonewtonMetre = "kN.m" ["kN·m" "kNm"] [] Torque, 1e3, 0.0;
    "Pound-force inch." PoundForceInch = "lbf.in" ["lbf·in" "in.lbf" "lbf in"] ["lbin" "inlb" "inlbs"]
       Torque, LBF_N * INCH_M, 0.0;
    "Pound-force foot." PoundForceFoot = "lbf.ft" ["lbf·ft" "ft.lbf" "lbf ft"] ["lbft" "ftlb" "ftlbs"]
       Torque, LBF_N * INCH_M * 12.0, 0.0;
    "Degree Celsius." Celsius = "degC" ["°C" "C"] [] Temperature, 1.0, 0.0;
    "Degree Fahrenheit." Fahrenheit = "degF" ["°F" "F"] [] Temperature, 5.0 / 9.0, -160.0 / 9.0;
    "Kelvin." Kelvin = "K" [] [] Temperature, 1.0, -273.15;
}

/// The unit of a symbol, as configuration spells it.
pub(crate) fn from_symbol<U: DeserializeOwned>(symbol: &str) -> Option<U> {
    let symbol: StrDeserializer<'_, Error> = symbol.into_deserializer();
    U::deserialize(symbol).ok()
}

impl Unit {
    /// What it measures.
    pub fn dimension(self) -> Dimension {
        self.entry().1
    }

    /// Factor and offset of `SI = value · factor + offset`; temperatures are converted to °C.
    pub(crate) fn to_si(self) -> (f64, f64) {
        let (_, _, factor, offset) = self.entry();
        (factor, offset)
    }

    /// The name as configuration spells it.
    pub fn as_str(self) -> &'static str {
        self.entry().0
    }
}

/// The unit of the time column.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum TimeUnit {
    /// Seconds.
    #[serde(rename = "s")]
    Second,
    /// Milliseconds.
    #[serde(rename = "ms")]
    Millisecond,
    /// Microseconds.
    #[serde(rename = "us", alias = "µs", alias = "μs")]
    Microsecond,
    /// Nanoseconds.
    #[serde(rename = "ns")]
    Nanosecond,
    /// Minutes.
    #[serde(rename = "min")]
    Minute,
    /// Hours.
    #[serde(rename = "h")]
    Hour,
    /// Days.
    #[serde(rename = "d")]
    Day,
    /// Row counter that increases by one with every row; `clock.rate_hz` gives the rate.
    #[serde(rename = "count")]
    Count,
}

impl TimeUnit {
    /// Units per second; `None` for a counter, whose rate is a separate key.
    pub(crate) fn per_second(self) -> Option<f64> {
        Some(match self {
            Self::Count => return None,
            Self::Second => 1.0,
            Self::Millisecond => 1e3,
            Self::Microsecond => 1e6,
            Self::Nanosecond => 1e9,
            Self::Minute => 1.0 / 60.0,
            Self::Hour => 1.0 / 3600.0,
            Self::Day => 1.0 / 86_400.0,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn water_freezes_and_boils_where_it_should() {
        for (unit, freezing, boiling) in [(Unit::Fahrenheit, 32.0, 212.0), (Unit::Kelvin, 273.15, 373.15)] {
            let (factor, offset) = unit.to_si();
            assert!((freezing * factor + offset).abs() < 1e-12);
            assert!((boiling * factor + offset - 100.0).abs() < 1e-12);
        }
    }
}
