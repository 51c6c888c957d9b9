//! Mapping of a row type to a table: every column is declared once, and read back in the same order.

use std::sync::Arc;

use arrow::array::{
    Array, ArrayRef, AsArray, Float64Array, Int64Array, ListArray, ListBuilder, RecordBatch, StringArray,
    StringBuilder, TimestampMicrosecondArray,
};
use arrow::datatypes::{
    DataType, Field, Float64Type, Int64Type, Schema, SchemaRef, TimeUnit, TimestampMicrosecondType,
};
use jiff::Timestamp;

use crate::error::Error;

/// What a column takes out of a row.
pub(crate) enum Getter<R> {
    Text(fn(&R) -> Option<&str>),
    Texts(fn(&R) -> &[String]),
    Number(fn(&R) -> Option<f64>),
    Count(fn(&R) -> Option<i64>),
    Time(fn(&R) -> Option<Timestamp>),
}

/// A column: its name, whether it may be empty, what it holds.
pub(crate) struct Column<R> {
    pub(crate) name: &'static str,
    nullable: bool,
    get: Getter<R>,
}

impl<R> Column<R> {
    pub(crate) const fn required(name: &'static str, get: Getter<R>) -> Self {
        Self { name, nullable: false, get }
    }

    pub(crate) const fn nullable(name: &'static str, get: Getter<R>) -> Self {
        Self { name, nullable: true, get }
    }

    fn field(&self) -> Field {
        let data_type = match self.get {
            Getter::Text(_) => DataType::Utf8,
            Getter::Texts(_) => DataType::List(element()),
            Getter::Number(_) => DataType::Float64,
            Getter::Count(_) => DataType::Int64,
            Getter::Time(_) => time(),
        };
        Field::new(self.name, data_type, self.nullable)
    }

    fn array(&self, rows: &[R]) -> ArrayRef {
        match self.get {
            Getter::Text(get) => Arc::new(rows.iter().map(get).collect::<StringArray>()),
            Getter::Texts(get) => Arc::new(texts(rows.iter().map(get))),
            Getter::Number(get) => Arc::new(rows.iter().map(get).collect::<Float64Array>()),
            Getter::Count(get) => Arc::new(rows.iter().map(get).collect::<Int64Array>()),
            Getter::Time(get) => {
                let micros = rows.iter().map(|r| get(r).map(Timestamp::as_microsecond));
                Arc::new(micros.collect::<TimestampMicrosecondArray>().with_timezone("UTC"))
            }
        }
    }
}

/// Delta's name for what a list holds.
pub(crate) fn element() -> Arc<Field> {
    Arc::new(Field::new("element", DataType::Utf8, true))
}

/// The one type of all times: microseconds, UTC.
pub(crate) fn time() -> DataType {
    DataType::Timestamp(TimeUnit::Microsecond, Some("UTC".into()))
}

fn texts<'a>(rows: impl Iterator<Item = &'a [String]>) -> ListArray {
    let mut lists = ListBuilder::new(StringBuilder::new()).with_field(element());
    for row in rows {
        lists.append_value(row.iter().map(Some));
    }
    lists.finish()
}

/// A row type that has a table.
pub(crate) trait RowSchema: Sized + 'static {
    /// The table's columns, in order.
    const COLUMNS: &'static [Column<Self>];

    /// Makes a row out of its cells, which come in the order of the columns.
    fn from_cells(cells: &mut CellReader<'_>) -> Result<Self, Error>;
}

/// The table's columns with their types.
pub(crate) fn schema<R: RowSchema>() -> SchemaRef {
    Arc::new(Schema::new(R::COLUMNS.iter().map(Column::field).collect::<Vec<_>>()))
}

/// Rows as columns.
pub(crate) fn to_batch<R: RowSchema>(rows: &[R]) -> Result<RecordBatch, Error> {
    let arrays = R::COLUMNS.iter().map(|column| column.array(rows)).collect();
    Ok(RecordBatch::try_new(schema::<R>(), arrays)?)
}

/// Columns as rows; columns of other names are passed over.
///
/// # Errors
/// [`Error::Column`] when one is missing or of another type; [`Error::Value`] when a cell is out of
/// range or empty where it must not be.
pub(crate) fn from_batch<R: RowSchema>(batch: &RecordBatch) -> Result<Vec<R>, Error> {
    let arrays = R::COLUMNS.iter().map(|column| typed(batch, column)).collect::<Result<Vec<_>, _>>()?;
    let names: Vec<&'static str> = R::COLUMNS.iter().map(|column| column.name).collect();
    (0..batch.num_rows())
        .map(|row| R::from_cells(&mut CellReader { names: &names, arrays: &arrays, row, next: 0 }))
        .collect()
}

fn typed<'a, R>(batch: &'a RecordBatch, column: &Column<R>) -> Result<TypedArray<'a>, Error> {
    let problem = |problem: String| Error::Column { column: column.name.to_owned(), problem };
    let array = batch.column_by_name(column.name).ok_or_else(|| problem("is not there".to_owned()))?;
    let typed = match column.get {
        Getter::Text(_) => array.as_string_opt().map(TypedArray::Text),
        Getter::Texts(_) => array.as_list_opt().map(TypedArray::Texts),
        Getter::Number(_) => array.as_primitive_opt::<Float64Type>().map(TypedArray::Number),
        Getter::Count(_) => array.as_primitive_opt::<Int64Type>().map(TypedArray::Count),
        Getter::Time(_) => array.as_primitive_opt::<TimestampMicrosecondType>().map(TypedArray::Time),
    };
    typed.ok_or_else(|| {
        problem(format!("holds {}, where {} is wanted", array.data_type(), column.field().data_type()))
    })
}

enum TypedArray<'a> {
    Text(&'a StringArray),
    Texts(&'a ListArray),
    Number(&'a Float64Array),
    Count(&'a Int64Array),
    Time(&'a TimestampMicrosecondArray),
}

/// One row's cells, taken one after the other in the order of the columns.
pub(crate) struct CellReader<'a> {
    names: &'a [&'static str],
    arrays: &'a [TypedArray<'a>],
    row: usize,
    next: usize,
}

impl<'a> CellReader<'a> {
    fn take(&mut self) -> &'a TypedArray<'a> {
        self.next += 1;
        &self.arrays[self.next - 1]
    }

    /// What is wrong with the cell taken last.
    fn problem(&self, problem: impl Into<String>) -> Error {
        Error::Value { column: self.names[self.next - 1], row: self.row, problem: problem.into() }
    }

    fn there<T>(&self, value: Option<T>) -> Result<T, Error> {
        value.ok_or_else(|| self.problem("is empty, where a value is wanted"))
    }

    pub(crate) fn text_or_none(&mut self) -> Option<&'a str> {
        match self.take() {
            TypedArray::Text(array) => array.is_valid(self.row).then(|| array.value(self.row)),
            _ => None,
        }
    }

    pub(crate) fn text(&mut self) -> Result<&'a str, Error> {
        let text = self.text_or_none();
        self.there(text)
    }

    pub(crate) fn owned_or_none(&mut self) -> Option<String> {
        self.text_or_none().map(str::to_owned)
    }

    pub(crate) fn owned(&mut self) -> Result<String, Error> {
        self.text().map(str::to_owned)
    }

    /// A text that must be something: a name, a status.
    pub(crate) fn parse<T, E: ToString>(
        &mut self,
        parse: impl FnOnce(&'a str) -> Result<T, E>,
    ) -> Result<T, Error> {
        let text = self.text()?;
        parse(text).map_err(|problem| self.problem(problem.to_string()))
    }

    pub(crate) fn texts(&mut self) -> Vec<String> {
        match self.take() {
            TypedArray::Texts(lists) if lists.is_valid(self.row) => {
                let list = lists.value(self.row);
                list.as_string_opt::<i32>().into_iter().flatten().flatten().map(str::to_owned).collect()
            }
            _ => Vec::new(),
        }
    }

    pub(crate) fn number(&mut self) -> Option<f64> {
        match self.take() {
            TypedArray::Number(array) => array.is_valid(self.row).then(|| array.value(self.row)),
            _ => None,
        }
    }

    pub(crate) fn count_or_none(&mut self) -> Option<i64> {
        match self.take() {
            TypedArray::Count(array) => array.is_valid(self.row).then(|| array.value(self.row)),
            _ => None,
        }
    }

    pub(crate) fn count(&mut self) -> Result<i64, Error> {
        let count = self.count_or_none();
        self.there(count)
    }

    pub(crate) fn time_or_none(&mut self) -> Result<Option<Timestamp>, Error> {
        let micros = match self.take() {
            TypedArray::Time(array) => array.is_valid(self.row).then(|| array.value(self.row)),
            _ => None,
        };
        let time = micros.map(Timestamp::from_microsecond).transpose();
        time.map_err(|e| {
            self.problem(format!("{} µs since 1970 is no time: {e}", micros.unwrap_or_default()))
        })
    }

    pub(crate) fn time(&mut self) -> Result<Timestamp, Error> {
        let time = self.time_or_none()?;
        self.there(time)
    }
}
