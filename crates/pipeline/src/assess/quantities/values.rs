//! Values of the followed quantities, flight by flight, read in one scan with the histories.

use std::collections::BTreeMap;

use arrow::array::Float64Array;
use ingest::tables::{StringColumn, TableBatch};
use jiff::{SignedDuration, Timestamp};
use job::rejection;
use records::Quantity;
use store::{Query, Store};
use trend::Series;

use crate::error::Error;
use crate::fleet::builder;
use crate::fleet::flight_row::{FlightRow, TailPosition, UnitKey};
use crate::fleet::histories::{Histories, History};
use crate::fleet::unit_rows::{at, number, of_store};

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

/// Columns of temperature, and of the 5 % and 95 % quantiles of the load.
const COVARIATES: [&str; 3] = ["temperature_c", "load_p05_n", "load_p95_n"];

/// Values of one flight of one unit, in as few bytes as its numbers take; NaN for none.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FlightValues {
    pub(crate) temperature_c: f32,
    pub(crate) load_p95_n: f32,
    /// Which of [`rejection::fault_codes`] the record has as its reason; a larger number for none.
    fault_code: u8,
    /// Value and standard error, in the order of [`READ`].
    pub(crate) values: [(f32, f32); READ.len()],
}

impl FlightValues {
    /// The value of a quantity that is read; none of a flight without it.
    pub(crate) fn of(&self, quantity: Quantity) -> Option<f64> {
        let index = READ.iter().position(|(read, _)| *read == quantity)?;
        Some(f64::from(self.values[index].0)).filter(|value| value.is_finite())
    }

    /// The reason of the record, where it is one of [`rejection::fault_codes`].
    pub(crate) fn fault_code(&self) -> Option<&'static str> {
        rejection::fault_codes().nth(usize::from(self.fault_code))
    }
}

pub(crate) struct ValueColumns {
    reasons: StringColumn,
    covariates: [Float64Array; COVARIATES.len()],
    quantities: Vec<(Float64Array, Float64Array)>,
}

impl ValueColumns {
    pub(crate) fn names() -> impl Iterator<Item = &'static str> {
        let numbers = READ.iter().flat_map(|(quantity, error)| [quantity.as_str(), error]);
        COVARIATES.into_iter().chain(["reason"]).chain(numbers)
    }

    pub(crate) fn of(chunk: &TableBatch) -> Result<Self, ingest::Error> {
        let numbers = |name: &str| chunk.numbers(Some(chunk.column(&[name])?));
        let [temperatures, lows, highs] = COVARIATES.map(numbers);
        let of = |(quantity, error): (Quantity, &str)| Ok((numbers(quantity.as_str())?, numbers(error)?));
        let quantities = READ.into_iter().map(of).collect::<Result<_, ingest::Error>>()?;
        let reasons = chunk.texts(chunk.find(&["reason"]))?;
        Ok(Self { reasons, covariates: [temperatures?, lows?, highs?], quantities })
    }

    pub(crate) fn row(&self, row: usize) -> FlightValues {
        let [temperatures, lows, highs] = &self.covariates;
        let load_n = at(lows, row).zip(at(highs, row)).map(|(low, high)| low.abs().max(high.abs()));
        let fault_code = |reason| rejection::fault_codes().position(|code| code == reason);
        FlightValues {
            temperature_c: number(temperatures, row) as f32,
            load_p95_n: load_n.unwrap_or(f64::NAN) as f32,
            fault_code: self.reasons.get(row).and_then(fault_code).map_or(u8::MAX, |number| number as u8),
            values: std::array::from_fn(|k| {
                let (values, errors) = &self.quantities[k];
                (number(values, row) as f32, at(errors, row).unwrap_or(0.0) as f32)
            }),
        }
    }
}

/// Units by name: their flights, and the same by usage with their maintenance.
pub(crate) type Units<'a> = BTreeMap<&'a UnitKey, (&'a History, Series)>;

/// Values of all units, in the order of the last flights of their histories.
pub(crate) type FleetValues = BTreeMap<UnitKey, Vec<FlightValues>>;

/// Reads every unit's flights in the store, with their values.
pub(crate) fn load(store: &Store) -> Result<(Histories, FleetValues), Error> {
    let columns: Vec<&str> = builder::stored_columns().into_iter().chain(ValueColumns::names()).collect();
    let scan = store.scan_columns(&Query::default(), &columns)?;
    let parts = of_store(&scan, |rows, chunk, batch| {
        let values = ValueColumns::of(chunk)?;
        builder::add_stored(rows, chunk, batch, |row| values.row(row))
    })?;
    Ok(builder::histories(parts, true))
}

/// Frees the values of flights that are too old to be followed at a date.
pub(crate) fn drop_old(values: &mut FleetValues, histories: &Histories, as_of: Timestamp) {
    for (name, values) in values {
        let old = histories.units.get(name).map_or(0, |history| before_window(history, as_of));
        values.drain(..old);
        values.shrink_to_fit();
    }
}

/// Number of flights before the followed years.
fn before_window(history: &History, as_of: Timestamp) -> usize {
    let is_old = |since: Timestamp| history.flights().partition_point(|f| f.departure_utc() < since);
    as_of.checked_sub(WINDOW).map_or(0, is_old)
}

/// The followed flights of a unit, or those at the position that it was the last to fly in, by departure.
pub(crate) struct FollowedFlights<'a> {
    pub(crate) history: &'a History,
    position: Option<&'a TailPosition>,
    pub(crate) flights: Vec<(&'a FlightRow, &'a FlightValues)>,
    /// Median 95 % load, N.
    pub(crate) usual_load_n: Option<f64>,
}

impl<'a> FollowedFlights<'a> {
    fn new(
        history: &'a History,
        position: Option<&'a TailPosition>,
        flights: Vec<(&'a FlightRow, &'a FlightValues)>,
    ) -> Self {
        let loads_n = flights.iter().map(|(_, values)| f64::from(values.load_p95_n));
        let usual_load_n = trend::quantity::median(loads_n.filter(|n| n.is_finite()).collect());
        Self { history, position, flights, usual_load_n }
    }

    /// Where a flight was flown.
    pub(crate) fn place(&self, flown: &FlightRow) -> &'a TailPosition {
        self.position.unwrap_or_else(|| self.history.place(flown))
    }
}

pub(crate) type FollowedUnits<'a> = BTreeMap<&'a UnitKey, FollowedFlights<'a>>;

/// The flights of each unit in the three years before a date, with it.
pub(crate) fn by_unit<'v, 'a: 'v>(
    units: &Units<'a>,
    values: &'v FleetValues,
    as_of: Timestamp,
) -> FollowedUnits<'v> {
    let followed = |(name, (history, _)): (&&'a UnitKey, &(&'a History, _))| {
        let (history, values) = (*history, values.get(*name)?);
        let dropped = history.flights().len() - values.len();
        let first = before_window(history, as_of);
        let flights = history.until(as_of).iter().skip(first).zip(values.iter().skip(first - dropped));
        Some((*name, FollowedFlights::new(history, None, flights.collect())))
    };
    units.iter().filter_map(followed).collect()
}

/// The same by position: all flights there, under the unit that flew there last.
pub(crate) fn by_position<'a>(units: &FollowedUnits<'a>) -> FollowedUnits<'a> {
    type Flown<'a> = (&'a FlightRow, &'a FlightValues);
    let mut positions: BTreeMap<&TailPosition, (i64, Option<&'a UnitKey>, Vec<Flown<'a>>)> = BTreeMap::new();
    for (name, unit) in units {
        for of_place in unit.flights.chunk_by(|a, b| a.0.place == b.0.place) {
            let [.., (newest, _)] = of_place else { continue };
            let (last_us, last, flights) = positions.entry(unit.place(newest)).or_default();
            flights.extend_from_slice(of_place);
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
            flights.sort_by_key(|(flown, _)| flown.departure_us());
            let flights = FollowedFlights::new(unit.history, Some(position), flights);
            of_units.insert(name, (last_us, flights));
        }
    }
    of_units.into_iter().map(|(name, (_, flights))| (name, flights)).collect()
}
