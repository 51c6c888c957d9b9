//! Truncated, empty or inconsistent files: each gives an error with a stable code, never a number.

use std::path::Path;
use std::sync::Arc;

use arrow::array::{ArrayRef, StructArray};
use arrow::datatypes::{DataType, Field};

use crate::layouts::{only, plain, read, reals, refusal};

fn values() -> ArrayRef {
    reals((0..2000).map(f64::from))
}

/// Columns of these names.
fn named<const N: usize>(names: [&str; N]) -> [(&str, ArrayRef); N] {
    names.map(|name| (name, values()))
}

/// Two columns of one name: neither is taken, and the error names them.
#[test]
fn a_name_that_two_columns_have_is_refused() {
    for column in ["t", "s"] {
        let found = refusal(&plain(), &named(["t", "m", "s", "f", column]));
        assert_eq!((found.code.as_str(), found.column.as_deref()), ("duplicate_column", Some(column)));
    }
    assert!(only(&plain(), &named(["t", "m", "s", "f", "spare", "spare"])).is_ok());
}

#[test]
fn a_struct_in_place_of_a_number_is_named_with_its_fields() {
    let field = |name: &str| (Arc::new(Field::new(name, DataType::Float64, true)), values());
    let record: ArrayRef = Arc::new(StructArray::from(["deg", "raw"].map(field).to_vec()));
    let [t, s, f] = named(["t", "s", "f"]);
    let found = refusal(&plain(), &[t, ("m", record), s, f]);
    assert_eq!((found.code.as_str(), found.column.as_deref()), ("column_type", Some("m")));
    assert!(found.to_string().contains("`deg`, `raw`"), "{found}");
}

/// Files that pyarrow 26.0.1 wrote with an encrypted footer, with an encrypted column under a plain footer, and one
/// whose footer names encoding 10, which is ALP in the format's list of encodings.
#[test]
fn encrypted_files_and_new_encodings_are_named() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data");
    let mut m = plain();
    m.clock.column = Some("t".into());
    let diagnostic = |name: &str| read(&folder.join(name), &m).unwrap_err().diagnostic();
    assert_eq!(diagnostic("encrypted_footer.parquet").code, "encrypted");
    let column = diagnostic("encrypted_column.parquet");
    assert_eq!(column.code, "encrypted");
    assert!(column.message.contains("`m`"), "{column}");
    let alp = diagnostic("alp.parquet");
    assert_eq!(alp.code, "encoding_unsupported");
    assert!(alp.message.contains("ALP"), "{alp}");
}
