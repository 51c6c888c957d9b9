//! Pages for the parquet crate's column readers, unpacked here: the crate lets brotli, gzip and LZ4 grow past the size
//! that the page's header claims, and texts past any.

use std::cell::RefCell;
use std::fs::File;
use std::io::Read;
use std::sync::Arc;
use std::vec;

use arrow::datatypes::Fields;
use bytes::Bytes;
use flate2::read::MultiGzDecoder;
use lz4_flex::{block, frame};
use parquet::arrow::arrow_reader::{ParquetRecordBatchReader, RowGroups};
use parquet::arrow::{ProjectionMask, parquet_to_arrow_field_levels};
use parquet::basic::{Compression, Encoding, EncodingMask, Type};
use parquet::column::page::{Page, PageIterator, PageMetadata, PageReader};
use parquet::errors::{ParquetError, Result};
use parquet::file::metadata::{ColumnChunkMetaData, ParquetMetaData, RowGroupMetaData};
use polars_parquet_format::{Encoding as RawEncoding, PageType};
use zstd::bulk::Decompressor;

use crate::bounds::BATCH_TEXT_BYTES;
use crate::io::retry::read_exact;
use crate::parquet::page_header::{self, Page as RawPage};

/// Fewest rows of a batch, however long its texts may be.
const LEAST_BATCH: usize = 64;

thread_local! {
    /// Pages come one after the other: a new context for each would cost more than many pages do.
    static ZSTD: RefCell<Option<Decompressor<'static>>> = RefCell::new(Decompressor::new().ok());
}

fn fail<T>(detail: impl Into<String>) -> Result<T> {
    Err(ParquetError::General(detail.into()))
}

/// Some row groups of a file, whose pages keep to their claims.
#[derive(Debug)]
pub(crate) struct BoundedGroups<'m> {
    pub(crate) file: Arc<File>,
    pub(crate) metadata: &'m ParquetMetaData,
    pub(crate) groups: Vec<usize>,
    pub(crate) batch_rows: usize,
}

impl<'m> BoundedGroups<'m> {
    /// Reads the leaves of a mask, each as `kinds` has it, where it has kinds for all columns of the file.
    pub(crate) fn reader(
        &self,
        mask: ProjectionMask,
        kinds: Option<&Fields>,
    ) -> Result<ParquetRecordBatchReader> {
        let schema = self.metadata.file_metadata().schema_descr();
        let levels = parquet_to_arrow_field_levels(schema, mask, kinds)?;
        ParquetRecordBatchReader::try_new_with_row_groups(&levels, self, self.batch_rows, None)
    }

    fn chosen(&self) -> impl Iterator<Item = &'m RowGroupMetaData> {
        self.groups.iter().map(|group| self.metadata.row_group(*group))
    }
}

impl RowGroups for BoundedGroups<'_> {
    fn num_rows(&self) -> usize {
        self.chosen().map(|group| usize::try_from(group.num_rows()).unwrap_or(0)).sum()
    }

    fn column_chunks(&self, column: usize) -> Result<Box<dyn PageIterator>> {
        let chunks: Vec<_> =
            self.chosen().map(|group| (group.column(column).clone(), group.num_rows())).collect();
        // A table of few rows may hold long texts.
        let (file, batch_rows) = (Arc::clone(&self.file), self.batch_rows.min(self.num_rows()));
        Ok(Box::new(Chunks(chunks.into_iter().map(move |(chunk, rows)| {
            let pages = page_header::bounded(&file, &chunk, rows).map_err(ParquetError::General)?;
            Ok(Box::new(Pages::new(Arc::clone(&file), &chunk, pages, batch_rows)) as Box<dyn PageReader>)
        }))))
    }

    fn row_groups(&self) -> Box<dyn Iterator<Item = &RowGroupMetaData> + '_> {
        Box::new(self.chosen())
    }

    fn metadata(&self) -> &ParquetMetaData {
        self.metadata
    }
}

/// Readers of the chunks of one column, under the trait that the parquet crate asks for.
struct Chunks<I>(I);

impl<I: Iterator<Item = Result<Box<dyn PageReader>>> + Send> PageIterator for Chunks<I> {}

impl<I: Iterator<Item = Result<Box<dyn PageReader>>>> Iterator for Chunks<I> {
    type Item = I::Item;

    fn next(&mut self) -> Option<Self::Item> {
        self.0.next()
    }
}

/// The pages of one chunk.
pub(crate) struct Pages {
    file: Arc<File>,
    chunk: ColumnChunkMetaData,
    pages: vec::IntoIter<RawPage>,
    batch_rows: usize,
    /// Bytes of the latest page as they are stored.
    stored: Vec<u8>,
}

impl PageReader for Pages {
    fn get_next_page(&mut self) -> Result<Option<Page>> {
        self.pages.next().map(|page| self.read(&page)).transpose()
    }

    fn peek_next_page(&mut self) -> Result<Option<PageMetadata>> {
        let Some(page) = self.pages.as_slice().first() else { return Ok(None) };
        let v2 = page.header.data_page_header_v2.as_ref();
        let num_rows = v2.and_then(|header| usize::try_from(header.num_rows).ok());
        let num_levels = Some(page.values as usize);
        Ok(Some(PageMetadata { num_rows, num_levels, is_dict: page.is_dictionary() }))
    }

    fn skip_next_page(&mut self) -> Result<()> {
        self.pages.next();
        Ok(())
    }
}

impl Iterator for Pages {
    type Item = Result<Page>;

    fn next(&mut self) -> Option<Self::Item> {
        self.get_next_page().transpose()
    }
}

impl Pages {
    /// The checked pages of a chunk, read in batches of at most `batch_rows` rows.
    pub(crate) fn new(
        file: Arc<File>,
        chunk: &ColumnChunkMetaData,
        pages: Vec<RawPage>,
        batch_rows: usize,
    ) -> Self {
        Self { file, chunk: chunk.clone(), pages: pages.into_iter(), batch_rows, stored: Vec::new() }
    }

    /// Values of each data page, nulls included.
    pub(crate) fn values(&self) -> Vec<usize> {
        let pages = self.pages.as_slice().iter().filter(|page| !page.is_dictionary());
        pages.map(|page| page.values as usize).collect()
    }

    fn read(&mut self, page: &RawPage) -> Result<Page> {
        let header = &page.header;
        // Each page is read into the memory of the one before.
        let mut stored = std::mem::take(&mut self.stored);
        stored.resize(usize::try_from(header.compressed_page_size)?, 0);
        read_exact(&self.file, &mut stored, page.body_start)?;
        if header.crc.is_some_and(|crc| crc32fast::hash(&stored) != crc as u32) {
            return fail("Page CRC checksum mismatch");
        }
        let size = usize::try_from(header.uncompressed_page_size)?;
        let (mut plain, mut is_packed) = (0, true);
        if let Some(v2) = &header.data_page_header_v2 {
            let levels = [v2.definition_levels_byte_length, v2.repetition_levels_byte_length];
            let [definitions, repetitions] = levels.map(usize::try_from);
            plain = definitions?.saturating_add(repetitions?);
            is_packed = v2.is_compressed.unwrap_or(true);
        }
        if plain > size.min(stored.len()) {
            return fail("its levels are longer than their page");
        }
        let codec = self.chunk.compression();
        let buf: Bytes = if is_packed && codec != Compression::UNCOMPRESSED {
            let mut whole = Vec::new();
            whole.extend_from_slice(&stored[..plain]);
            if size > plain {
                unpack(codec, &stored[plain..], size, &mut whole)?;
            }
            if whole.len() != size {
                return fail(format!("a page of {size} bytes unpacks to {}", whole.len()));
            }
            self.stored = stored;
            whole.into()
        } else {
            stored.into()
        };
        self.page(page, buf)
    }

    fn page(&self, page: &RawPage, buf: Bytes) -> Result<Page> {
        let missing = || ParquetError::General("a page has no header of its kind".into());
        let num_values = page.values;
        match page.header.type_ {
            PageType::DICTIONARY_PAGE => {
                let header = page.header.dictionary_page_header.as_ref().ok_or_else(missing)?;
                self.check_texts(&buf)?;
                let is_sorted = header.is_sorted.unwrap_or(false);
                Ok(Page::DictionaryPage { buf, num_values, encoding: encoding(header.encoding)?, is_sorted })
            }
            PageType::DATA_PAGE => {
                let header = page.header.data_page_header.as_ref().ok_or_else(missing)?;
                Ok(Page::DataPage {
                    buf,
                    num_values,
                    encoding: encoding(header.encoding)?,
                    def_level_encoding: encoding(header.definition_level_encoding)?,
                    rep_level_encoding: encoding(header.repetition_level_encoding)?,
                    statistics: None,
                })
            }
            PageType::DATA_PAGE_V2 => {
                let header = page.header.data_page_header_v2.as_ref().ok_or_else(missing)?;
                Ok(Page::DataPageV2 {
                    buf,
                    num_values,
                    encoding: encoding(header.encoding)?,
                    num_nulls: u32::try_from(header.num_nulls)?,
                    num_rows: u32::try_from(header.num_rows)?,
                    def_levels_byte_len: u32::try_from(header.definition_levels_byte_length)?,
                    rep_levels_byte_len: u32::try_from(header.repetition_levels_byte_length)?,
                    is_compressed: header.is_compressed.unwrap_or(true),
                    statistics: None,
                })
            }
            PageType(other) => fail(format!("a page is of the unknown kind {other}")),
        }
    }

    /// Refuses a dictionary whose longest text would make a batch of rows larger than the bound.
    fn check_texts(&self, dictionary: &[u8]) -> Result<()> {
        let longest = match self.chunk.column_type() {
            Type::BYTE_ARRAY => {
                let (mut longest, mut rest) = (0, dictionary);
                while let Some((length, texts)) = rest.split_first_chunk() {
                    let length = u32::from_le_bytes(*length) as usize;
                    longest = longest.max(length);
                    rest = texts.get(length..).unwrap_or_default();
                }
                longest
            }
            Type::FIXED_LEN_BYTE_ARRAY => {
                usize::try_from(self.chunk.column_descr().type_length()).unwrap_or(0)
            }
            _ => 0,
        };
        let most = BATCH_TEXT_BYTES / self.batch_rows.max(1);
        if longest <= most {
            return Ok(());
        }
        fail(format!("its dictionary holds a text of {longest} bytes, more than the limit of {most}"))
    }
}

/// Whether texts of a chunk share their beginnings: each may be as long as a page.
pub(crate) fn has_shared_beginnings(chunk: &ColumnChunkMetaData) -> bool {
    chunk.encodings().any(|encoding| encoding == Encoding::DELTA_BYTE_ARRAY)
}

/// Rows of a batch of texts that may each be as long as one of these pages.
pub(crate) fn batch_rows(pages: &[RawPage], usual: usize) -> usize {
    let largest = pages.iter().map(|page| page.header.uncompressed_page_size).max().unwrap_or(0);
    let fitting = BATCH_TEXT_BYTES / usize::try_from(largest).unwrap_or(0).max(1);
    fitting.clamp(LEAST_BATCH, usual.max(LEAST_BATCH))
}

/// The parquet crate's encoding of this number.
fn encoding(raw: RawEncoding) -> Result<Encoding> {
    let bit = u32::try_from(raw.0).ok().and_then(|number| 1_i32.checked_shl(number));
    let known = bit.and_then(|bit| EncodingMask::try_new(bit).ok()?.encodings().next());
    known.map_or_else(|| fail(format!("a page uses the unknown encoding {}", raw.0)), Ok)
}

/// Appends what `packed` unpacks to until `into` holds one byte more than the page claims.
fn unpack(codec: Compression, packed: &[u8], size: usize, into: &mut Vec<u8>) -> Result<()> {
    let left = size - into.len();
    let unpacked = match codec {
        Compression::GZIP(_) => stream(left, into, MultiGzDecoder::new(packed)),
        Compression::BROTLI(_) => {
            stream(left, into, brotli::Decompressor::new(packed, left.clamp(1, 1 << 16)))
        }
        Compression::LZ4 => fixed(left, into, |out| hadoop_blocks(packed, out))
            .or_else(|| stream(left, into, frame::FrameDecoder::new(packed)))
            .or_else(|| fixed(left, into, |out| block::decompress_into(packed, out).ok())),
        Compression::LZ4_RAW => fixed(left, into, |out| block::decompress_into(packed, out).ok()),
        Compression::SNAPPY => {
            fixed(left, into, |out| snap::raw::Decoder::new().decompress(packed, out).ok())
        }
        Compression::ZSTD(_) => zstd(left, into, packed),
        other @ (Compression::UNCOMPRESSED | Compression::LZO) => {
            return fail(format!("its compression {other} is not read"));
        }
    };
    unpacked.map_or_else(|| fail("a page cannot be unpacked to the size that it claims"), Ok)
}

/// Appends as many bytes as are unpacked into a buffer of this size, or nothing.
fn fixed(left: usize, into: &mut Vec<u8>, unpack: impl FnOnce(&mut [u8]) -> Option<usize>) -> Option<()> {
    let before = into.len();
    into.resize(before + left, 0);
    let bytes = unpack(&mut into[before..]);
    into.truncate(before + bytes.unwrap_or(0));
    bytes.map(drop)
}

/// Appends at most one byte more than are left, or nothing.
fn stream(left: usize, into: &mut Vec<u8>, unpacked: impl Read) -> Option<()> {
    let before = into.len();
    let read = unpacked.take(left as u64 + 1).read_to_end(into);
    read.inspect_err(|_| into.truncate(before)).ok().map(drop)
}

/// Into fresh memory, which need not be set to zeros: no more than its capacity is filled.
fn zstd(left: usize, into: &mut Vec<u8>, packed: &[u8]) -> Option<()> {
    let mut unpacked = ZSTD.with_borrow_mut(|zstd| zstd.as_mut()?.decompress(packed, left).ok())?;
    if into.is_empty() {
        *into = unpacked;
    } else {
        into.append(&mut unpacked);
    }
    Some(())
}

/// Hadoop's form of LZ4: blocks, each after its two sizes. `None` where the blocks do not fill the buffer exactly.
fn hadoop_blocks(mut packed: &[u8], mut out: &mut [u8]) -> Option<usize> {
    let size = out.len();
    while !packed.is_empty() {
        let (unpacked, rest) = packed.split_first_chunk()?;
        let (stored, rest) = rest.split_first_chunk()?;
        let (block, rest) = rest.split_at_checked(u32::from_be_bytes(*stored) as usize)?;
        let (filled, free) = out.split_at_mut_checked(u32::from_be_bytes(*unpacked) as usize)?;
        (block::decompress_into(block, filled).ok()? == filled.len()).then_some(())?;
        (packed, out) = (rest, free);
    }
    out.is_empty().then_some(size)
}
