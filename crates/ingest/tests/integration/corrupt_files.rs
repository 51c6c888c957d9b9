//! Truncated, empty or inconsistent files: each gives an error with a stable code, never a number.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use arrow::array::{ArrayRef, StructArray};
use arrow::datatypes::{DataType, Field};
use ingest::mapping::units::Unit;
use ingest::{Log, LogFiles};

use crate::layouts::{channel, only, opened, place, plain, read, reals, refusal, write};

fn values() -> ArrayRef {
    reals((0..2000).map(f64::from))
}

/// Columns of these names.
fn named<const N: usize>(names: [&str; N]) -> [(&str, ArrayRef); N] {
    names.map(|name| (name, values()))
}

fn sound(file: &Path) -> Vec<u8> {
    write(file, &named(["t", "m", "s", "f"]));
    fs::read(file).unwrap()
}

#[test]
fn files_that_are_no_logs_are_distinguished() {
    let (_dir, file) = place("hdf.parquet");
    let bytes = sound(&file);
    let refused = |bytes: &[u8]| {
        fs::write(&file, bytes).unwrap();
        let error = Log::open(&LogFiles::one(&file), &Arc::new(plain())).unwrap_err().diagnostic();
        assert_eq!(error.code, "not_parquet", "{error}");
        error.message
    };
    let others: [(&[u8], &str); 5] = [
        (b"\x89HDF\r\n\x1a\n", "an HDF5 file"),
        (b"\xef\xbb\xbfZeit;Winkel\r\n0,0;1,0\r\n", "a CSV file"),
        (b"MDF     4.10    asammdf ", "an MDF file (ASAM)"),
        (b"{\"a\": 1}", "a JSON file"),
        (&[0; 64], "not a Parquet file"),
    ];
    for (bytes, format) in others {
        assert!(refused(bytes).contains(format), "{format}");
    }
    for cut in [4, bytes.len() / 3, bytes.len() / 2, bytes.len() - 9, bytes.len() - 1] {
        assert!(refused(&bytes[..cut]).contains("truncated"), "cut at {cut}");
    }
    write(&file, &[("t", reals([]))]);
    assert_eq!(read(&file, &plain()).unwrap_err().diagnostic().code, "empty_log");
}

/// The digest must notice what a reader without page checksums cannot.
#[test]
fn a_flipped_byte_changes_the_digest() {
    let (dir, file) = place("whole.parquet");
    let mut bytes = sound(&file);
    let m = plain();
    let digest = |file: &Path| {
        let log = opened(file, &m);
        let positions = log.actuators(&m.channels, Some(&records::Position::new("a").unwrap())).unwrap();
        log.digest(&[(&m.channels, &positions[0])]).unwrap()
    };
    let (before, moved) = (digest(&file), dir.path().join("flipped.parquet"));
    fs::write(&moved, &bytes).unwrap();
    assert_eq!(digest(&moved), before, "a renamed log is the same log");
    bytes[100] ^= 1;
    fs::write(&moved, &bytes).unwrap();
    assert_ne!(digest(&moved), before);
}

#[test]
fn a_clock_without_a_unit_is_never_guessed() {
    let mut m = plain();
    m.clock.unit = None;
    assert_eq!(refusal(&m, &named(["t", "m", "s", "f"])).code, "time_unit_unknown");
    m.clock.column = None;
    assert_eq!(refusal(&m, &named(["t", "m", "s", "f"])).code, "no_clock");
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

/// A byte order mark before a name, a no-break space and a Cyrillic letter in one show by their code points.
#[test]
fn names_that_look_alike_are_told_apart() {
    for (logged, mapped, point) in [
        ("\u{feff}screw_mm", "screw_mm", "U+FEFF"),
        ("screw\u{a0}mm", "screw mm", "U+00A0"),
        ("scr\u{435}w_mm", "screw_mm", "U+0435"),
    ] {
        let mut m = plain();
        m.channels.screw_position = Some(channel(mapped, Unit::Metre));
        let hint = refusal(&m, &named(["t", "m", logged, "f"])).hint.unwrap();
        assert!(hint.contains(point), "{hint}");
    }
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
