//! Values of the followed quantities, read from the store.

use std::collections::BTreeMap;

use ingest::tables::TableBatch;
use jiff::{SignedDuration, Timestamp};
use records::Quantity;
use store::{Query, Store};

use crate::error::Error;
use crate::findings::monitoring::median;
use crate::fleet::places::{TailPosition, UnitKey};
use crate::fleet::unit_rows::{RowsByUnit, UnitRows, at, number, of_store};

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

/// One flight of one unit, in as few bytes as its numbers take; NaN for none.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FlightValues {
    pub(crate) departure_us: i64,
    /// Index of the unit's positions.
    pub(crate) place: u32,
    pub(crate) temperature_c: f32,
    pub(crate) load_p95_n: f32,
    /// Value and standard error, in the order of [`READ`].
    pub(crate) values: [(f32, f32); READ.len()],
}

/// Values of one unit, by departure.
#[derive(Debug, Default)]
pub(crate) struct UnitValues {
    pub(crate) places: Vec<TailPosition>,
    pub(crate) flights: Vec<FlightValues>,
    /// Median 95 % load, N.
    pub(crate) usual_load_n: Option<f64>,
}

impl UnitValues {
    fn new(places: Vec<TailPosition>, mut flights: Vec<FlightValues>) -> Self {
        flights.sort_by_key(|flight| flight.departure_us);
        let loads_n: Vec<f64> =
            flights.iter().map(|f| f64::from(f.load_p95_n)).filter(|n| n.is_finite()).collect();
        let usual_load_n = (!loads_n.is_empty()).then(|| median(loads_n));
        Self { places, flights, usual_load_n }
    }

    /// Where a flight was flown.
    pub(crate) fn place(&self, flight: &FlightValues) -> &TailPosition {
        &self.places[flight.place as usize]
    }
}

/// Values of all units.
pub(crate) type FleetValues = BTreeMap<UnitKey, UnitValues>;

/// Reads the values of the last three years before a time, with it.
pub(crate) fn read(store: &Store, until: Timestamp) -> Result<FleetValues, Error> {
    let query = Query {
        since_utc: until.checked_sub(WINDOW).ok(),
        until_utc: until.checked_add(SignedDuration::from_micros(1)).ok(),
        ..Query::default()
    };
    let numbers = READ.iter().flat_map(|(quantity, error)| [quantity.as_str(), error]);
    let keys = [
        "tail_number",
        "position",
        "part_number",
        "serial_number",
        "departure_utc",
        "temperature_c",
        "load_p05_n",
        "load_p95_n",
    ];
    let columns: Vec<&str> = keys.into_iter().chain(numbers).collect();
    let parts = of_store(&store.scan_columns(&query, &columns)?, |rows, chunk, _| add(rows, chunk))?;
    let unit = |(name, parts)| {
        let rows = UnitRows::concatenated(parts, |flight: &mut FlightValues, places, _| {
            flight.place = places[flight.place as usize];
        });
        (name, UnitValues::new(rows.places, rows.rows))
    };
    Ok(parts.into_iter().map(unit).collect())
}

fn add(rows: &mut RowsByUnit<FlightValues>, chunk: &TableBatch) -> Result<(), ingest::Error> {
    let numbers = |name: &str| chunk.numbers(Some(chunk.column(&[name])?));
    let (temperatures, lows, highs) =
        (numbers("temperature_c")?, numbers("load_p05_n")?, numbers("load_p95_n")?);
    let mut columns = Vec::with_capacity(READ.len());
    for (quantity, error) in READ {
        columns.push((numbers(quantity.as_str())?, numbers(error)?));
    }
    let departures = chunk.timestamps(Some(chunk.column(&["departure_utc"])?))?;
    rows.add_rows(chunk, |row, unit, place| {
        let load_n = at(&lows, row).zip(at(&highs, row)).map(|(low, high)| low.abs().max(high.abs()));
        unit.rows.push(FlightValues {
            departure_us: departures.value(row),
            place,
            temperature_c: number(&temperatures, row) as f32,
            load_p95_n: load_n.unwrap_or(f64::NAN) as f32,
            values: std::array::from_fn(|k| {
                let (values, errors) = &columns[k];
                (number(values, row) as f32, at(errors, row).unwrap_or(0.0) as f32)
            }),
        });
        Ok(())
    })
}

/// The same by position: all flights there, under the unit that flew there last.
pub(crate) fn by_position(fleet: &FleetValues) -> FleetValues {
    type Place<'a> = (i64, Option<&'a UnitKey>, Vec<FlightValues>);
    let mut positions: BTreeMap<&TailPosition, Place<'_>> = BTreeMap::new();
    for (name, unit) in fleet {
        for flight in &unit.flights {
            let (last_us, last, flights) = positions.entry(unit.place(flight)).or_default();
            flights.push(FlightValues { place: 0, ..*flight });
            if last.is_none() || flight.departure_us > *last_us {
                (*last_us, *last) = (flight.departure_us, Some(name));
            }
        }
    }
    // A unit that was the last one at two positions is at the later one.
    let mut of_units: BTreeMap<&UnitKey, (i64, UnitValues)> = BTreeMap::new();
    for (position, (last_us, name, flights)) in positions {
        let Some(name) = name else { continue };
        if of_units.get(name).is_some_and(|(known_us, _)| *known_us >= last_us) {
            continue;
        }
        of_units.insert(name, (last_us, UnitValues::new(vec![position.clone()], flights)));
    }
    of_units.into_iter().map(|(name, (_, values))| (name.clone(), values)).collect()
}
