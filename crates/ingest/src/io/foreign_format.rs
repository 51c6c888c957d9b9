//! Formats of flight and measurement data that are given in place of Parquet, by their first bytes.

/// Bytes of a file that are read to identify its format.
pub(crate) const HEAD_BYTES: u64 = 512;

const MAGIC: [(&[u8], &str); 16] = [
    (b"MDF     ", "an MDF file (ASAM)"),
    (b"UnFinMF ", "an MDF file (ASAM) that was not finished"),
    (b"\x89HDF\r\n\x1a\n", "an HDF5 file"),
    (b"TDSm", "a TDMS file (LabVIEW)"),
    (b"PK\x03\x04", "a ZIP archive"),
    (b"\x1f\x8b", "a gzip archive"),
    (b"\x28\xb5\x2f\xfd", "a zstd archive"),
    (b"7z\xbc\xaf\x27\x1c", "a 7z archive"),
    (b"ARROW1", "an Arrow (Feather) file"),
    (b"ORC", "an ORC file"),
    (b"Obj\x01", "an Avro file"),
    (b"SQLite format 3\0", "an SQLite database"),
    (b"MATLAB 5.0 MAT-file", "a MATLAB file"),
    (b"\x25\xeb", "an IRIG 106 chapter 10 recording"),
    (b"CDF\x01", "a NetCDF file"),
    (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "an old Excel workbook"),
];

/// The format that a file's first bytes show, where it is none of Parquet's.
pub(crate) fn of(head: &[u8]) -> Option<&'static str> {
    let by_magic = MAGIC.iter().find(|(magic, _)| head.starts_with(magic)).map(|(_, format)| *format);
    by_magic.or_else(|| text_format(head))
}

/// Text: JSON, or cells between separators.
fn text_format(head: &[u8]) -> Option<&'static str> {
    let head = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head);
    let text = head.utf8_chunks().next()?.valid();
    let is_readable = |c: char| !c.is_control() || matches!(c, '\n' | '\r' | '\t');
    // A character may be cut at the end of what was read.
    if text.is_empty() || text.len() + 4 <= head.len() || !text.chars().all(is_readable) {
        return None;
    }
    match text.trim_start().chars().next() {
        Some('{' | '[') => Some("a JSON file"),
        Some('<') => Some("an XML or HTML file"),
        _ if text.lines().next().is_some_and(|line| line.contains([',', ';', '\t'])) => Some("a CSV file"),
        _ => Some("a text file"),
    }
}
