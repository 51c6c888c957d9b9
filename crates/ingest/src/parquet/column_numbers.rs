//! Numeric column chunks into a channel: by the parquet crate's column reader, without an Arrow array in between.
//!
//! Chunks of doubles and floats that hold no lists are read here; the others by Arrow's reader. Pages without a selected row
//! are not decompressed, which changes no value: rows that are not selected are removed from pages that hold both.

use std::ops::Range;

use parquet::basic::Type;
use parquet::column::page::PageReader;
use parquet::column::reader::ColumnReaderImpl;
use parquet::data_type::DataType;
use parquet::errors::Result;
use parquet::file::metadata::ColumnChunkMetaData;

use crate::channel::column_builder::{BATCH, ColumnBuilder};
use crate::parquet::page_reader::Pages;

/// Selected rows of a table: stretches in order and apart from each other; `None` for every row.
pub(crate) type RowSelection<'a> = Option<&'a [Range<usize>]>;

/// Whether any of these rows is selected.
pub(crate) fn intersects(selection: RowSelection<'_>, rows: &Range<usize>) -> bool {
    selection.is_none_or(|stretches| {
        let next = stretches.partition_point(|stretch| stretch.end <= rows.start);
        stretches.get(next).is_some_and(|stretch| stretch.start < rows.end)
    })
}

/// Whether the numbers of a chunk are read here.
pub(crate) fn is_plain(chunk: &ColumnChunkMetaData) -> bool {
    let column = chunk.column_descr();
    matches!(column.physical_type(), Type::DOUBLE | Type::FLOAT)
        && column.max_rep_level() == 0
        && column.max_def_level() <= 1
}

/// Appends the values of a chunk, page by page; a null is NaN, and so is all of a page of which nothing is wanted: it is
/// not unpacked.
pub(crate) fn append<T: DataType>(
    pages: Pages,
    chunk: &ColumnChunkMetaData,
    wanted: RowSelection<'_>,
    into: &mut ColumnBuilder,
) -> Result<()>
where
    T::T: Copy + Into<f64>,
{
    let column = chunk.column_descr_ptr();
    let is_nullable = column.max_def_level() == 1;
    let counts = pages.values();
    let mut reader = ColumnReaderImpl::<T>::new(column, Box::new(pages) as Box<dyn PageReader>);
    let (mut values, mut levels) = (Vec::with_capacity(BATCH), Vec::with_capacity(BATCH));
    for count in counts {
        let end = into.len() + count;
        if !intersects(wanted, &(into.len()..end)) {
            into.append_nulls(reader.skip_records(count)?);
        }
        while into.len() < end {
            values.clear();
            levels.clear();
            let marks = is_nullable.then_some(&mut levels);
            let (read, _, _) = reader.read_records(BATCH.min(end - into.len()), marks, None, &mut values)?;
            if read == 0 {
                return Ok(());
            }
            if levels.is_empty() || values.len() == levels.len() {
                into.extend(values.iter().map(|value| (*value).into()));
            } else {
                let mut present = values.iter();
                let value = |level: &i16| (*level > 0).then(|| present.next()).flatten();
                let value = levels.iter().map(value);
                into.extend(value.map(|value| value.map_or(f64::NAN, |value| (*value).into())));
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use arrow::array::{ArrayRef, Float32Array, Float64Array, RecordBatch};
    use parquet::basic::{Compression, Encoding, ZstdLevel};
    use parquet::file::properties::{WriterProperties, WriterVersion};
    use proptest::prelude::*;

    use super::*;
    use crate::parquet::log_file::LogFile;
    use crate::parquet::writer::write_batch;

    /// Values that may be missing, some of which stay for a while.
    fn channel(value: impl Strategy<Value = f32>) -> impl Strategy<Value = Vec<Option<f32>>> {
        let stays = prop_oneof![4 => Just(1_usize), 1 => 1_usize..60];
        let values = proptest::collection::vec((proptest::option::weighted(0.9, value), stays), 1..200);
        values.prop_map(|all| all.into_iter().flat_map(|(v, stays)| std::iter::repeat_n(v, stays)).collect())
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(96))]
        /// Pages of both versions, both widths, split or not, as codes or not, under several codecs, with missing values
        /// or without: every wanted number comes back.
        #[test]
        fn numbers_come_back_as_they_were_written(
            values in prop_oneof![channel(-1e30_f32..1e30), channel((-9_i8..9).prop_map(f32::from))],
            is_double in any::<bool>(), second in any::<bool>(), codec in 0..7_usize, split in any::<bool>(),
            is_coded in any::<bool>(), from in 0..3000_usize,
        ) {
            let codecs = [
                Compression::UNCOMPRESSED, Compression::ZSTD(ZstdLevel::default()), Compression::SNAPPY,
                Compression::GZIP(parquet::basic::GzipLevel::default()), Compression::LZ4, Compression::LZ4_RAW,
                Compression::BROTLI(parquet::basic::BrotliLevel::default()),
            ];
            let properties = WriterProperties::builder()
                .set_writer_version(if second { WriterVersion::PARQUET_2_0 } else { WriterVersion::PARQUET_1_0 })
                .set_compression(codecs[codec])
                .set_encoding(if split { Encoding::BYTE_STREAM_SPLIT } else { Encoding::PLAIN })
                .set_dictionary_enabled(is_coded)
                .set_dictionary_page_size_limit(400)
                .set_data_page_row_count_limit(100)
                .set_write_batch_size(50)
                .set_max_row_group_row_count(Some(2350));
            let wide: Vec<_> = values.iter().map(|v| v.map(f64::from)).collect();
            let array: ArrayRef = if is_double {
                Arc::new(Float64Array::from(wide.clone()))
            } else {
                Arc::new(Float32Array::from(values.clone()))
            };
            let batch = RecordBatch::try_from_iter_with_nullable([("x", array, values.contains(&None))]).unwrap();
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("x.parquet");
            write_batch(std::fs::File::create(&path).unwrap(), &batch, properties.build()).unwrap();
            let from = from.min(values.len());
            let stretch = [from..values.len(), values.len()..values.len()];
            let mut read = ColumnBuilder::new(0, None, false);
            LogFile::open(&path).unwrap().append_numbers("x", Some(&stretch), &mut read).unwrap();
            let read = read.finish().0;
            prop_assert_eq!(read.len(), values.len());
            let bits = |value: f64| if value.is_nan() { u64::MAX } else { value.to_bits() };
            for (read, written) in read.iter().zip(&wide).skip(from) {
                prop_assert_eq!(bits(*read), bits(written.unwrap_or(f64::NAN)));
            }
        }
    }
}
