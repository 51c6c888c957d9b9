//! Page headers, read before anything is decoded: claimed sizes are bounded, and the presence of a
//! checksum is reported.
//!
//! A file of 8 kB may ask for 2 GiB, and an allocation that fails cannot be caught; so a page must fit
//! its chunk, its values must fit the page, and no page is larger than any writer makes.

use std::fs::File;

use parquet::basic::Type;
use parquet::file::metadata::ColumnChunkMetaData;
use polars_parquet_format::thrift::protocol::TCompactInputProtocol;
use polars_parquet_format::{Encoding, PageHeader, PageType};

use crate::bounds::{self, PAGE_BYTES};
use crate::io::read_at;

/// A header holds two statistics at most; this is far beyond any.
const LARGEST_HEADER: u64 = 1 << 20;
const USUAL_HEADER: u64 = 256;
/// What levels, dictionaries' indices and unfinished blocks may add to a page beyond its values.
const SLACK_BYTES: i64 = 1 << 16;

/// Walks the pages of one column chunk.
pub(crate) struct Pages<'f> {
    file: &'f File,
    at: u64,
    end: u64,
    buffer: Vec<u8>,
}

/// A page's header and where its body lies.
#[derive(Debug)]
pub(crate) struct Page {
    pub(crate) header: PageHeader,
    /// Bytes of the header as written.
    pub(crate) header_bytes: u64,
    /// First byte of the body.
    pub(crate) body_start: u64,
}

impl<'f> Pages<'f> {
    /// Starts at the first page of a chunk.
    pub(crate) fn of(file: &'f File, start: u64, bytes: u64) -> Self {
        Self { file, at: start, end: start + bytes, buffer: Vec::new() }
    }

    /// The next page; its body is passed over.
    pub(crate) fn next(&mut self) -> Result<Option<Page>, String> {
        if self.at >= self.end {
            return Ok(None);
        }
        let (header, header_bytes) = self.header()?;
        let body_start = self.at + header_bytes;
        let (size, left) = (i64::from(header.compressed_page_size), self.end.saturating_sub(body_start));
        if size < 0 || size as u64 > left {
            return Err(format!("a page claims {size} bytes where its chunk has {left} left"));
        }
        self.at = body_start + size as u64;
        Ok(Some(Page { header, header_bytes, body_start }))
    }

    /// Most headers are under a hundred bytes; one with long statistics is read again in full.
    fn header(&mut self) -> Result<(PageHeader, u64), String> {
        let left = (self.end - self.at).min(LARGEST_HEADER);
        let mut wanted = USUAL_HEADER.min(left);
        loop {
            self.buffer.resize(wanted as usize, 0);
            read_at::read_exact(self.file, &mut self.buffer, self.at).map_err(|e| e.to_string())?;
            let mut rest = self.buffer.as_slice();
            let mut protocol = TCompactInputProtocol::new(&mut rest, LARGEST_HEADER as usize);
            match PageHeader::read_from_in_protocol(&mut protocol) {
                Ok(header) => return Ok((header, wanted - rest.len() as u64)),
                Err(_) if wanted < left => wanted = left,
                Err(e) => return Err(format!("a page header cannot be read: {e}")),
            }
        }
    }
}

/// The pages of a chunk.
pub(crate) fn bounded(file: &File, chunk: &ColumnChunkMetaData, rows: i64) -> Result<Vec<Page>, String> {
    let (start, bytes) = chunk.byte_range();
    let length = read_at::file_length(file).map_err(|e| e.to_string())?;
    if start.checked_add(bytes).is_none_or(|end| end > length) {
        return Err(format!("its pages would end at byte {start} + {bytes} of a file of {length}"));
    }
    let values = u64::try_from(chunk.num_values()).unwrap_or(u64::MAX);
    bounds::check_rows("values of a column", values, length).map_err(|excess| excess.to_string())?;
    let is_flat = chunk.column_descr().max_rep_level() == 0;
    let (mut values, mut found) = (0_i64, Vec::new());
    let mut pages = Pages::of(file, start, bytes);
    while let Some(page) = pages.next()? {
        let count = claimed(&page.header)?;
        check_size(&page.header, chunk, count)?;
        if page.header.type_ != PageType::DICTIONARY_PAGE {
            values = values.saturating_add(count);
        }
        found.push(page);
    }
    if values != chunk.num_values() || (is_flat && values != rows) {
        let declared = if is_flat { rows } else { chunk.num_values() };
        return Err(format!("its pages hold {values} values where {declared} are declared"));
    }
    Ok(found)
}

/// The number of values that a page claims.
fn claimed(header: &PageHeader) -> Result<i64, String> {
    let v1 = header.data_page_header.as_ref().map(|h| h.num_values);
    let v2 = header.data_page_header_v2.as_ref().map(|h| h.num_values);
    let dictionary = header.dictionary_page_header.as_ref().map(|h| h.num_values);
    let count = v1.or(v2).or(dictionary).unwrap_or(0);
    if count < 0 { Err(format!("a page claims {count} values")) } else { Ok(i64::from(count)) }
}

fn check_size(header: &PageHeader, chunk: &ColumnChunkMetaData, count: i64) -> Result<(), String> {
    let size = i64::from(header.uncompressed_page_size);
    let most = match width(chunk) {
        Some(width) => count.saturating_mul(width + 4).saturating_add(SLACK_BYTES).min(PAGE_BYTES),
        None => bounds::text_page_bytes(header.compressed_page_size.into()),
    };
    if !(0..=most).contains(&size) {
        return Err(format!("a page of {count} values claims {size} bytes"));
    }
    // A text takes the four bytes of its length at least.
    let width = width(chunk).unwrap_or(4);
    match present(header, chunk) {
        Some(present) if present.saturating_mul(width) > size => {
            Err(format!("a page of {size} bytes claims {present} values of {width} bytes"))
        }
        _ => Ok(()),
    }
}

/// Values that surely lie in the page at their full width; nothing where nulls or an encoding hide it.
fn present(header: &PageHeader, chunk: &ColumnChunkMetaData) -> Option<i64> {
    let is_text = chunk.column_type() == Type::BYTE_ARRAY;
    let full = |encoding: Encoding| {
        encoding == Encoding::PLAIN || encoding == Encoding::BYTE_STREAM_SPLIT && !is_text
    };
    if let Some(dictionary) = &header.dictionary_page_header {
        return Some(i64::from(dictionary.num_values));
    }
    if let Some(v2) = header.data_page_header_v2.as_ref().filter(|h| full(h.encoding)) {
        return Some(i64::from(v2.num_values) - i64::from(v2.num_nulls));
    }
    let needed = chunk.column_descr().max_def_level() == 0;
    header.data_page_header.as_ref().filter(|h| needed && full(h.encoding)).map(|h| i64::from(h.num_values))
}

/// Bytes of a value, where all values have the same; a truth value is a bit.
fn width(chunk: &ColumnChunkMetaData) -> Option<i64> {
    match chunk.column_type() {
        Type::BOOLEAN => Some(0),
        Type::INT32 | Type::FLOAT => Some(4),
        Type::INT64 | Type::DOUBLE => Some(8),
        Type::INT96 => Some(12),
        Type::FIXED_LEN_BYTE_ARRAY => Some(i64::from(chunk.column_descr().type_length().max(0))),
        Type::BYTE_ARRAY => None,
    }
}
