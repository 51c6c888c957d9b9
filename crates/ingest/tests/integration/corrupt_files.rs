//! Truncated, empty or inconsistent files: each gives an error with a stable code, never a number.

use std::path::Path;
use std::sync::Arc;

use arrow::array::{ArrayRef, StructArray};
use arrow::datatypes::{DataType, Field};
use ingest::mapping::units::Unit;
use ingest::{Error, Log, LogFiles};

use crate::layouts::{channel, place, plain, read, reals, write};

fn values() -> ArrayRef {
    reals((0..2000).map(f64::from))
}

fn sound(file: &Path) {
    write(file, &["t", "m", "s", "f"].map(|name| (name, values())));
}

fn code(result: Result<Log, Error>) -> String {
    result.err().map(|e| e.diagnostic().code).unwrap_or_default()
}

#[test]
fn files_that_are_no_logs_are_distinguished() {
    let (dir, file) = place("hdf.parquet");
    let open = |file: &Path| Log::open(&LogFiles::one(file), &Arc::new(plain()));
    let others: [(&[u8], &str); 5] = [
        (b"\x89HDF\r\n\x1a\n", "an HDF5 file"),
        (b"\xef\xbb\xbfZeit;Winkel\r\n0,0;1,0\r\n", "a CSV file"),
        (b"MDF     4.10    asammdf ", "an MDF file (ASAM)"),
        (b"{\"a\": 1}", "a JSON file"),
        (&[0; 64], "not a Parquet file"),
    ];
    for (bytes, format) in others {
        std::fs::write(&file, bytes).unwrap();
        let foreign = open(&file).unwrap_err().diagnostic();
        assert!(foreign.message.contains(format) && foreign.code == "not_parquet", "{foreign}");
    }
    write(&file, &[("t", reals([]))]);
    assert_eq!(code(open(&file)), "empty_log");
    std::fs::write(&file, b"PARE\x00\x00\x00\x00PARE").unwrap();
    assert_eq!(code(open(&file)), "encrypted");
    assert_eq!(code(open(&dir.path().join("none.parquet"))), "unreadable");
    sound(&file);
    let bytes = std::fs::read(&file).unwrap();
    for cut in [4, bytes.len() / 3, bytes.len() / 2, bytes.len() - 9, bytes.len() - 1] {
        std::fs::write(&file, &bytes[..cut]).unwrap();
        assert_eq!(code(open(&file)), "not_parquet", "cut at {cut}");
    }
}

/// The digest must notice what a reader without page checksums cannot.
#[test]
fn a_flipped_byte_changes_the_digest() {
    let (dir, file) = place("whole.parquet");
    sound(&file);
    let m = plain();
    let digest = |file: &Path| {
        let log = Log::open(&LogFiles::one(file), &Arc::new(m.clone())).unwrap();
        let positions = log.actuators(&m.channels, Some(&records::Position::new("a").unwrap())).unwrap();
        log.digest(&[(&m.channels, &positions[0])]).unwrap()
    };
    let before = digest(&file);
    let mut bytes = std::fs::read(&file).unwrap();
    bytes[100] ^= 1;
    let moved = dir.path().join("flipped.parquet");
    std::fs::write(&moved, &bytes).unwrap();
    assert_ne!(digest(&moved), before);
    bytes[100] ^= 1;
    std::fs::write(&moved, &bytes).unwrap();
    assert_eq!(digest(&moved), before, "a renamed log is the same log");
}

#[test]
fn a_clock_without_a_unit_is_never_guessed() {
    let (_dir, file) = place("whole.parquet");
    sound(&file);
    let mut m = plain();
    m.clock.unit = None;
    assert_eq!(read(&file, &m).unwrap_err().diagnostic().code, "time_unit_unknown");
    m.clock.column = None;
    assert_eq!(read(&file, &m).unwrap_err().diagnostic().code, "no_clock");
}

/// Two columns of one name: neither is taken, and the error names them.
#[test]
fn a_name_that_two_columns_have_is_refused() {
    let (_dir, file) = place("twice.parquet");
    let values = values();
    for column in ["t", "s"] {
        write(&file, &["t", "m", "s", "f", column].map(|name| (name, Arc::clone(&values))));
        let diagnostic = read(&file, &plain()).unwrap_err().diagnostic();
        let found = (diagnostic.code.as_str(), diagnostic.column.as_deref());
        assert_eq!(found, ("duplicate_column", Some(column)));
    }
    write(&file, &["t", "m", "s", "f", "spare", "spare"].map(|name| (name, Arc::clone(&values))));
    assert!(read(&file, &plain()).is_ok());
}

#[test]
fn a_struct_in_place_of_a_number_is_named_with_its_fields() {
    let (_dir, file) = place("struct.parquet");
    let values = values();
    let field = |name: &str| Arc::new(Field::new(name, DataType::Float64, true));
    let fields = ["deg", "raw"].map(|name| (field(name), Arc::clone(&values)));
    let record: ArrayRef = Arc::new(StructArray::from(fields.to_vec()));
    write(&file, &[("t", Arc::clone(&values)), ("m", record), ("s", Arc::clone(&values)), ("f", values)]);
    let diagnostic = read(&file, &plain()).unwrap_err().diagnostic();
    assert_eq!((diagnostic.code.as_str(), diagnostic.column.as_deref()), ("column_type", Some("m")));
    assert!(diagnostic.to_string().contains("`deg`, `raw`"), "{diagnostic}");
}

/// A byte order mark before a name, a no-break space and a Cyrillic letter in one show by their code points.
#[test]
fn names_that_look_alike_are_told_apart() {
    let (_dir, file) = place("alike.parquet");
    let values = values();
    let alike = [
        ("\u{feff}screw_mm", "screw_mm", "U+FEFF"),
        ("screw\u{a0}mm", "screw mm", "U+00A0"),
        ("scr\u{435}w_mm", "screw_mm", "U+0435"),
    ];
    for (logged, mapped, point) in alike {
        write(&file, &["t", "m", logged, "f"].map(|name| (name, Arc::clone(&values))));
        let mut m = plain();
        m.channels.screw_position = Some(channel(mapped, Unit::Metre));
        let hint = read(&file, &m).unwrap_err().diagnostic().hint.unwrap();
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
