//! The footer as it is written: its claims are bounded before a parser takes memory for them, and causes of errors are
//! found that the parquet crate does not name: encryption, and encodings of later versions of the format.

use std::fmt::Display;
use std::fs::File;
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use parquet::file::metadata::{ParquetMetaData, ParquetMetaDataReader};
use polars_parquet_format::FileMetaData;
use polars_parquet_format::thrift::protocol::TCompactInputProtocol;

use crate::bounds::{self, COLUMN_CHUNKS, FOOTER_BYTES, SCHEMA_DEPTH};
use crate::error::ErrorKind;
use crate::io::read_at;

/// The highest encoding that is read: byte stream split.
const HIGHEST_ENCODING: i32 = 9;
/// Adaptive lossless floating point, the encoding that follows it.
const ALP: i32 = 10;
/// Structs and lists inside each other in a footer; the format has seven levels.
const THRIFT_DEPTH: usize = 32;

/// Types of Thrift's compact protocol.
const STOP: u8 = 0;
const I32: u8 = 5;
const I64: u8 = 6;
const LIST: u8 = 9;
const STRUCT: u8 = 12;

/// Bytes of an object's end that are fetched at first: most footers are shorter.
const USUAL_FOOTER: u64 = 64 << 10;

/// A footer, and where in its file it begins.
pub(crate) struct Footer {
    pub(crate) metadata: Arc<ParquetMetaData>,
    pub(crate) start: u64,
}

/// Reads the footer of a file, after its claims were compared with what it holds, and its rows with the bytes of the file.
/// `want` fetches bytes before they are read.
pub(crate) fn read(
    file: &File,
    want: impl Fn(Range<u64>) -> Result<(), ErrorKind>,
) -> Result<Footer, ErrorKind> {
    let (start, bytes) = raw(file, want)?;
    let metadata = caught(|| ParquetMetaDataReader::decode_metadata(&bytes)).map_err(not_parquet)?;
    Ok(Footer { metadata: Arc::new(metadata), start })
}

/// A result of the parquet crate, which panics on some damaged bytes.
pub(crate) fn caught<T, E: Display>(read: impl FnOnce() -> Result<T, E>) -> Result<T, String> {
    match catch_unwind(AssertUnwindSafe(read)) {
        Ok(result) => result.map_err(|e| e.to_string()),
        Err(_) => Err("its pages are inconsistent".into()),
    }
}

/// The fault of a file that cannot be read as Parquet.
pub(crate) fn not_parquet(detail: impl Into<String>) -> ErrorKind {
    ErrorKind::NotParquet { detail: detail.into() }
}

/// Start and bytes of a footer whose claims can be.
fn raw(file: &File, want: impl Fn(Range<u64>) -> Result<(), ErrorKind>) -> Result<(u64, Vec<u8>), ErrorKind> {
    let corrupt = || not_parquet("Invalid Parquet file. Corrupt footer");
    let length = read_at::file_length(file)?;
    want(length.saturating_sub(USUAL_FOOTER)..length)?;
    let end = length.checked_sub(8).ok_or_else(corrupt)?;
    let mut trailer = [0; 8];
    read_at::read_exact(file, &mut trailer, end)?;
    let [a, b, c, d, magic @ ..] = trailer;
    let bytes = u64::from(u32::from_le_bytes([a, b, c, d]));
    let start = end.checked_sub(bytes).filter(|_| magic == *b"PAR1").ok_or_else(corrupt)?;
    bounds::check("bytes of footer", bytes, FOOTER_BYTES)?;
    want(start..length)?;
    let mut footer = vec![0; bytes as usize];
    read_at::read_exact(file, &mut footer, start)?;
    let damaged = || not_parquet("its footer is damaged: it claims more than it holds");
    let claims = Thrift { rest: &footer }.file_claims().ok_or_else(damaged)?;
    bounds::check("groups inside each other in the schema", claims.depth as u64, SCHEMA_DEPTH as u64)?;
    bounds::check("columns in its row groups", claims.chunks, COLUMN_CHUNKS)?;
    bounds::check_rows("rows", claims.rows, length)?;
    Ok((start, footer))
}

/// What a footer claims.
#[derive(Debug, Default)]
struct Claims {
    depth: usize,
    chunks: u64,
    rows: u64,
}

/// Walks through Thrift's compact protocol and takes no memory. `None` where it is not whole.
struct Thrift<'b> {
    rest: &'b [u8],
}

impl Thrift<'_> {
    fn file_claims(&mut self) -> Option<Claims> {
        let mut claims = Claims::default();
        self.fields(&mut |thrift, field, kind| match (field, kind) {
            (2, LIST) => {
                // Children of each open group that are still to come.
                let mut open: Vec<i64> = Vec::new();
                thrift.elements(&mut |thrift| {
                    let mut children = 0;
                    thrift.fields(&mut |thrift, field, kind| match (field, kind) {
                        (5, I32) => thrift.signed().map(|count| children = count),
                        _ => thrift.skip(kind, THRIFT_DEPTH),
                    })?;
                    open.last_mut().into_iter().for_each(|left| *left -= 1);
                    if children > 0 {
                        open.push(children);
                        claims.depth = claims.depth.max(open.len());
                    }
                    while open.last().is_some_and(|left| *left <= 0) {
                        open.pop();
                    }
                    (children <= thrift.rest.len() as i64).then_some(())
                })
            }
            (3, I64) => thrift.signed().map(|rows| claims.rows = u64::try_from(rows).unwrap_or(0)),
            (4, LIST) => thrift.elements(&mut |thrift| {
                thrift.fields(&mut |thrift, field, kind| match (field, kind) {
                    (1, LIST) => thrift.elements(&mut |thrift| {
                        claims.chunks += 1;
                        thrift.skip(STRUCT, THRIFT_DEPTH)
                    }),
                    _ => thrift.skip(kind, THRIFT_DEPTH),
                })
            }),
            _ => thrift.skip(kind, THRIFT_DEPTH),
        })?;
        Some(claims)
    }

    /// Passes each field of a struct, by number and type, to `take`, which must read its value.
    fn fields(&mut self, take: &mut dyn FnMut(&mut Self, i64, u8) -> Option<()>) -> Option<()> {
        let mut number = 0;
        loop {
            let head = self.byte()?;
            if head == STOP {
                return Some(());
            }
            number = if head >> 4 == 0 { self.signed()? } else { number + i64::from(head >> 4) };
            take(self, number, head & 0x0f)?;
        }
    }

    /// Calls `take` for each struct of a list.
    fn elements(&mut self, take: &mut dyn FnMut(&mut Self) -> Option<()>) -> Option<()> {
        let (kind, count) = self.list()?;
        if count > 0 && kind != STRUCT {
            return None;
        }
        (0..count).try_for_each(|_| take(self))
    }

    /// Type and number of a list's elements, each of which takes a byte at least.
    fn list(&mut self) -> Option<(u8, u64)> {
        let head = self.byte()?;
        let count = if head >> 4 == 15 { self.varint()? } else { u64::from(head >> 4) };
        (count <= self.rest.len() as u64).then_some((head & 0x0f, count))
    }

    fn skip(&mut self, kind: u8, depth: usize) -> Option<()> {
        let depth = depth.checked_sub(1)?;
        match kind {
            1 | 2 => Some(()),
            3 => self.byte().map(drop),
            4..=6 => self.varint().map(drop),
            7 => self.pass(8),
            8 => {
                let bytes = self.varint()?;
                self.pass(bytes)
            }
            9 | 10 => {
                let (kind, count) = self.list()?;
                (0..count).try_for_each(|_| self.skip_element(kind, depth))
            }
            11 => {
                let count = self.varint()?;
                let kinds = if count == 0 { 0 } else { self.byte()? };
                (0..count).try_for_each(|_| {
                    self.skip_element(kinds >> 4, depth)?;
                    self.skip_element(kinds & 0x0f, depth)
                })
            }
            STRUCT => self.fields(&mut |thrift, _, kind| thrift.skip(kind, depth)),
            _ => None,
        }
    }

    /// A truth value takes a byte in a list, and none as a field.
    fn skip_element(&mut self, kind: u8, depth: usize) -> Option<()> {
        if matches!(kind, 1 | 2) { self.byte().map(drop) } else { self.skip(kind, depth) }
    }

    fn byte(&mut self) -> Option<u8> {
        let (byte, rest) = self.rest.split_first()?;
        self.rest = rest;
        Some(*byte)
    }

    fn pass(&mut self, bytes: u64) -> Option<()> {
        self.rest = self.rest.get(usize::try_from(bytes).ok()?..)?;
        Some(())
    }

    fn varint(&mut self) -> Option<u64> {
        let mut number = 0_u64;
        for shift in (0..70).step_by(7) {
            let byte = self.byte()?;
            number |= u64::from(byte & 0x7f).checked_shl(shift).unwrap_or(0);
            if byte & 0x80 == 0 {
                return Some(number);
            }
        }
        None
    }

    fn signed(&mut self) -> Option<i64> {
        self.varint().map(|number| (number >> 1) as i64 ^ -((number & 1) as i64))
    }
}

/// The footer as the format's own types, for messages.
fn parsed(file: &File) -> Option<FileMetaData> {
    let (_, footer) = raw(file, |_| Ok(())).ok()?;
    let mut protocol = TCompactInputProtocol::new(footer.as_slice(), FOOTER_BYTES as usize);
    FileMetaData::read_from_in_protocol(&mut protocol).ok()
}

/// Whether a file with a readable footer is encrypted, and this leaf by its own key or with the rest.
pub(crate) fn encrypted(file: &File, leaf: usize) -> Option<bool> {
    let footer = parsed(file)?;
    let is_column = footer
        .row_groups
        .iter()
        .any(|group| group.columns.get(leaf).is_some_and(|chunk| chunk.crypto_metadata.is_some()));
    (is_column || footer.encryption_algorithm.is_some()).then_some(is_column)
}

/// The name of an encoding that is not read, if the file uses one.
pub(crate) fn unknown_encoding(file: &File) -> Option<String> {
    let footer = parsed(file)?;
    let chunks = footer.row_groups.iter().flat_map(|group| &group.columns);
    let encodings = chunks.filter_map(|chunk| chunk.meta_data.as_ref()).flat_map(|meta| &meta.encodings);
    let unknown = encodings.map(|encoding| encoding.0).find(|number| *number > HIGHEST_ENCODING)?;
    Some(if unknown == ALP { "ALP".to_owned() } else { format!("number {unknown}") })
}
