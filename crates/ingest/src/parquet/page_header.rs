//! Page headers, read before anything is decoded: claimed sizes are bounded, and the presence of a
//! checksum is reported.
//!
//! A file of 8 kB may ask for 2 GiB, and an allocation that fails cannot be caught; so a page must fit
//! its chunk, its values must fit the page, and no page is larger than any writer makes.

use std::fs::File;
use std::ops::Range;

use parquet::basic::Type;
use parquet::file::metadata::ColumnChunkMetaData;
use polars_parquet_format::thrift::protocol::TCompactInputProtocol;
use polars_parquet_format::{Encoding, PageHeader, PageType};

use crate::bounds::{self, PAGE_BYTES};
use crate::io::retry;

/// A header holds two statistics at most; this is far beyond any.
const LARGEST_HEADER: u64 = 1 << 20;
const USUAL_HEADER: u64 = 256;
/// What levels, dictionaries' indices and unfinished blocks may add to a page beyond its values.
const SLACK_BYTES: i64 = 1 << 16;

/// A page's header and where its body lies.
#[derive(Debug)]
pub(crate) struct Page {
    pub(crate) header: PageHeader,
    /// First byte of the body.
    pub(crate) body_start: u64,
    /// Values, nulls included.
    pub(crate) values: u32,
}

impl Page {
    pub(crate) fn is_dictionary(&self) -> bool {
        self.header.type_ == PageType::DICTIONARY_PAGE
    }
}

/// Reads a header into `buffer`, and returns it with its length. Most headers are under a hundred bytes; one with long
/// statistics is read again in full.
fn read_header(file: &File, place: Range<u64>, buffer: &mut Vec<u8>) -> Result<(PageHeader, u64), String> {
    let left = (place.end - place.start).min(LARGEST_HEADER);
    let mut wanted = USUAL_HEADER.min(left);
    loop {
        buffer.resize(wanted as usize, 0);
        retry::read_exact(file, buffer, place.start).map_err(|e| e.to_string())?;
        let mut rest = buffer.as_slice();
        let mut protocol = TCompactInputProtocol::new(&mut rest, LARGEST_HEADER as usize);
        match PageHeader::read_from_in_protocol(&mut protocol) {
            Ok(header) => return Ok((header, wanted - rest.len() as u64)),
            Err(_) if wanted < left => wanted = left,
            Err(e) => return Err(format!("a page header cannot be read: {e}")),
        }
    }
}

/// The pages of a chunk.
pub(crate) fn bounded(file: &File, chunk: &ColumnChunkMetaData, rows: i64) -> Result<Vec<Page>, String> {
    let (start, bytes) = chunk.byte_range();
    let length = retry::file_length(file).map_err(|e| e.to_string())?;
    if start.checked_add(bytes).is_none_or(|end| end > length) {
        return Err(format!("its pages would end at byte {start} + {bytes} of a file of {length}"));
    }
    let values = u64::try_from(chunk.num_values()).unwrap_or(u64::MAX);
    bounds::check_rows("values of a column", values, length).map_err(|fault| fault.0.message)?;
    let is_flat = chunk.column_descr().max_rep_level() == 0;
    let (mut at, end) = (start, start + bytes);
    let (mut values, mut found, mut buffer) = (0_i64, Vec::new(), Vec::new());
    while at < end {
        let (header, header_bytes) = read_header(file, at..end, &mut buffer)?;
        let body_start = at + header_bytes;
        let (size, left) = (i64::from(header.compressed_page_size), end.saturating_sub(body_start));
        if size < 0 || size as u64 > left {
            return Err(format!("a page claims {size} bytes where its chunk has {left} left"));
        }
        at = body_start + size as u64;
        let page = Page { values: check_size(&header, chunk)?, header, body_start };
        if !page.is_dictionary() {
            values = values.saturating_add(page.values.into());
        }
        if page.header.type_ != PageType::INDEX_PAGE {
            found.push(page);
        }
    }
    if values != chunk.num_values() || (is_flat && values != rows) {
        let declared = if is_flat { rows } else { chunk.num_values() };
        return Err(format!("its pages hold {values} values where {declared} are declared"));
    }
    Ok(found)
}

/// Compares the size that a page claims with its values, and returns how many it claims.
fn check_size(header: &PageHeader, chunk: &ColumnChunkMetaData) -> Result<u32, String> {
    let is_required = chunk.column_descr().max_def_level() == 0;
    // The number of values, that of nulls among them where the header states it, and the encoding.
    let claimed = match header.type_ {
        PageType::DATA_PAGE => {
            let page = header.data_page_header.as_ref();
            page.map(|page| (page.num_values, is_required.then_some(0), page.encoding))
        }
        PageType::DATA_PAGE_V2 => {
            let page = header.data_page_header_v2.as_ref();
            page.map(|page| (page.num_values, Some(page.num_nulls), page.encoding))
        }
        _ => header.dictionary_page_header.as_ref().map(|page| (page.num_values, Some(0), Encoding::PLAIN)),
    };
    let (count, nulls, encoding) = claimed.unwrap_or((0, None, Encoding::PLAIN));
    let values = u32::try_from(count).map_err(|_| format!("a page claims {count} values"))?;
    let (width, size) = (width(chunk), i64::from(header.uncompressed_page_size));
    let most = match width {
        Some(width) => {
            i64::from(values).saturating_mul(width + 4).saturating_add(SLACK_BYTES).min(PAGE_BYTES)
        }
        None => bounds::text_page_bytes(header.compressed_page_size.into()),
    };
    if !(0..=most).contains(&size) {
        return Err(format!("a page of {values} values claims {size} bytes"));
    }
    // Plain and split encodings store each value that is not null at its full width; a text takes at least the four bytes
    // of its length.
    let is_split = encoding == Encoding::BYTE_STREAM_SPLIT && width.is_some();
    let (nulls, width) = (nulls.filter(|_| is_split || encoding == Encoding::PLAIN), width.unwrap_or(4));
    let present = nulls.map_or(0, |nulls| i64::from(count) - i64::from(nulls));
    if present.saturating_mul(width) > size {
        return Err(format!("a page of {size} bytes claims {present} values of {width} bytes"));
    }
    Ok(values)
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
