//! The footer as it is written: its claims are bounded before a parser takes memory for them, and causes of errors are
//! found that the parquet crate does not name: encryption, and encodings of later versions of the format.

use std::fmt::Display;
use std::fs::File;
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use parquet::file::metadata::{ParquetMetaData, ParquetMetaDataReader};
use polars_parquet_format::thrift::protocol::{TCompactInputProtocol, TInputProtocol, TType};

use crate::bounds::{self, COLUMN_CHUNKS, FOOTER_BYTES, SCHEMA_DEPTH};
use crate::error::{Fault, encrypted, not_parquet};
use crate::io::{foreign_format, retry};

/// The highest encoding that is read: byte stream split.
const HIGHEST_ENCODING: i64 = 9;
/// Adaptive lossless floating point, the encoding that follows it.
const ALP: i64 = 10;
/// Structs and lists inside each other in a footer; the format has seven levels.
const THRIFT_DEPTH: usize = 32;

/// Bytes of an object's end that are fetched at first: most footers are shorter.
const USUAL_FOOTER: u64 = 64 << 10;

/// A footer, where in its file it begins, and what it claims.
pub(crate) struct Footer {
    pub(crate) metadata: Arc<ParquetMetaData>,
    pub(crate) start: u64,
    pub(crate) claims: Claims,
}

/// Reads the footer of a file, after its claims were compared with what it holds, and its rows with the bytes of the file.
/// `want` fetches bytes before they are read.
pub(crate) fn read(file: &File, want: impl Fn(Range<u64>) -> Result<(), Fault>) -> Result<Footer, Fault> {
    let length = retry::file_length(file)?;
    want(length.saturating_sub(USUAL_FOOTER)..length)?;
    let end = length.saturating_sub(8);
    let mut trailer = [0; 8];
    retry::read_exact(file, &mut trailer[..length.min(8) as usize], end)?;
    let [a, b, c, d, magic @ ..] = trailer;
    let bytes = u64::from(u32::from_le_bytes([a, b, c, d]));
    let Some(start) = end.checked_sub(bytes).filter(|_| magic == *b"PAR1") else {
        return Err(without_footer(file, want)?);
    };
    bounds::check("bytes of footer", bytes, FOOTER_BYTES)?;
    want(start..length)?;
    let mut footer = vec![0; bytes as usize];
    retry::read_exact(file, &mut footer, start)?;
    let damaged = "its footer is damaged: it claims more than it holds, or an offset below zero";
    let mut walk = Walk::new(&footer);
    walk.fields().ok_or_else(|| not_parquet(damaged))?;
    let claims = walk.claims;
    bounds::check("groups inside each other in the schema", claims.depth as u64, SCHEMA_DEPTH as u64)?;
    bounds::check("columns in its row groups", claims.chunks, COLUMN_CHUNKS)?;
    bounds::check_rows("rows", claims.rows, length)?;
    if claims.group_rows != claims.rows {
        let Claims { rows, group_rows, .. } = claims;
        return Err(not_parquet(format!("its row groups claim {group_rows} rows, and its footer {rows}")));
    }
    if claims.encoding > HIGHEST_ENCODING {
        let number = claims.encoding;
        let encoding = if number == ALP { "ALP".to_owned() } else { format!("number {number}") };
        let message = format!("the file uses the encoding {encoding}, which is not supported");
        let hint = "have the recorder write PLAIN, BYTE_STREAM_SPLIT or dictionary encoding, or rewrite the file with the tool that wrote it";
        return Err(Fault::new("encoding_unsupported", message, hint));
    }
    let metadata = caught(|| ParquetMetaDataReader::decode_metadata(&footer)).map_err(not_parquet)?;
    Ok(Footer { metadata: Arc::new(metadata), start, claims })
}

/// What a file is that does not end with a Parquet footer, by its first bytes.
fn without_footer(file: &File, want: impl Fn(Range<u64>) -> Result<(), Fault>) -> Result<Fault, Fault> {
    let mut head = vec![0; retry::file_length(file)?.min(foreign_format::HEAD_BYTES) as usize];
    want(0..head.len() as u64)?;
    retry::read_exact(file, &mut head, 0)?;
    Ok(match head[..] {
        [b'P', b'A', b'R', b'E', ..] => encrypted(None),
        [b'P', b'A', b'R', b'1', ..] => not_parquet("the file is truncated: it does not end with a footer"),
        _ => match foreign_format::of(&head) {
            Some(format) => Fault::new(
                "not_parquet",
                format!("this is {format}, not a Parquet file"),
                "convert it to Parquet (docs/convert-logs.md), or exclude it in `logs.files`",
            ),
            None => not_parquet("not a Parquet file"),
        },
    })
}

/// A result of the parquet crate, which panics on some damaged bytes.
pub(crate) fn caught<T, E: Display>(read: impl FnOnce() -> Result<T, E>) -> Result<T, String> {
    match catch_unwind(AssertUnwindSafe(read)) {
        Ok(result) => result.map_err(|e| e.to_string()),
        Err(_) => Err("its pages are inconsistent".into()),
    }
}

#[derive(Debug, Default)]
pub(crate) struct Claims {
    /// Groups inside each other in the schema.
    depth: usize,
    /// Column chunks of all row groups.
    chunks: u64,
    /// Rows of the file, and those of all row groups together.
    rows: u64,
    group_rows: u64,
    /// The highest number of an encoding.
    encoding: i64,
    /// Whether the whole file is encrypted.
    pub(crate) is_encrypted: bool,
    /// The chunks that are encrypted by a key of their column, counted over all row groups.
    pub(crate) encrypted_chunks: Vec<u64>,
}

/// The step into an element of a list.
const ELEMENT: i16 = 0;

/// Walks through a footer, and takes no memory for what a list claims to hold. Its functions return `None` where the
/// bytes are not whole.
struct Walk<'b> {
    footer: TCompactInputProtocol<&'b [u8]>,
    bytes: usize,
    /// The way to the present value: numbers of fields, and [`ELEMENT`] for each list.
    path: Vec<i16>,
    /// Children of the present element of the schema.
    children: i64,
    /// Children of each open group of the schema that are still to come.
    open: Vec<i64>,
    claims: Claims,
}

impl<'b> Walk<'b> {
    fn new(footer: &'b [u8]) -> Self {
        let bytes = footer.len();
        // Budget of the protocol: it charges eight bytes per list element, two per struct, and the length of texts.
        let footer = TCompactInputProtocol::new(footer, 16 * bytes);
        Self { footer, bytes, path: Vec::new(), children: 0, open: Vec::new(), claims: Claims::default() }
    }

    fn value(&mut self, kind: TType) -> Option<()> {
        match kind {
            TType::Bool => self.footer.read_bool().ok().map(drop),
            TType::I08 => self.footer.read_i8().ok().map(drop),
            TType::I16 | TType::I32 | TType::I64 => {
                let number = self.footer.read_i64().ok()?;
                self.number(number)
            }
            TType::Double => self.footer.read_double().ok().map(drop),
            TType::String => self.footer.read_bytes().ok().map(drop),
            TType::List | TType::Set => self.list(),
            TType::Struct => self.fields(),
            // Maps, which the format does not use.
            _ => None,
        }
    }

    /// Notes a number, where the memory of a parser depends on it. Numbers of fields are those of `parquet.thrift`.
    fn number(&mut self, number: i64) -> Option<()> {
        match self.path[..] {
            [2, ELEMENT, 5] => self.children = number,
            [3] => self.claims.rows = u64::try_from(number).unwrap_or(0),
            [4, ELEMENT, 3] => {
                let group_rows = self.claims.group_rows.checked_add(u64::try_from(number).ok()?)?;
                self.claims.group_rows = group_rows;
            }
            [4, ELEMENT, 1, ELEMENT, 3, 2, ELEMENT] => {
                self.claims.encoding = self.claims.encoding.max(number);
            }
            // The parquet crate panics on a size or an offset of pages below zero.
            [4, ELEMENT, 1, ELEMENT, 3, 7 | 9 | 11] => return (number >= 0).then_some(()),
            _ => {}
        }
        Some(())
    }

    fn list(&mut self) -> Option<()> {
        (self.path.len() < THRIFT_DEPTH).then_some(())?;
        let list = self.footer.read_list_begin().ok()?;
        self.path.push(ELEMENT);
        (0..list.size).try_for_each(|_| self.value(list.element_type))?;
        self.path.pop().map(drop)
    }

    fn fields(&mut self) -> Option<()> {
        (self.path.len() < THRIFT_DEPTH).then_some(())?;
        self.footer.read_struct_begin().ok()?;
        loop {
            let field = self.footer.read_field_begin().ok()?;
            if field.field_type == TType::Stop {
                break;
            }
            // A field numbered as an element would mislead the walk; the format has none below one.
            self.path.push(field.id.filter(|number| *number > ELEMENT)?);
            self.value(field.field_type)?;
            self.path.pop();
        }
        self.footer.read_struct_end().ok()?;
        match self.path[..] {
            [2, ELEMENT] => return self.schema_element(),
            [4, ELEMENT, 1, ELEMENT] => self.claims.chunks += 1,
            [4, ELEMENT, 1, ELEMENT, 8] => self.claims.encrypted_chunks.push(self.claims.chunks),
            [8] => self.claims.is_encrypted = true,
            _ => {}
        }
        Some(())
    }

    /// Counts the groups about an element of the schema that was passed.
    fn schema_element(&mut self) -> Option<()> {
        let children = std::mem::take(&mut self.children);
        self.open.last_mut().into_iter().for_each(|left| *left -= 1);
        if children > 0 {
            self.open.push(children);
            self.claims.depth = self.claims.depth.max(self.open.len());
        }
        while self.open.last().is_some_and(|left| *left <= 0) {
            self.open.pop();
        }
        (children <= self.bytes as i64).then_some(())
    }
}
