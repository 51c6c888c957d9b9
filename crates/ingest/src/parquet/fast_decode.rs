//! Fast path for numeric column chunks: pages are decoded into a channel without the parquet crate's reader.
//!
//! Most logs hold doubles or floats, plain, byte-stream-split or dictionary-encoded, compressed by zstd or not
//! at all. These need none of what the parquet crate makes for each page and batch: a context, buffers, levels, an
//! array. Other encodings, and chunks that do not match their metadata, are left to that reader and its error messages.
use std::cell::RefCell;
use std::fs::File;
use std::ops::Range;

use multiversion::multiversion;
use parquet::basic::{Compression, Type};
use parquet::file::metadata::ColumnChunkMetaData;
use polars_parquet_format::{DataPageHeader, DataPageHeaderV2, Encoding, PageHeader, PageType};
use zstd::bulk::Decompressor;

use crate::channel::column_builder::{BATCH, ColumnBuilder};
use crate::io::read_at;
use crate::parquet::dictionary::{DictIndices, PADDING_BYTES, uleb128};
use crate::parquet::page_header::Page;
use crate::parquet::row_selection::RowSelection;

/// Buffers above this are given back after use, bytes: pages are about a mebibyte.
const MAX_BUFFER_BYTES: usize = 4 << 20;
/// Values that are brought together from their streams at a time.
const INTERLEAVE_BATCH: usize = 512;

thread_local! {
    /// Pages come one after the other: each is read into the memory of the one before.
    static BUFFERS: RefCell<DecodeBuffers> = RefCell::default();
}

/// What one page after the other is read into.
#[derive(Default)]
struct DecodeBuffers {
    stored: Vec<u8>,
    page: Vec<u8>,
    /// What the codes of a chunk stand for.
    dictionary: Vec<f64>,
    zstd: Option<Decompressor<'static>>,
}

/// How the numbers of a chunk lie in its pages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct ChunkFormat {
    is_double: bool,
    is_zstd: bool,
    is_nullable: bool,
}

impl ChunkFormat {
    fn of(chunk: &ColumnChunkMetaData) -> Option<Self> {
        let column = chunk.column_descr();
        let is_double = match column.physical_type() {
            Type::DOUBLE => true,
            Type::FLOAT => false,
            _ => return None,
        };
        let is_zstd = match chunk.compression() {
            Compression::ZSTD(_) => true,
            Compression::UNCOMPRESSED => false,
            _ => return None,
        };
        let is_flat = column.max_rep_level() == 0 && column.max_def_level() <= 1;
        is_flat.then_some(Self { is_double, is_zstd, is_nullable: column.max_def_level() == 1 })
    }

    fn width(self) -> usize {
        if self.is_double { 8 } else { 4 }
    }
}

/// Appends every number of a chunk, of which these are the pages; a null is NaN, and so is all of a page of which
/// nothing is wanted. False, and nothing appended, where the chunk must be left to Parquet's own reader.
pub(crate) fn decode_chunk(
    (file, chunk): (&File, &ColumnChunkMetaData),
    pages: &[Page],
    wanted: RowSelection<'_>,
    into: &mut ColumnBuilder,
) -> bool {
    let before = into.checkpoint();
    let done = ChunkFormat::of(chunk).and_then(|form| {
        BUFFERS.with_borrow_mut(|room| {
            let done = room.append((file, form), pages, wanted, into);
            room.shrink_buffers();
            done
        })
    });
    if done.is_none() {
        into.rollback(before);
    }
    done.is_some()
}

impl DecodeBuffers {
    fn append(
        &mut self,
        (file, form): (&File, ChunkFormat),
        pages: &[Page],
        wanted: RowSelection<'_>,
        into: &mut ColumnBuilder,
    ) -> Option<()> {
        self.dictionary.clear();
        let begun = into.len();
        for page in pages {
            if page.header.type_ == PageType::DICTIONARY_PAGE {
                self.read(file, page)?;
                self.load_dictionary(&page.header, form)?;
                continue;
            }
            let data = PageLayout::of(&page.header, form)?;
            let first = into.len() - begun;
            if !wanted.intersects(first..first + data.values) {
                into.append_nulls(data.values);
                continue;
            }
            self.read(file, page)?;
            self.decompress(&page.header, data.levels_len, form.is_zstd && data.is_compressed)?;
            let (levels, body) = data.split_levels(&self.page)?;
            let runs = match levels {
                Some(levels) => validity_runs(levels, data.values)?,
                None => vec![ValidityRun { is_present: true, values: data.values }],
            };
            let missing: usize = runs.iter().filter(|run| !run.is_present).map(|run| run.values).sum();
            if data.missing.is_some_and(|stated| stated != missing) {
                return None;
            }
            if data.coding == ValueEncoding::Dictionary {
                let mut codes = DictIndices::of(body)?;
                append_runs(&runs, into, |values, into| codes.append(values, &self.dictionary, into))?;
            } else {
                let bytes = body.strip_suffix(&[0; PADDING_BYTES])?;
                let numbers = ValueReader {
                    bytes,
                    is_split: data.coding == ValueEncoding::ByteStreamSplit,
                    width: form.width(),
                };
                numbers.append(&runs, into)?;
            }
        }
        Some(())
    }

    fn load_dictionary(&mut self, header: &PageHeader, form: ChunkFormat) -> Option<()> {
        let said = header.dictionary_page_header.as_ref()?;
        let is_second = !self.dictionary.is_empty();
        if is_second || !matches!(said.encoding, Encoding::PLAIN | Encoding::PLAIN_DICTIONARY) {
            return None;
        }
        self.decompress(header, 0, form.is_zstd)?;
        let (bytes, count) =
            (self.page.strip_suffix(&[0; PADDING_BYTES])?, usize::try_from(said.num_values).ok()?);
        if bytes.len() != count.checked_mul(form.width())? {
            return None;
        }
        if form.is_double {
            self.dictionary.extend(bytes.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b)));
        } else {
            self.dictionary
                .extend(bytes.as_chunks::<4>().0.iter().map(|b| f64::from(f32::from_le_bytes(*b))));
        }
        Some(())
    }

    /// The bytes of a page as they are stored, if they are those that its checksum was made of.
    fn read(&mut self, file: &File, page: &Page) -> Option<()> {
        self.stored.resize(usize::try_from(page.header.compressed_page_size).ok()?, 0);
        read_at::read_exact(file, &mut self.stored, page.body_start).ok()?;
        let is_whole = |crc: i32| crc32fast::hash(&self.stored) == crc as u32;
        page.header.crc.is_none_or(is_whole).then_some(())
    }

    /// Brings the bytes of a page to what they were before compression, and a few zeros after them.
    fn decompress(&mut self, header: &PageHeader, levels_len: usize, is_compressed: bool) -> Option<()> {
        if !is_compressed {
            std::mem::swap(&mut self.stored, &mut self.page);
            self.page.extend([0; PADDING_BYTES]);
            return Some(());
        }
        let bytes = usize::try_from(header.uncompressed_page_size).ok()?;
        self.page.resize(bytes + PADDING_BYTES, 0);
        let (page, spare) = self.page.split_at_mut(bytes);
        spare.fill(0);
        let (head, rest) = page.split_at_mut_checked(levels_len)?;
        let (plain, packed) = self.stored.split_at_checked(levels_len)?;
        head.copy_from_slice(plain);
        if self.zstd.is_none() {
            self.zstd = Decompressor::new().ok();
        }
        let unpacked = self.zstd.as_mut()?.decompress_to_buffer(packed, rest).ok()?;
        (unpacked == rest.len()).then_some(())
    }

    fn shrink_buffers(&mut self) {
        for buffer in [&mut self.stored, &mut self.page] {
            if buffer.capacity() > MAX_BUFFER_BYTES {
                *buffer = Vec::new();
            }
        }
        if 8 * self.dictionary.capacity() > MAX_BUFFER_BYTES {
            self.dictionary = Vec::new();
        }
    }
}

/// How numbers are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ValueEncoding {
    Plain,
    /// Byte k of every number in stream k.
    ByteStreamSplit,
    /// As codes of the chunk's dictionary.
    Dictionary,
}

/// Layout of the values in a page, from its header.
#[derive(Debug, Clone, Copy)]
struct PageLayout {
    /// Numbers, missing ones included.
    values: usize,
    coding: ValueEncoding,
    is_compressed: bool,
    /// Bytes of levels that lie before what is compressed.
    levels_len: usize,
    levels: DefinitionLevels,
    /// Missing numbers, where the header states them.
    missing: Option<usize>,
}

/// Where the marks of missing numbers lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum DefinitionLevels {
    /// Nowhere: nothing is missing.
    None,
    /// Before the numbers, after their own length.
    Counted,
    /// Before the numbers, so many bytes.
    Bytes(usize),
}

impl PageLayout {
    fn of(header: &PageHeader, form: ChunkFormat) -> Option<Self> {
        match header.type_ {
            PageType::DATA_PAGE => Self::first(header.data_page_header.as_ref()?, form),
            PageType::DATA_PAGE_V2 => Self::second(header.data_page_header_v2.as_ref()?),
            _ => None,
        }
    }

    fn first(header: &DataPageHeader, form: ChunkFormat) -> Option<Self> {
        let is_known = |encoding: Encoding| matches!(encoding.0, 0 | 2..=9);
        if form.is_nullable && header.definition_level_encoding != Encoding::RLE
            || !is_known(header.definition_level_encoding)
            || !is_known(header.repetition_level_encoding)
        {
            return None;
        }
        let levels = if form.is_nullable { DefinitionLevels::Counted } else { DefinitionLevels::None };
        let (values, coding) = (usize::try_from(header.num_values).ok()?, coding(header.encoding)?);
        Some(Self { values, coding, is_compressed: true, levels_len: 0, levels, missing: None })
    }

    fn second(header: &DataPageHeaderV2) -> Option<Self> {
        let levels_len = usize::try_from(header.definition_levels_byte_length).ok()?;
        if header.repetition_levels_byte_length != 0 {
            return None;
        }
        let (values, coding) = (usize::try_from(header.num_values).ok()?, coding(header.encoding)?);
        let is_compressed = header.is_compressed.unwrap_or(true);
        let (levels, missing) =
            (DefinitionLevels::Bytes(levels_len), usize::try_from(header.num_nulls).ok()?);
        Some(Self { values, coding, is_compressed, levels_len, levels, missing: Some(missing) })
    }

    /// A page's bytes, split_levels into levels and numbers.
    fn split_levels<'p>(&self, body: &'p [u8]) -> Option<(Option<&'p [u8]>, &'p [u8])> {
        match self.levels {
            DefinitionLevels::None | DefinitionLevels::Bytes(0) => Some((None, body)),
            DefinitionLevels::Bytes(bytes) => {
                body.split_at_checked(bytes).map(|(levels, rest)| (Some(levels), rest))
            }
            DefinitionLevels::Counted => {
                let (length, rest) = body.split_first_chunk()?;
                let (levels, rest) = rest.split_at_checked(u32::from_le_bytes(*length) as usize)?;
                Some((Some(levels), rest))
            }
        }
    }
}

fn coding(encoding: Encoding) -> Option<ValueEncoding> {
    match encoding {
        Encoding::PLAIN => Some(ValueEncoding::Plain),
        Encoding::BYTE_STREAM_SPLIT => Some(ValueEncoding::ByteStreamSplit),
        Encoding::RLE_DICTIONARY | Encoding::PLAIN_DICTIONARY => Some(ValueEncoding::Dictionary),
        _ => None,
    }
}

/// Appends so many numbers of a page after each other as are there, and leaves out what is missing between them.
fn append_runs(
    runs: &[ValidityRun],
    into: &mut ColumnBuilder,
    mut append: impl FnMut(usize, &mut ColumnBuilder) -> Option<()>,
) -> Option<()> {
    for run in runs {
        if run.is_present {
            append(run.values, into)?;
        } else {
            into.append_nulls(run.values);
        }
    }
    Some(())
}

/// The numbers of a page, without the missing ones.
#[derive(Debug, Clone, Copy)]
struct ValueReader<'p> {
    bytes: &'p [u8],
    is_split: bool,
    width: usize,
}

impl ValueReader<'_> {
    fn append(self, runs: &[ValidityRun], into: &mut ColumnBuilder) -> Option<()> {
        let count: usize = runs.iter().filter(|run| run.is_present).map(|run| run.values).sum();
        if self.bytes.len() != count.checked_mul(self.width)? {
            return None;
        }
        let mut from = 0;
        append_runs(runs, into, |values, into| {
            self.append_from(from..from + values, count, into);
            from += values;
            Some(())
        })
    }

    /// Appends some of the page's `count` numbers.
    fn append_from(self, Range { start: from, end }: Range<usize>, count: usize, into: &mut ColumnBuilder) {
        match (self.width, self.is_split) {
            (8, false) => {
                for bytes in self.bytes[8 * from..8 * end].as_chunks::<8>().0.chunks(BATCH) {
                    into.extend(bytes.iter().map(|b| f64::from_le_bytes(*b)));
                }
            }
            (_, false) => {
                for bytes in self.bytes[4 * from..4 * end].as_chunks::<4>().0.chunks(BATCH) {
                    into.extend(bytes.iter().map(|b| f32::from_le_bytes(*b).into()));
                }
            }
            (8, true) => self.interleave_batches(from..end, count, interleave_f64, |batch| {
                into.extend(batch.iter().map(|bits| f64::from_bits(*bits)));
            }),
            (_, true) => self.interleave_batches(from..end, count, interleave_f32, |batch| {
                into.extend(batch.iter().map(|bits| f32::from_bits(*bits).into()));
            }),
        }
    }

    /// Interleaves `count` byte-stream-split values of a page, batch by batch: byte k of every value is in
    /// stream k.
    fn interleave_batches<const WIDTH: usize, T: Copy + Default>(
        self,
        numbers: Range<usize>,
        count: usize,
        join: fn([&[u8]; WIDTH], &mut [T]),
        mut take: impl FnMut(&[T]),
    ) {
        let mut batch = [T::default(); INTERLEAVE_BATCH];
        for start in numbers.clone().step_by(INTERLEAVE_BATCH) {
            let batch = &mut batch[..INTERLEAVE_BATCH.min(numbers.end - start)];
            join(std::array::from_fn(|k| &self.bytes[k * count + start..][..batch.len()]), batch);
            take(batch);
        }
    }
}

/// The bits of doubles from their bytes.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
fn interleave_f64([a, b, c, d, e, f, g, h]: [&[u8]; 8], joined: &mut [u64]) {
    let wide = |byte: u8, place: u32| u64::from(byte) << (8 * place);
    let count = joined.len();
    // Slices that are known to be of one length need no look at their ends in the loop.
    let (a, b, c, d) = (&a[..count], &b[..count], &c[..count], &d[..count]);
    let (e, f, g, h) = (&e[..count], &f[..count], &g[..count], &h[..count]);
    for k in 0..count {
        let low = wide(a[k], 0) | wide(b[k], 1) | wide(c[k], 2) | wide(d[k], 3);
        joined[k] = low | wide(e[k], 4) | wide(f[k], 5) | wide(g[k], 6) | wide(h[k], 7);
    }
}

/// The bits of floats from their bytes.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
fn interleave_f32([a, b, c, d]: [&[u8]; 4], joined: &mut [u32]) {
    let wide = |byte: u8, place: u32| u32::from(byte) << (8 * place);
    let count = joined.len();
    let (a, b, c, d) = (&a[..count], &b[..count], &c[..count], &d[..count]);
    for k in 0..count {
        joined[k] = wide(a[k], 0) | wide(b[k], 1) | wide(c[k], 2) | wide(d[k], 3);
    }
}

/// Numbers in a row that are all there or all missing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct ValidityRun {
    is_present: bool,
    values: usize,
}

/// The marks of a page's values, where a mark is one bit: runs, and bits in interleave_f64 (the Parquet format's
/// RLE/bit-packed hybrid). None where they end early.
fn validity_runs(mut levels: &[u8], values: usize) -> Option<Vec<ValidityRun>> {
    let (mut runs, mut left) = (Vec::new(), values);
    while left > 0 {
        let header = uleb128(&mut levels)?;
        if header & 1 == 0 {
            let count = usize::try_from(header >> 1).ok()?.min(left);
            let (mark, rest) = levels.split_first()?;
            // Levels of a column that may be null are zero and one.
            if *mark > 1 {
                return None;
            }
            (levels, left) = (rest, left - count);
            extend(&mut runs, *mark == 1, count);
        } else {
            let (bytes, rest) = levels.split_at_checked(usize::try_from(header >> 1).ok()?)?;
            let count = bytes.len().saturating_mul(8).min(left);
            (0..count).for_each(|k| extend(&mut runs, bytes[k / 8] >> (k % 8) & 1 == 1, 1));
            (levels, left) = (rest, left - count);
        }
        if header < 2 {
            return None;
        }
    }
    Some(runs)
}

fn extend(runs: &mut Vec<ValidityRun>, is_present: bool, values: usize) {
    match runs.last_mut() {
        Some(run) if run.is_present == is_present => run.values += values,
        _ => runs.push(ValidityRun { is_present, values }),
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use arrow::array::{ArrayRef, Float32Array, Float64Array, RecordBatch};
    use parquet::arrow::ArrowWriter;
    use parquet::basic::{self, ZstdLevel};
    use parquet::file::metadata::{ParquetMetaData, ParquetMetaDataReader};
    use parquet::file::properties::{WriterProperties, WriterVersion};
    use proptest::prelude::*;

    use super::*;
    use crate::parquet::page_header::bounded;

    fn zstd() -> Compression {
        Compression::ZSTD(ZstdLevel::default())
    }

    /// How a file is written.
    #[derive(Debug, Clone, Copy)]
    struct Written {
        is_double: bool,
        version: WriterVersion,
        compression: Compression,
        encoding: basic::Encoding,
        /// Codes of a dictionary, until it has grown too large.
        is_coded: bool,
    }

    fn properties(written: Written) -> WriterProperties {
        WriterProperties::builder()
            .set_writer_version(written.version)
            .set_compression(written.compression)
            .set_encoding(written.encoding)
            .set_dictionary_enabled(written.is_coded)
            .set_dictionary_page_size_limit(400)
            .set_data_page_row_count_limit(100)
            .set_write_batch_size(50)
            .set_max_row_group_row_count(Some(350))
            .build()
    }

    /// Writes numbers by Parquet's own writer, and reads them straight.
    fn read_back(values: &[Option<f32>], written: Written) -> Option<Vec<f64>> {
        let wide = || values.iter().map(|v| v.map(f64::from));
        let array: ArrayRef = if written.is_double {
            Arc::new(wide().collect::<Float64Array>())
        } else {
            Arc::new(values.iter().copied().collect::<Float32Array>())
        };
        let batch = RecordBatch::try_from_iter_with_nullable([("x", array, values.contains(&None))]).unwrap();
        let file = tempfile::tempfile().unwrap();
        let sink = file.try_clone().unwrap();
        let mut writer = ArrowWriter::try_new(sink, batch.schema(), Some(properties(written))).unwrap();
        writer.write(&batch).unwrap();
        writer.close().unwrap();
        let footer: ParquetMetaData = ParquetMetaDataReader::new().parse_and_finish(&file).unwrap();
        let mut read = ColumnBuilder::with_capacity(0, None);
        let all_straight = footer.row_groups().iter().all(|group| {
            let before = read.len();
            let pages = bounded(&file, group.column(0), group.num_rows()).unwrap();
            let straight = decode_chunk((&file, group.column(0)), &pages, RowSelection::ALL, &mut read);
            straight || read.len() != before
        });
        all_straight.then(|| read.finish().0)
    }

    fn bits(values: impl Iterator<Item = f64>) -> Vec<u64> {
        values.map(|v| if v.is_nan() { u64::MAX } else { v.to_bits() }).collect()
    }

    /// Values that may be missing, some of which stay for a while.
    fn channel(value: impl Strategy<Value = f32>) -> impl Strategy<Value = Vec<Option<f32>>> {
        let stays = prop_oneof![4 => Just(1_usize), 1 => 1_usize..60];
        let values = proptest::collection::vec((proptest::option::weighted(0.9, value), stays), 1..200);
        values.prop_map(|all| all.into_iter().flat_map(|(v, stays)| std::iter::repeat_n(v, stays)).collect())
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(96))]
        /// Pages of both versions, both widths, split or not, as codes or not, compressed or not, with missing values
        /// or without: every number comes back.
        #[test]
        fn numbers_come_back_as_they_were_written(
            values in prop_oneof![channel(-1e30_f32..1e30), channel((-9_i8..9).prop_map(f32::from))],
            whole in any::<bool>(), is_double in any::<bool>(), second in any::<bool>(), packed in any::<bool>(),
            split in any::<bool>(), is_coded in any::<bool>(),
        ) {
            let values: Vec<_> = values.into_iter().map(|v| if whole { v.or(Some(0.5)) } else { v }).collect();
            let written = Written {
                is_double,
                version: if second { WriterVersion::PARQUET_2_0 } else { WriterVersion::PARQUET_1_0 },
                compression: if packed { zstd() } else { Compression::UNCOMPRESSED },
                encoding: if split { basic::Encoding::BYTE_STREAM_SPLIT } else { basic::Encoding::PLAIN },
                is_coded,
            };
            let read = read_back(&values, written).unwrap();
            let wanted = values.iter().map(|v| v.map_or(f64::NAN, f64::from));
            prop_assert_eq!(bits(read.into_iter()), bits(wanted));
        }
    }

    #[test]
    fn other_kinds_are_left_to_parquets_own_reader() {
        let usual = Written {
            is_double: true,
            version: WriterVersion::PARQUET_1_0,
            compression: zstd(),
            encoding: basic::Encoding::PLAIN,
            is_coded: false,
        };
        let values: Vec<Option<f32>> = (0..500).map(|k| Some(k as f32)).collect();
        assert!(read_back(&values, usual).is_some());
        assert_eq!(read_back(&values, Written { compression: Compression::SNAPPY, ..usual }), None);
    }

    /// The Parquet format's own example of its hybrid: 3 in one byte of bits, then a run.
    #[test]
    fn marks_are_read_from_bits_and_from_runs() {
        let run = |is_present, values| ValidityRun { is_present, values };
        // One group of eight bits (1, 0, 1, 1, 1, 1, 1, 1), then four times 0.
        let found = validity_runs(&[0b11, 0b1111_1101, 4 << 1, 0], 12);
        assert_eq!(found, Some(vec![run(true, 1), run(false, 1), run(true, 6), run(false, 4)]));
        assert_eq!(validity_runs(&[0b11, 0xff], 9), None);
        assert_eq!(validity_runs(&[0, 1, 0, 1], 9), None);
    }
}
