//! Values of the followed quantities: columns of the store, read one after the other.

use std::borrow::Cow;
use std::collections::BTreeMap;

use arrow::array::Float64Array;
use ingest::tables::TableBatch;
use jiff::{SignedDuration, Timestamp};
use job::rejection;
use rayon::prelude::*;
use records::Quantity;
use store::ColumnScan;
use trend::Series;

use crate::error::Error;
use crate::fleet::flight_row::{FlightRow, TailPosition, UnitKey};
use crate::fleet::histories::History;
use crate::fleet::unit_rows::{at, further_columns, number};

/// Flights that are followed: three years. It bounds what a fleet of any age takes.
const WINDOW: SignedDuration = SignedDuration::from_hours(24 * 1_096);

/// Quantities that are read, with the column of their standard error.
pub(crate) const READ: [(Quantity, &str); 9] = [
    (Quantity::LostMotionM, "lost_motion_se_m"),
    (Quantity::StiffnessNPerM, "stiffness_se_n_per_m"),
    (Quantity::FrictionN, "friction_se_n"),
    (Quantity::FrictionDryN, "friction_dry_se_n"),
    (Quantity::FrictionLoadShare, "friction_load_share_se"),
    (Quantity::SkewS, "skew_se_s"),
    (Quantity::LoadZeroN, "load_zero_se_n"),
    (Quantity::LoadDelayS, "load_delay_se_s"),
    (Quantity::Nis, "nis_se"),
];

/// Columns of temperature, of the 5 % and 95 % quantiles of the load, and of the reason of a rejection.
const COVARIATES: [&str; 4] = ["temperature_c", "load_p05_n", "load_p95_n", "reason"];

/// A quantity of each row and its standard error, in as few bytes as its numbers take; NaN for none.
pub(crate) type QuantityColumn = Vec<(f32, f32)>;

/// What every quantity of a flight depends on; NaN for none.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Covariates {
    pub(crate) temperature_c: f32,
    pub(crate) load_p95_n: f32,
    /// Which of [`rejection::fault_codes`] the record has as its reason; a larger number for none.
    fault_code: u8,
}

impl Covariates {
    /// The reason of the record, where it is one of [`rejection::fault_codes`].
    pub(crate) fn fault_code(&self) -> Option<&'static str> {
        rejection::fault_codes().nth(usize::from(self.fault_code))
    }
}

/// The values of the quantity at an index of [`READ`].
pub(crate) fn quantity(stored: &ColumnScan, index: usize) -> Result<QuantityColumn, Error> {
    let (quantity, error) = READ[index];
    let names = [quantity.as_str(), error];
    further_columns(stored, &names, |chunk, _| {
        let [values, errors] = names.map(|name| numbers(chunk, name));
        let (values, errors) = (values?, errors?);
        Ok(move |row| (number(&values, row) as f32, at(&errors, row).unwrap_or(0.0) as f32))
    })
}

/// What every quantity of the rows depends on.
pub(crate) fn covariates(stored: &ColumnScan) -> Result<Vec<Covariates>, Error> {
    further_columns(stored, &COVARIATES, |chunk, _| {
        let [temperature, low, high, reason] = COVARIATES;
        let temperatures = numbers(chunk, temperature)?;
        let (lows, highs) = (numbers(chunk, low)?, numbers(chunk, high)?);
        let reasons = chunk.texts(chunk.find(&[reason]))?;
        Ok(move |row| {
            let fault_code = |reason| rejection::fault_codes().position(|code| code == reason);
            let load_n = at(&lows, row).zip(at(&highs, row)).map(|(low, high)| low.abs().max(high.abs()));
            Covariates {
                temperature_c: number(&temperatures, row) as f32,
                load_p95_n: load_n.unwrap_or(f64::NAN) as f32,
                fault_code: reasons.get(row).and_then(fault_code).map_or(u8::MAX, |number| number as u8),
            }
        })
    })
}

fn numbers(chunk: &TableBatch, name: &str) -> Result<Float64Array, ingest::Error> {
    chunk.numbers(Some(chunk.column(&[name])?))
}

/// Units by name: their flights, and the same by usage with their maintenance.
pub(crate) type Units<'a> = BTreeMap<&'a UnitKey, (&'a History, Series)>;

/// The followed flights of a unit, or those at the position that it was the last to fly in, by departure.
pub(crate) struct FollowedFlights<'a> {
    pub(crate) history: &'a History,
    position: Option<&'a TailPosition>,
    pub(crate) flights: Cow<'a, [FlightRow]>,
    /// Median 95 % load, N.
    pub(crate) usual_load_n: Option<f64>,
}

impl<'a> FollowedFlights<'a> {
    /// Where a flight was flown.
    pub(crate) fn place(&self, flown: &FlightRow) -> &'a TailPosition {
        self.position.unwrap_or_else(|| self.history.place(flown))
    }
}

pub(crate) type FollowedUnits<'a> = BTreeMap<&'a UnitKey, FollowedFlights<'a>>;

/// The flights of each unit in the three years before a date, with it.
pub(crate) fn by_unit<'a>(
    units: &Units<'a>,
    covariates: &[Covariates],
    as_of: Timestamp,
) -> FollowedUnits<'a> {
    let since = as_of.checked_sub(WINDOW).unwrap_or(Timestamp::MIN);
    let followed = |(name, (history, _)): (&&'a UnitKey, &(&'a History, _))| {
        let (history, flights) = (*history, history.until(as_of));
        let first = flights.partition_point(|flown| flown.departure_utc() < since);
        let flights = &flights[first..];
        let loads_n = flights.iter().map(|flown| f64::from(covariates[flown.row as usize].load_p95_n));
        let usual_load_n = trend::quantity::median(loads_n.filter(|n| n.is_finite()).collect());
        (*name, FollowedFlights { history, position: None, flights: flights.into(), usual_load_n })
    };
    units.par_iter().map(followed).collect()
}

/// The same by position: all flights there, under the unit that flew there last.
pub(crate) fn by_position<'a>(units: &'a FollowedUnits<'a>) -> FollowedUnits<'a> {
    type Flown<'a> = (i64, Option<&'a UnitKey>, Cow<'a, [FlightRow]>);
    let mut positions: BTreeMap<&TailPosition, Flown<'a>> = BTreeMap::new();
    for (name, unit) in units {
        for of_place in unit.flights.chunk_by(|a, b| a.place == b.place) {
            let [.., newest] = of_place else { continue };
            let (last_us, last, flights) = positions.entry(unit.place(newest)).or_default();
            if flights.is_empty() {
                *flights = Cow::Borrowed(of_place);
            } else {
                flights.to_mut().extend_from_slice(of_place);
            }
            if last.is_none() || newest.departure_us() > *last_us {
                (*last_us, *last) = (newest.departure_us(), Some(*name));
            }
        }
    }
    // A unit that was the last one at two positions is at the later one.
    let mut of_units: BTreeMap<&UnitKey, (i64, FollowedFlights<'_>)> = BTreeMap::new();
    for (position, (last_us, name, mut flights)) in positions {
        let Some((name, unit)) = name.and_then(|name| units.get_key_value(name)) else { continue };
        if of_units.get(name).is_none_or(|(known_us, _)| *known_us < last_us) {
            if let Cow::Owned(flights) = &mut flights {
                flights.sort_by_key(FlightRow::departure_us);
            }
            let position = Some(position);
            of_units.insert(name, (last_us, FollowedFlights { position, flights, ..*unit }));
        }
    }
    of_units.into_iter().map(|(name, (_, flights))| (name, flights)).collect()
}
