//! Small Parquet files that claim what would exhaust memory, stack or time, written byte by byte: no writer makes them.
//!
//! Field numbers are those of `parquet.thrift`, in Thrift's compact protocol.

use std::io::Write;

/// A file, and a part of its error.
pub(crate) struct Hostile {
    pub(crate) name: &'static str,
    pub(crate) bytes: Vec<u8>,
    pub(crate) code: &'static str,
    pub(crate) says: &'static str,
}

const DOUBLE: i64 = 5;
const TEXT: i64 = 6;
const SNAPPY: i64 = 1;
const GZIP: i64 = 2;
const BROTLI: i64 = 4;
const LZ4: i64 = 5;
/// Columns of the small fleet's mapping; a position has the last three.
const COLUMNS: [&str; 4] =
    ["time_s", "aileron_left_motor_deg", "aileron_left_screw_mm", "aileron_left_load_n"];

fn varint(mut number: u64) -> Vec<u8> {
    let mut bytes = Vec::new();
    while number > 0x7f {
        bytes.push(number as u8 | 0x80);
        number >>= 7;
    }
    bytes.push(number as u8);
    bytes
}

/// A whole number; `head` is the distance from the field before and the type, 5 for 32 and 6 for 64 bits.
fn int(head: u8, number: i64) -> Vec<u8> {
    [vec![head], varint((number << 1 ^ number >> 63) as u64)].concat()
}

fn text(step: u8, text: &str) -> Vec<u8> {
    [vec![step << 4 | 8], varint(text.len() as u64), text.as_bytes().to_vec()].concat()
}

/// Header of a list with a claimed number of elements of a type; its body may hold fewer.
fn list(step: u8, kind: u8, count: u64, body: &[u8]) -> Vec<u8> {
    [&[step << 4 | 9, 0xf0 | kind][..], &varint(count), body].concat()
}

fn group(name: &str, children: i64) -> Vec<u8> {
    [int(0x35, 1), text(1, name), int(0x15, children), vec![0]].concat()
}

fn leaf(name: &str, kind: i64) -> Vec<u8> {
    [int(0x15, kind), int(0x25, 1), text(1, name), vec![0]].concat()
}

/// A page (type 0: data, 2: dictionary) with claimed numbers of values and bytes.
fn page(kind: i64, values: i64, claimed: i64, encoding: i64, body: &[u8]) -> Vec<u8> {
    let sizes = [int(0x15, kind), int(0x15, claimed), int(0x15, body.len() as i64)].concat();
    let of_kind = [int(0x15, values), int(0x15, encoding)].concat();
    let rest = match kind {
        0 => [vec![0x2c], of_kind, int(0x15, 3), int(0x15, 3), vec![0, 0]].concat(),
        _ => [vec![0x4c], of_kind, vec![0, 0]].concat(),
    };
    [sizes, rest, body.to_vec()].concat()
}

/// Definition levels of one run: all values are there, or none is.
fn levels(values: u64, present: bool) -> Vec<u8> {
    let run = [varint(values << 1), vec![u8::from(present)]].concat();
    [(run.len() as u32).to_le_bytes().to_vec(), run].concat()
}

/// A log whose four columns are of one type and codec, and have the same pages.
fn log(kind: i64, codec: i64, rows: i64, has_dictionary: bool, pages: &[u8]) -> Vec<u8> {
    let schema = [
        [text(4, "schema"), int(0x15, 4), vec![0]].concat(),
        COLUMNS.iter().flat_map(|name| leaf(name, kind)).collect(),
    ];
    let mut file = b"PAR1".to_vec();
    let mut chunks = Vec::new();
    for name in COLUMNS {
        let at = file.len() as i64;
        file.extend_from_slice(pages);
        let bytes = pages.len() as i64;
        let path = [varint(name.len() as u64), name.as_bytes().to_vec()].concat();
        let dictionary = if has_dictionary { int(0x26, at) } else { Vec::new() };
        let meta = [
            int(0x15, kind),
            list(1, 5, 2, &[0, 16]),
            list(1, 8, 1, &path),
            int(0x15, codec),
            int(0x16, rows),
            int(0x16, bytes),
            int(0x16, bytes),
            int(0x26, at),
            dictionary,
            vec![0],
        ];
        chunks.extend([int(0x26, at), vec![0x1c], meta.concat(), vec![0]].concat());
    }
    let row_group = [list(1, 12, 4, &chunks), int(0x16, 1000), int(0x16, rows), vec![0]].concat();
    finish(file, &schema.concat(), 5, rows, &list(1, 12, 1, &row_group))
}

fn finish(mut file: Vec<u8>, schema: &[u8], elements: u64, rows: i64, groups: &[u8]) -> Vec<u8> {
    let facts = [("tail_number", "N412FP"), ("flight_id", "H00"), ("departure_utc", "2026-10-15T00:00:00Z")];
    let pairs: Vec<u8> =
        facts.iter().flat_map(|(key, value)| [text(1, key), text(1, value), vec![0]].concat()).collect();
    let footer = [
        int(0x15, 1),
        list(1, 12, elements, schema),
        int(0x16, rows),
        groups.to_vec(),
        list(1, 12, facts.len() as u64, &pairs),
        vec![0],
    ]
    .concat();
    if file.is_empty() {
        file = b"PAR1".to_vec();
    }
    let length = (footer.len() as u32).to_le_bytes();
    [file, footer, length.to_vec(), b"PAR1".to_vec()].concat()
}

/// A footer without pages.
fn footer(schema: &[u8], elements: u64, rows: i64, groups: &[u8]) -> Vec<u8> {
    finish(Vec::new(), schema, elements, rows, groups)
}

fn nested(depth: usize) -> Vec<u8> {
    let groups: Vec<u8> = (0..depth).flat_map(|_| group("g", 1)).collect();
    let schema = [text(4, "schema"), int(0x15, 1), vec![0], groups, leaf("x", DOUBLE)].concat();
    footer(&schema, depth as u64 + 2, 10, &list(1, 12, 0, &[]))
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut writer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    writer.write_all(bytes).unwrap();
    writer.finish().unwrap()
}

/// Zeros, packed.
fn zeros(codec: i64, bytes: usize) -> Vec<u8> {
    let block = vec![0_u8; bytes];
    let mut packed = Vec::new();
    match codec {
        GZIP => return gzip(&block),
        BROTLI => brotli::CompressorWriter::new(&mut packed, 4096, 1, 22).write_all(&block).unwrap(),
        _ => {
            let mut writer = lz4_flex::frame::FrameEncoder::new(&mut packed);
            writer.write_all(&block).unwrap();
            writer.finish().unwrap();
        }
    }
    packed
}

/// A page of 1,000 numbers that unpacks to far more.
fn bomb(codec: i64) -> Vec<u8> {
    log(DOUBLE, codec, 1000, false, &page(0, 1000, 8006, 0, &zeros(codec, 1 << 20)))
}

/// Every hostile file.
pub(crate) fn all() -> Vec<Hostile> {
    let root = [text(4, "schema"), int(0x15, 1), vec![0]].concat();
    let one = [root, leaf("x", DOUBLE)].concat();
    let many = i64::from(i32::MAX);
    let seven = [list(1, 12, 0, &[]), int(0x16, 100), int(0x16, 7), vec![0]].concat();
    let long = [&250_000_u32.to_le_bytes()[..], &vec![b'1'; 250_000]].concat();
    let codes = [levels(100_000, true), vec![1], varint(100_000 << 1), vec![0]].concat();
    let texts = [
        page(2, 1, long.len() as i64, 0, &gzip(&long)),
        page(0, 100_000, codes.len() as i64, 8, &gzip(&codes)),
    ];
    let hostile = |name, bytes, code, says| Hostile { name, bytes, code, says };
    let rows = 1_000_000_000;
    let mut all = vec![
        hostile("row_groups", footer(&one, 2, 10, &list(1, 12, many as u64, &[])), "not_parquet", "claims"),
        hostile("schema_elements", footer(&one, many as u64, 10, &[]), "not_parquet", "claims"),
        hostile(
            "children",
            footer(&[text(4, "schema"), int(0x15, many), vec![0]].concat(), 1, 10, &[]),
            "not_parquet",
            "claims",
        ),
        hostile("nested", nested(2000), "beyond_limit", "groups inside each other"),
        hostile("group_rows", footer(&one, 2, 10, &list(1, 12, 1, &seven)), "not_parquet", "claim 7 rows"),
        // A truth value whose field has the number 0: as an element of a list it would take the byte after it.
        hostile("field_zero", footer(&one, 2, 10, &[1, 0, 0]), "not_parquet", "an offset below zero"),
        hostile(
            "null_runs",
            log(DOUBLE, 0, rows, false, &page(0, rows, 11, 0, &levels(rows as u64, false))),
            "beyond_limit",
            "`run.max_rows`",
        ),
        hostile(
            "dictionary_values",
            log(DOUBLE, 0, 1000, true, &page(2, many, 8, 0, &[0; 8])),
            "decode_failed",
            "2147483647 values",
        ),
        hostile(
            "dictionary_texts",
            log(TEXT, 0, 1000, true, &page(2, many, 8, 0, &[0; 8])),
            "decode_failed",
            "2147483647 values",
        ),
        hostile(
            "long_text",
            log(TEXT, GZIP, 100_000, true, &texts.concat()),
            "decode_failed",
            "a text of 250000 bytes",
        ),
        hostile("brotli", bomb(BROTLI), "decode_failed", "8006 bytes"),
        hostile("gzip", bomb(GZIP), "decode_failed", "8006 bytes"),
        hostile("lz4", bomb(LZ4), "decode_failed", "8006 bytes"),
        hostile(
            "page_bytes",
            log(DOUBLE, SNAPPY, 1000, false, &page(0, 1000, many, 0, &[0; 8])),
            "decode_failed",
            "claims 2147483647 bytes",
        ),
        hostile(
            "page_rows",
            log(
                DOUBLE,
                0,
                100_000,
                false,
                &page(0, 1000, 8006, 0, &[levels(1000, true), vec![0; 8000]].concat()),
            ),
            "decode_failed",
            "1000 values where 100000 are declared",
        ),
    ];
    // Each is a flight of its own.
    for (number, file) in all.iter_mut().enumerate() {
        for (text, own) in [("H00", format!("H{number:02}")), ("T00:", format!("T{number:02}:"))] {
            let at = file.bytes.windows(text.len()).rposition(|bytes| bytes == text.as_bytes()).unwrap();
            file.bytes[at..at + text.len()].copy_from_slice(own.as_bytes());
        }
    }
    all
}
