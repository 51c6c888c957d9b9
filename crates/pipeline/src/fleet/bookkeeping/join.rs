//! Bookkeeping: which unit flew, and how many hours, joined to stored records from the operator's tables.
//!
//! A gap belongs to a tail, a position and a departure. The unit's serial number and hours may be corrected later, often
//! after its log was deleted. So every reader of the store joins them here, and each run writes them into the columns that
//! other programs read.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::Arc;

use arrow::array::{Array, ArrayRef, AsArray, DictionaryArray, Float64Array, RecordBatch, StringArray};
use arrow::compute::cast;
use arrow::datatypes::{DataType, Float64Type, Int32Type, TimestampMicrosecondType};
use arrow::error::ArrowError;
use ingest::Flights;
use jiff::Timestamp;
use job::Config;
use records::{Installation, Installations};
use store::{Store, Writer};

use crate::error::Error;
use crate::fleet::histories::UnitKey;

/// Columns that the join reads or supplies, for [`Writer::rewrite`].
const COLUMNS: [&str; 10] = [
    "tail_number",
    "position",
    "departure_utc",
    "flight_id",
    "part_number",
    "serial_number",
    "unit_hours",
    "flight_hours",
    "tail_hours_end",
    "log_path",
];

/// The operator's tables, as they are joined to records.
#[derive(Debug, Clone)]
pub struct Bookkeeping {
    installations: Arc<Installations>,
    flights: Arc<Flights>,
    /// Configured parts: a misspelt part number takes no record away from its unit.
    parts: Arc<BTreeSet<String>>,
    digest: String,
}

/// Flights of one place that a corrected table gave to another unit.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
#[expect(missing_docs, reason = "each field is named for the contract's column")]
pub struct MovedFlights {
    pub tail_number: String,
    pub position: String,
    pub from_part_number: String,
    pub from_serial_number: String,
    pub part_number: String,
    pub serial_number: String,
    /// Number of records.
    pub flights: usize,
    pub first_departure_utc: Timestamp,
    pub last_departure_utc: Timestamp,
}

impl MovedFlights {
    /// The unit that lost the flights.
    pub(crate) fn former_unit(&self) -> UnitKey {
        (Some(self.from_part_number.clone()), self.from_serial_number.clone())
    }

    /// The unit that has them now.
    pub(crate) fn present_unit(&self) -> UnitKey {
        (Some(self.part_number.clone()), self.serial_number.clone())
    }
}

/// Number of flights of a place that went from one unit to another.
impl std::fmt::Display for MovedFlights {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { tail_number, position, part_number, serial_number, flights, .. } = self;
        let day = |at: Timestamp| at.strftime("%Y-%m-%d").to_string();
        write!(
            f,
            "{flights} flight{} of {tail_number} {position} ({} to {}) moved from {} / {} to {part_number} / {serial_number}",
            if *flights == 1 { "" } else { "s" },
            day(self.first_departure_utc),
            day(self.last_departure_utc),
            self.from_part_number,
            self.from_serial_number,
        )
    }
}

impl Bookkeeping {
    /// The tables of a configuration.
    pub fn new(config: &Config, installations: &Installations) -> Self {
        let parts = config.parts.keys().map(ToString::to_string).collect();
        let mut hash = blake3::Hasher::new();
        let mut add = |row: Result<String, serde_json::Error>| {
            hash.update(row.unwrap_or_default().as_bytes());
            hash.update(b"\n");
        };
        installations.iter().for_each(|row| add(serde_json::to_string(row)));
        config.parts.keys().for_each(|part| add(serde_json::to_string(part)));
        hash.update(config.flights.digest().as_bytes());
        Self {
            installations: Arc::new(installations.clone()),
            flights: Arc::clone(&config.flights),
            parts: Arc::new(parts),
            digest: hash.finalize().to_hex().to_string(),
        }
    }

    /// Digest of the tables: where a run that ended has the same one, the stored columns are those of the tables.
    pub fn digest(&self) -> &str {
        &self.digest
    }

    /// The store, with the tables joined to every record that is read.
    ///
    /// # Errors
    /// When the runs of the store cannot be read.
    pub fn join_to(&self, store: Store) -> Result<Store, Error> {
        if self.is_written(&store)? {
            return Ok(store);
        }
        let own = self.clone();
        Ok(store.joined(move |batch| own.join(batch, |_, _| {})))
    }

    /// Whether the latest run wrote these tables into all records, and ended.
    fn is_written(&self, store: &Store) -> Result<bool, Error> {
        Ok(store.tables_digest()?.as_deref() == Some(self.digest.as_str()))
    }

    /// Writes the tables into all records of the store, and the new paths of renamed logs. Returns the flights that another
    /// unit has now.
    ///
    /// # Errors
    /// As [`Writer::rewrite`].
    pub fn write(
        &self,
        writer: &mut Writer,
        renamed: &BTreeMap<String, String>,
    ) -> Result<Vec<MovedFlights>, Error> {
        if renamed.is_empty() && self.is_written(writer.store())? {
            return Ok(Vec::new());
        }
        let mut moved = MovedByPlace::new();
        writer.rewrite(&COLUMNS, |batch| {
            with_new_paths(self.join(batch, |names, at| add_moved(&mut moved, names, at))?, renamed)
        })?;
        Ok(moved.into_values().collect())
    }

    /// A batch of records with the columns that the tables supply. A record that they do not know keeps what is stored.
    /// `moved` is given tail, position, former unit and present unit of each record that another unit has now, and its
    /// departure.
    fn join(
        &self,
        batch: &RecordBatch,
        mut moved: impl FnMut([&str; 6], Timestamp),
    ) -> Result<RecordBatch, ArrowError> {
        let names = |column: &str| Names::of(batch, column);
        let (tails, positions) = (names("tail_number")?, names("position")?);
        let (parts, serials) = (names("part_number")?, names("serial_number")?);
        let has_flights = !self.flights.is_empty();
        let flights = has_flights.then(|| names("flight_id")).transpose()?;
        let departures = batch.column(batch.schema_ref().index_of("departure_utc")?);
        let departures = departures.as_primitive::<TimestampMicrosecondType>();
        let numbers =
            |name: &str, is_needed: bool| batch.column_by_name(name).filter(|_| is_needed).map(numbers);
        let mut hours = numbers("unit_hours", true);
        let mut flown = numbers("flight_hours", has_flights);
        let mut meters = numbers("tail_hours_end", has_flights || hours.is_some());
        let mut installed: HashMap<[Option<usize>; 2], Vec<(&Installation, bool)>> = HashMap::new();
        let mut of_others: Vec<(usize, [&str; 2])> = Vec::new();
        for row in 0..batch.num_rows() {
            let Ok(at) = Timestamp::from_microsecond(departures.value(row)) else { continue };
            let flight = flights.as_ref().map(|flights| flights.get(row));
            if let Some(flight) = flight.and_then(|flight| self.flights.of(tails.get(row), flight, at)) {
                set(flown.as_mut(), row, flight.flight_hours);
                set(meters.as_mut(), row, flight.tail_hours_end);
            }
            let at_place = || {
                let installations = self.installations.of_position(tails.get(row), positions.get(row));
                let is_known = |i: &Installation| self.parts.contains(i.part_number.as_str());
                installations.iter().map(|i| (i, is_known(i))).collect()
            };
            let at_place = installed.entry([tails.code(row), positions.code(row)]).or_insert_with(at_place);
            let Some((installation, true)) = at_place.iter().find(|(i, _)| i.covers(at)) else { continue };
            let (part, serial) = installation.unit();
            let (stored, unit) = ([parts.get(row), serials.get(row)], [part.as_str(), serial.as_str()]);
            if stored != unit {
                moved([tails.get(row), positions.get(row), stored[0], stored[1], unit[0], unit[1]], at);
                of_others.push((row, unit));
            }
            if let Some(hours) = &mut hours {
                hours[row] = installation.unit_hours(meters.as_ref().and_then(|meters| meters[row]));
            }
        }
        let mut joined = batch.clone();
        for (k, (column, stored)) in
            [("part_number", &parts), ("serial_number", &serials)].into_iter().enumerate()
        {
            if !of_others.is_empty() {
                let mut names: Vec<&str> = (0..batch.num_rows()).map(|row| stored.get(row)).collect();
                of_others.iter().for_each(|(row, unit)| names[*row] = unit[k]);
                joined = replaced(joined, column, &StringArray::from(names))?;
            }
        }
        for (column, values) in [("unit_hours", hours), ("flight_hours", flown), ("tail_hours_end", meters)] {
            if let Some(values) = values {
                joined = replaced(joined, column, &Float64Array::from(values))?;
            }
        }
        Ok(joined)
    }
}

/// Names of a column, each with the code of its text.
struct Names(DictionaryArray<Int32Type>);

impl Names {
    fn of(batch: &RecordBatch, column: &str) -> Result<Self, ArrowError> {
        let coded = DataType::Dictionary(Box::new(DataType::Int32), Box::new(DataType::Utf8));
        let names = cast(batch.column(batch.schema_ref().index_of(column)?), &coded)?;
        Ok(Self(names.as_dictionary().clone()))
    }

    fn code(&self, row: usize) -> Option<usize> {
        self.0.key(row)
    }

    /// The name of a row; an empty one for none.
    fn get(&self, row: usize) -> &str {
        self.code(row).map_or("", |code| self.0.values().as_string::<i32>().value(code))
    }
}

/// A batch with another column in the place of that of a name, in its type.
fn replaced(batch: RecordBatch, name: &str, column: &dyn Array) -> Result<RecordBatch, ArrowError> {
    let (schema, mut columns, _) = batch.into_parts();
    let place = schema.index_of(name)?;
    columns[place] = cast(column, schema.field(place).data_type())?;
    RecordBatch::try_new(schema, columns)
}

fn numbers(column: &ArrayRef) -> Vec<Option<f64>> {
    column.as_primitive::<Float64Type>().iter().collect()
}

fn set(values: Option<&mut Vec<Option<f64>>>, row: usize, value: Option<f64>) {
    if let (Some(values), Some(_)) = (values, value) {
        values[row] = value;
    }
}

/// A batch with the new paths of renamed logs.
fn with_new_paths(batch: RecordBatch, renamed: &BTreeMap<String, String>) -> Result<RecordBatch, ArrowError> {
    if renamed.is_empty() {
        return Ok(batch);
    }
    let paths = batch.column(batch.schema_ref().index_of("log_path")?).as_string::<i32>();
    let new = paths.iter().map(|path| path.map(|path| renamed.get(path).map_or(path, String::as_str)));
    let new: StringArray = new.collect();
    replaced(batch, "log_path", &new)
}

/// Moved flights by place and units.
type MovedByPlace = BTreeMap<[String; 6], MovedFlights>;

/// Counts a record that another unit has now, by tail, position, former unit and present unit.
fn add_moved(moved: &mut MovedByPlace, names: [&str; 6], at: Timestamp) {
    let entry = moved.entry(names.map(str::to_owned)).or_insert_with_key(|names| {
        let [tail_number, position, from_part_number, from_serial_number, part_number, serial_number] =
            names.clone();
        MovedFlights {
            tail_number,
            position,
            from_part_number,
            from_serial_number,
            part_number,
            serial_number,
            flights: 0,
            first_departure_utc: at,
            last_departure_utc: at,
        }
    });
    entry.flights += 1;
    entry.first_departure_utc = entry.first_departure_utc.min(at);
    entry.last_departure_utc = entry.last_departure_utc.max(at);
}

/// Opens the store of a configuration for reading, with the operator's tables joined to its records.
///
/// # Errors
/// As [`Store::open`].
pub fn open_store(config: &Config, installations: &Installations) -> Result<Store, Error> {
    Bookkeeping::new(config, installations).join_to(Store::open(config.store())?)
}
