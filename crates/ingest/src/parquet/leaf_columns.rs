//! Leaf columns of named channels: top-level columns, or fields inside structs and lists.
//!
//! `motor.angle_deg` is first read as the plain name of a column, since `SYSTEM.CHANNEL` is an
//! ordinary name in flight logs; else as field `angle_deg` of struct `motor`. Lists are passed through
//! without a name of their own: a list is simply more samples in one row.

use std::sync::Arc;

use arrow::array::{Array, ArrayRef, AsArray, BooleanArray, UInt64Array};
use arrow::compute::{nullif, take};
use arrow::datatypes::{DataType, Field, Fields};

use crate::error::{Fault, list_lengths};
use crate::mapping::column_pattern::composed;
use crate::parquet::numeric::wrong_type;

#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct LeafColumn {
    /// Its name: that of its column, with the fields below joined by dots, and with composed accents.
    pub(crate) name: String,
    /// Its number among the file's leaves.
    pub(crate) index: usize,
    /// Number of the top-level column that contains it.
    pub(crate) root: usize,
    /// Whether it is a field of a struct.
    pub(crate) is_field: bool,
    /// The type of one of its values.
    pub(crate) kind: DataType,
    /// Whether lists lie on the way to it.
    pub(crate) is_listed: bool,
}

/// All leaves of a schema, in the order of the file.
pub(crate) fn leaves(fields: &Fields) -> Vec<LeafColumn> {
    let mut found = Vec::new();
    for (root, field) in fields.iter().enumerate() {
        let (name, kind) = (composed(field.name()).into_owned(), DataType::Null);
        let column = LeafColumn { name, index: 0, root, is_field: false, kind, is_listed: false };
        walk(field, column, &mut found);
    }
    found
}

/// Adds the leaves of a field; `path` is a leaf as far as the way to the field determines it.
fn walk(field: &Field, path: LeafColumn, found: &mut Vec<LeafColumn>) {
    match field.data_type() {
        DataType::Struct(inner) => {
            for field in inner {
                let name = format!("{}.{}", path.name, composed(field.name()));
                walk(field, LeafColumn { name, is_field: true, ..path.clone() }, found);
            }
        }
        DataType::List(inner) | DataType::Map(inner, _) => {
            walk(inner, LeafColumn { is_listed: true, ..path }, found);
        }
        kind => found.push(LeafColumn { index: found.len(), kind: kind.clone(), ..path }),
    }
}

/// A leaf's values in a batch, and how many of them each row holds where lists lie on the way.
pub(crate) struct FlatLeaf {
    /// The values of all rows, one after the other.
    pub(crate) values: ArrayRef,
    /// Values for each row; none when it is one each.
    pub(crate) lengths: Option<Vec<usize>>,
}

/// Goes down from a column, read with this leaf alone, to the leaf's values.
pub(crate) fn flatten(column: &ArrayRef) -> FlatLeaf {
    let (mut values, mut lengths) = (Arc::clone(column), None);
    loop {
        values = match values.data_type() {
            DataType::Struct(_) => field_of(&values),
            DataType::List(_) | DataType::Map(..) => {
                let (inner, counts) = list_values(&values);
                lengths = Some(lengths_per_outer_row(lengths, &counts));
                inner
            }
            _ => return FlatLeaf { values, lengths },
        };
    }
}

/// The only field that was read; where the struct is null, so is its field.
fn field_of(array: &ArrayRef) -> ArrayRef {
    let record = array.as_struct();
    let inner = record.column(0);
    let hidden =
        record.nulls().and_then(|nulls| nullif(inner, &BooleanArray::new(!nulls.inner(), None)).ok());
    hidden.unwrap_or_else(|| Arc::clone(inner))
}

/// The values of all lists of an array, and how many each list holds. Without the Arrow schema of its writer, every list of
/// a file is read as one of 32-bit offsets.
fn list_values(array: &ArrayRef) -> (ArrayRef, Vec<usize>) {
    let (offsets, values): (_, &dyn Array) = match array.as_map_opt() {
        Some(map) => (map.offsets(), map.entries()),
        None => (array.as_list::<i32>().offsets(), array.as_list::<i32>().values()),
    };
    let lengths: Vec<usize> = offsets.lengths().collect();
    (values.slice(offsets[0] as usize, lengths.iter().sum()), lengths)
}

/// Number of values of each outer row, from the number of values of each inner row.
fn lengths_per_outer_row(outer: Option<Vec<usize>>, inner: &[usize]) -> Vec<usize> {
    let Some(outer) = outer else { return inner.to_vec() };
    let mut rest = inner.iter();
    outer.iter().map(|&rows| rest.by_ref().take(rows).sum()).collect()
}

/// Brings leaves of one batch to the same number of samples: where one of them is a list, a value that
/// stands once for its row is repeated for every sample in it.
pub(crate) fn align_lengths(names: &[&str], flats: Vec<FlatLeaf>) -> Result<Vec<ArrayRef>, Fault> {
    let Some(listed) = flats.iter().position(|flat| flat.lengths.is_some()) else {
        return Ok(flats.into_iter().map(|flat| flat.values).collect());
    };
    let lengths = flats[listed].lengths.clone().unwrap_or_default();
    let differs = |flat: &FlatLeaf| flat.lengths.as_ref().is_some_and(|l| *l != lengths);
    if let Some(other) = flats.iter().position(differs) {
        return Err(list_lengths(names[other], names[listed]));
    }
    let rows: UInt64Array =
        lengths.iter().enumerate().flat_map(|(row, &n)| std::iter::repeat_n(row as u64, n)).collect();
    let spread = |(name, flat): (&&str, FlatLeaf)| match flat.lengths {
        Some(_) => Ok(flat.values),
        None => take(&flat.values, &rows, None).map_err(|_| {
            wrong_type(name, &flat.values, "a type that can be repeated for each item of a list")
        }),
    };
    names.iter().zip(flats).map(spread).collect()
}

#[cfg(test)]
mod tests {
    use arrow::array::{Float64Array, StructArray};
    use arrow::buffer::NullBuffer;

    use super::*;

    #[test]
    fn a_null_struct_has_null_fields() {
        let inner: ArrayRef = Arc::new(Float64Array::from(vec![1.0, 2.0]));
        let fields = Fields::from(vec![Field::new("x", DataType::Float64, false)]);
        let record = StructArray::new(fields, vec![inner], Some(NullBuffer::from(vec![true, false])));
        let flat = flatten(&(Arc::new(record) as ArrayRef));
        assert!(flat.values.is_valid(0) && flat.values.is_null(1));
    }
}
