//! Row schema: the one mapping between row types and Arrow columns.
//!
//! [`row!`](crate::row) and [`stored_row!`](crate::stored_row) declare a row type. Each field is a column: its name
//! is the column's name, its type the column's type, its doc comment the column's documentation. A field whose type
//! is itself a row type has the columns of that type.
//!
//! ```
//! use records::row_schema;
//!
//! records::stored_row! {
//!     /// Length of a flight.
//!     #[derive(Debug, PartialEq)]
//!     pub struct Length {
//!         /// The flight.
//!         pub flight_id: String,
//!         /// Duration, hours.
//!         pub flight_hours: Option<f64>,
//!     }
//! }
//!
//! let rows = [Length { flight_id: "F1".into(), flight_hours: Some(1.5) }];
//! let batch = row_schema::to_batch(&rows)?;
//! assert!(!batch.schema().field(0).is_nullable() && batch.schema().field(1).is_nullable());
//! assert_eq!(row_schema::from_batch::<Length>(&batch)?, rows);
//! # Ok::<(), row_schema::RowError>(())
//! ```

use std::sync::Arc;

use arrow::array::{
    Array, ArrayRef, ArrowPrimitiveType, AsArray, BooleanArray, Float64Array, Float64Builder, Int64Array,
    ListArray, ListBuilder, RecordBatch, StringArray, StringBuilder, StructArray, TimestampMicrosecondArray,
};
use arrow::buffer::OffsetBuffer;
use arrow::datatypes::{
    DataType, Field, Fields, Float64Type, Int64Type, Schema, SchemaRef, TimeUnit, TimestampMicrosecondType,
};
use arrow::error::ArrowError;
use jiff::Timestamp;

use crate::ids::{FlightId, PartNumber, Position, SerialNumber, TailNumber};

/// Why rows cannot be converted to columns, or columns to rows.
#[derive(Debug, thiserror::Error)]
#[expect(
    missing_docs,
    reason = "each variant says by its message what is wrong, and names its fields for what they hold"
)]
pub enum RowError {
    #[error("column `{column}` {problem}")]
    Column { column: &'static str, problem: String },
    #[error("column `{column}`, row {row}: {problem}")]
    Value { column: &'static str, row: usize, problem: String },
    #[error("rows cannot be converted to columns: {0}")]
    Arrow(#[from] ArrowError),
}

/// A column of a row type.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// Name; a unit is its last part.
    pub name: &'static str,
    /// Arrow type.
    pub data_type: DataType,
    /// Whether cells may be empty.
    pub nullable: bool,
    /// Documentation, in Markdown.
    pub doc: &'static str,
}

impl Column {
    fn field(&self) -> Field {
        Field::new(self.name, self.data_type.clone(), self.nullable)
    }
}

/// Arrays of some columns.
pub type Arrays = Vec<ArrayRef>;

/// A type of field: one column, or the columns of a nested row.
pub trait Cells: Sized {
    /// Columns of a field, from the field's name and documentation.
    fn columns(name: &'static str, doc: &'static str) -> Vec<Column>;

    /// Arrays of these columns.
    fn arrays(cells: &[&Self]) -> Arrays;
}

/// A type of field that is also read.
pub trait FromCells: Cells {
    /// Reads the next cell, or the next cells of a nested row.
    ///
    /// # Errors
    /// [`RowError::Value`] when a cell is empty where a value is required, or out of range.
    fn read(cells: &mut CellReader<'_>) -> Result<Self, RowError>;
}

/// A row type, declared by [`row!`](crate::row) or [`stored_row!`](crate::stored_row).
pub trait Row: Cells {
    /// Sort key of a column in the table. Columns of equal keys are in the order of declaration.
    fn order(_column: &str) -> usize {
        0
    }
}

/// Declares a row type whose fields are the columns of a table: see [`row_schema`](mod@crate::row_schema). A field without
/// a doc comment has that of the field before.
///
/// A function after the struct (`order = path`) gives the sort key of each column.
#[macro_export]
macro_rules! row {
    (
        $(#[$attribute:meta])*
        $vis:vis struct $name:ident {
            $(
                $(#[doc = $doc:literal])*
                $(#[serde($($serde:tt)*)])?
                $field_vis:vis $field:ident: $type:ty
            ),* $(,)?
        }
        $(order = $order:expr)?
    ) => {
        $(#[$attribute])*
        $vis struct $name {
            $(
                #[allow(missing_docs, reason = "a field without a comment has that of the field before")]
                $(#[doc = $doc])*
                $(#[serde($($serde)*)])?
                $field_vis $field: $type,
            )*
        }

        impl $crate::row_schema::Cells for $name {
            fn columns(_: &'static str, _: &'static str) -> Vec<$crate::row_schema::Column> {
                let mut columns = Vec::new();
                let mut doc = "";
                $(
                    doc = Some(concat!($($doc),*).trim_ascii()).filter(|own| !own.is_empty()).unwrap_or(doc);
                    columns.extend(<$type as $crate::row_schema::Cells>::columns(stringify!($field), doc));
                )*
                columns
            }

            fn arrays(rows: &[&Self]) -> $crate::row_schema::Arrays {
                let mut arrays = Vec::new();
                $(
                    let cells: Vec<_> = rows.iter().map(|row| &row.$field).collect();
                    arrays.extend(<$type as $crate::row_schema::Cells>::arrays(&cells));
                )*
                arrays
            }
        }

        impl $crate::row_schema::Row for $name {
            $(
                fn order(column: &str) -> usize {
                    ($order)(column)
                }
            )?
        }
    };
}

/// Declares a row type like [`row!`](crate::row) that is also read back from its table.
#[macro_export]
macro_rules! stored_row {
    (
        $(#[$attribute:meta])*
        $vis:vis struct $name:ident {
            $($(#[$($meta:tt)*])* $field_vis:vis $field:ident: $type:ty),* $(,)?
        }
        $(order = $order:expr)?
    ) => {
        $crate::row! {
            $(#[$attribute])*
            $vis struct $name {
                $($(#[$($meta)*])* $field_vis $field: $type),*
            }
            $(order = $order)?
        }

        impl $crate::row_schema::FromCells for $name {
            fn read(
                cells: &mut $crate::row_schema::CellReader<'_>,
            ) -> Result<Self, $crate::row_schema::RowError> {
                Ok(Self { $($field: <$type as $crate::row_schema::FromCells>::read(cells)?,)* })
            }
        }
    };
}

/// Columns of a row type, in the order of its table.
pub fn columns<R: Row>() -> Vec<Column> {
    let mut columns = R::columns("", "");
    columns.sort_by_key(|column| R::order(column.name));
    columns
}

/// Schema of a row type's table.
pub fn schema<R: Row>() -> SchemaRef {
    Arc::new(Schema::new(columns::<R>().iter().map(Column::field).collect::<Vec<_>>()))
}

/// Rows as columns. Times are cut to whole microseconds; a number that is not finite is missing, where it may be, and every
/// other keeps its bits.
///
/// # Errors
/// [`RowError::Arrow`] when there are more rows than a batch can hold.
pub fn to_batch<R: Row>(rows: &[R]) -> Result<RecordBatch, RowError> {
    let declared = R::columns("", "");
    let mut arrays: Vec<(usize, ArrayRef)> = declared
        .iter()
        .map(|column| R::order(column.name))
        .zip(R::arrays(&rows.iter().collect::<Vec<_>>()))
        .collect();
    arrays.sort_by_key(|(order, _)| *order);
    Ok(RecordBatch::try_new(schema::<R>(), arrays.into_iter().map(|(_, array)| array).collect())?)
}

/// As [`to_batch`], with every column nullable: the schema of tables for users.
///
/// # Errors
/// As [`to_batch`].
pub fn to_nullable_batch<R: Row>(rows: &[R]) -> Result<RecordBatch, RowError> {
    let batch = to_batch(rows)?;
    let fields = batch.schema_ref().fields().iter().map(|field| field.as_ref().clone().with_nullable(true));
    let schema = Arc::new(Schema::new(fields.collect::<Vec<_>>()));
    Ok(batch.with_schema(schema)?)
}
/// Columns as rows; other columns are ignored.
///
/// # Errors
/// [`RowError::Column`] when a column is missing or has another type; [`RowError::Value`] when a cell is out of range,
/// or empty where a value is required.
pub fn from_batch<R: Row + FromCells>(batch: &RecordBatch) -> Result<Vec<R>, RowError> {
    let columns = R::columns("", "");
    let arrays = columns.iter().map(|column| typed(batch, column)).collect::<Result<Vec<_>, _>>()?;
    (0..batch.num_rows())
        .map(|row| R::read(&mut CellReader { columns: &columns, arrays: &arrays, row, next: 0 }))
        .collect()
}

fn typed<'a>(batch: &'a RecordBatch, column: &Column) -> Result<&'a ArrayRef, RowError> {
    let problem = |problem: String| RowError::Column { column: column.name, problem };
    let array = batch.column_by_name(column.name).ok_or_else(|| problem("is missing".to_owned()))?;
    let is_alike = match (array.data_type(), &column.data_type) {
        // Other programs name the elements of lists, and the zone of times, otherwise.
        (DataType::List(found), DataType::List(wanted)) => found.data_type() == wanted.data_type(),
        (DataType::Timestamp(found, _), DataType::Timestamp(wanted, _)) => found == wanted,
        (found, wanted) => found == wanted,
    };
    let wrong = || problem(format!("holds {}, where {} is wanted", array.data_type(), column.data_type));
    is_alike.then_some(array).ok_or_else(wrong)
}

/// Reads the cells of one row, in the order of the declared columns.
pub struct CellReader<'a> {
    columns: &'a [Column],
    arrays: &'a [&'a ArrayRef],
    row: usize,
    next: usize,
}

impl<'a> CellReader<'a> {
    /// The array of the next cell; `None` where the cell is empty.
    fn take(&mut self) -> Option<&'a ArrayRef> {
        self.next += 1;
        Some(self.arrays[self.next - 1]).filter(|array| array.is_valid(self.row))
    }

    fn problem(&self, problem: impl Into<String>) -> RowError {
        RowError::Value { column: self.columns[self.next - 1].name, row: self.row, problem: problem.into() }
    }

    fn required<T>(&mut self, read: impl FnOnce(&mut Self) -> Option<T>) -> Result<T, RowError> {
        read(self).ok_or_else(|| self.problem("is empty, where a value is wanted"))
    }

    fn text(&mut self) -> Option<&'a str> {
        Some(self.take()?.as_string::<i32>().value(self.row))
    }

    pub(crate) fn parse<T, E: ToString>(
        &mut self,
        parse: impl FnOnce(&'a str) -> Result<T, E>,
    ) -> Result<T, RowError> {
        parse(self.required(Self::text)?).map_err(|problem| self.problem(problem.to_string()))
    }

    fn list(&mut self) -> Option<ArrayRef> {
        Some(self.take()?.as_list::<i32>().value(self.row))
    }

    fn texts(&mut self) -> Vec<String> {
        let list = self.list();
        let texts = list.as_ref().and_then(|list| list.as_string_opt::<i32>());
        texts.into_iter().flatten().flatten().map(str::to_owned).collect()
    }

    fn numbers(&mut self) -> Vec<f64> {
        let list = self.list();
        let numbers = list.as_ref().and_then(|list| list.as_primitive_opt::<Float64Type>());
        numbers.into_iter().flatten().flatten().collect()
    }

    fn primitive<T: ArrowPrimitiveType>(&mut self) -> Option<T::Native> {
        Some(self.take()?.as_primitive::<T>().value(self.row))
    }

    fn time(&mut self) -> Result<Option<Timestamp>, RowError> {
        let Some(micros) = self.primitive::<TimestampMicrosecondType>() else { return Ok(None) };
        let time = Timestamp::from_microsecond(micros);
        time.map(Some).map_err(|e| self.problem(format!("{micros} µs since 1970 is no time: {e}")))
    }
}

/// Implements [`Cells`] for a type of cell: its Arrow type, whether it may be empty, and its array.
macro_rules! cell {
    ($type:ty, $data_type:expr, nullable: $nullable:literal, |$cells:ident| $array:expr) => {
        impl Cells for $type {
            fn columns(name: &'static str, doc: &'static str) -> Vec<Column> {
                vec![Column { name, data_type: $data_type, nullable: $nullable, doc }]
            }

            fn arrays($cells: &[&Self]) -> Arrays {
                vec![Arc::new($array)]
            }
        }
    };
}

/// Implements [`FromCells`] for a type of cell.
macro_rules! read_cell {
    ($type:ty, |$reader:ident| $read:expr) => {
        impl FromCells for $type {
            fn read($reader: &mut CellReader<'_>) -> Result<Self, RowError> {
                $read
            }
        }
    };
}

/// Implements [`Cells`] and [`FromCells`] for a text type by `as_str` and a function that parses it.
macro_rules! text_cell {
    ($type:ty, $parse:expr) => {
        impl $crate::row_schema::Cells for $type {
            fn columns(name: &'static str, doc: &'static str) -> Vec<$crate::row_schema::Column> {
                <&'static str as $crate::row_schema::Cells>::columns(name, doc)
            }

            fn arrays(cells: &[&Self]) -> $crate::row_schema::Arrays {
                let texts = cells.iter().map(|cell| Some(cell.as_str()));
                vec![std::sync::Arc::new(texts.collect::<arrow::array::StringArray>())]
            }
        }

        impl $crate::row_schema::FromCells for $type {
            fn read(
                cells: &mut $crate::row_schema::CellReader<'_>,
            ) -> Result<Self, $crate::row_schema::RowError> {
                cells.parse($parse)
            }
        }
    };
}
pub(crate) use text_cell;

/// Makes an enum a type of cell, whose words are those of its derived `IntoStaticStr` and `EnumString`.
macro_rules! word_cell {
    ($type:ty) => {
        impl $type {
            /// Its word in the column.
            pub fn as_str(self) -> &'static str {
                self.into()
            }
        }

        $crate::row_schema::text_cell!($type, |word| {
            word.parse().map_err(|_| format!("`{word}` is none of its words"))
        });
    };
}
pub(crate) use word_cell;

cell!(&'static str, DataType::Utf8, nullable: false, |cells| cells.iter().map(|c| Some(**c)).collect::<StringArray>());
cell!(Option<&'static str>, DataType::Utf8, nullable: true, |cells| cells.iter().map(|c| **c).collect::<StringArray>());
cell!(String, DataType::Utf8, nullable: false, |cells| cells.iter().map(Some).collect::<StringArray>());
cell!(Arc<str>, DataType::Utf8, nullable: false, |cells| cells.iter().map(|c| Some(&***c)).collect::<StringArray>());
cell!(Box<str>, DataType::Utf8, nullable: false, |cells| cells.iter().map(|c| Some(&***c)).collect::<StringArray>());
cell!(Option<String>, DataType::Utf8, nullable: true, |cells| cells
    .iter()
    .map(|c| c.as_deref())
    .collect::<StringArray>());
cell!(Vec<String>, DataType::List(element(DataType::Utf8)), nullable: false, |cells| texts(cells));
cell!(Vec<f64>, DataType::List(element(DataType::Float64)), nullable: true, |cells| numbers(cells));
cell!(f64, DataType::Float64, nullable: false, |cells| cells.iter().map(|c| Some(**c)).collect::<Float64Array>());
cell!(Option<f64>, DataType::Float64, nullable: true, |cells| cells
    .iter()
    .map(|c| c.filter(|value| value.is_finite()))
    .collect::<Float64Array>());
cell!(i64, DataType::Int64, nullable: false, |cells| cells.iter().map(|c| Some(**c)).collect::<Int64Array>());
cell!(Option<i64>, DataType::Int64, nullable: true, |cells| cells.iter().map(|c| **c).collect::<Int64Array>());
cell!(bool, DataType::Boolean, nullable: false, |cells| cells.iter().map(|c| Some(**c)).collect::<BooleanArray>());
cell!(Timestamp, time_type(), nullable: false, |cells| times(cells.iter().map(|c| Some(**c))));
cell!(Option<Timestamp>, time_type(), nullable: true, |cells| times(cells.iter().map(|c| **c)));

read_cell!(String, |cells| cells.parse(|text| Ok::<_, String>(text.to_owned())));
read_cell!(Option<String>, |cells| Ok(cells.text().map(str::to_owned)));
read_cell!(Vec<String>, |cells| Ok(cells.texts()));
read_cell!(Vec<f64>, |cells| Ok(cells.numbers()));
read_cell!(f64, |cells| cells.required(CellReader::primitive::<Float64Type>));
read_cell!(Option<f64>, |cells| Ok(cells.primitive::<Float64Type>().filter(|value| value.is_finite())));
read_cell!(i64, |cells| cells.required(CellReader::primitive::<Int64Type>));
read_cell!(Option<i64>, |cells| Ok(cells.primitive::<Int64Type>()));
read_cell!(Timestamp, |cells| {
    let time = cells.time()?;
    cells.required(|_| time)
});
read_cell!(Option<Timestamp>, |cells| cells.time());

text_cell!(TailNumber, TailNumber::new);
text_cell!(Position, Position::new);
text_cell!(PartNumber, PartNumber::new);
text_cell!(SerialNumber, SerialNumber::new);
text_cell!(FlightId, FlightId::new);

/// Rows of another type in each row: a list of structs.
impl<R: Row> Cells for Vec<R> {
    fn columns(name: &'static str, doc: &'static str) -> Vec<Column> {
        let data_type = DataType::List(struct_element::<R>());
        vec![Column { name, data_type, nullable: false, doc }]
    }

    fn arrays(cells: &[&Self]) -> Arrays {
        let rows: Vec<&R> = cells.iter().flat_map(|rows| rows.iter()).collect();
        let structs = StructArray::new(struct_fields::<R>(), R::arrays(&rows), None);
        let lengths = OffsetBuffer::from_lengths(cells.iter().map(|rows| rows.len()));
        vec![Arc::new(ListArray::new(struct_element::<R>(), lengths, Arc::new(structs), None))]
    }
}

fn struct_fields<R: Row>() -> Fields {
    R::columns("", "").iter().map(|column| column.field().with_nullable(true)).collect()
}

fn struct_element<R: Row>() -> Arc<Field> {
    Arc::new(Field::new("item", DataType::Struct(struct_fields::<R>()), true))
}

/// A field of a row type that is no column.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct NoColumn<T>(pub T);

impl<T> Cells for NoColumn<T> {
    fn columns(_: &'static str, _: &'static str) -> Vec<Column> {
        Vec::new()
    }

    fn arrays(_: &[&Self]) -> Arrays {
        Vec::new()
    }
}

/// Element of a list, as Delta Lake names it.
fn element(data_type: DataType) -> Arc<Field> {
    Arc::new(Field::new("element", data_type, true))
}

/// Type of every time: microseconds, UTC.
pub fn time_type() -> DataType {
    DataType::Timestamp(TimeUnit::Microsecond, Some("UTC".into()))
}

fn times(times: impl Iterator<Item = Option<Timestamp>>) -> TimestampMicrosecondArray {
    let micros = times.map(|time| time.map(Timestamp::as_microsecond));
    micros.collect::<TimestampMicrosecondArray>().with_timezone("UTC")
}

/// Lists of numbers; an empty one is a null.
fn numbers(cells: &[&Vec<f64>]) -> ListArray {
    let mut lists = ListBuilder::new(Float64Builder::new()).with_field(element(DataType::Float64));
    for numbers in cells {
        lists.append_option((!numbers.is_empty()).then(|| numbers.iter().map(|number| Some(*number))));
    }
    lists.finish()
}

fn texts(cells: &[&Vec<String>]) -> ListArray {
    let mut lists = ListBuilder::new(StringBuilder::new()).with_field(element(DataType::Utf8));
    for texts in cells {
        lists.append_value(texts.iter().map(Some));
    }
    lists.finish()
}
