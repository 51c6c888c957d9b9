//! Causes of errors that the parquet crate does not name, from the footer as it is written: encryption, and encodings
//! of later versions of the format.

use std::fs::File;

use polars_parquet_format::FileMetaData;
use polars_parquet_format::thrift::protocol::TCompactInputProtocol;

use crate::io::read_at;

/// Longest footer that is read to explain an error.
const LONGEST_FOOTER: u64 = 64 << 20;
/// The highest encoding that is read: byte stream split.
const HIGHEST_ENCODING: i32 = 9;
/// Adaptive lossless floating point, the encoding that follows it.
const ALP: i32 = 10;

fn footer(file: &File) -> Option<FileMetaData> {
    let length = read_at::file_length(file).ok()?;
    let mut trailer = [0; 8];
    read_at::read_exact(file, &mut trailer, length.checked_sub(8)?).ok()?;
    let bytes = u64::from(u32::from_le_bytes(*trailer.first_chunk()?));
    if bytes > LONGEST_FOOTER || trailer[4..] != *b"PAR1" {
        return None;
    }
    let mut footer = vec![0; bytes as usize];
    read_at::read_exact(file, &mut footer, (length - 8).checked_sub(bytes)?).ok()?;
    let mut rest = footer.as_slice();
    let mut protocol = TCompactInputProtocol::new(&mut rest, 64 << 20);
    FileMetaData::read_from_in_protocol(&mut protocol).ok()
}

/// Whether a file with a readable footer is encrypted, and this leaf by its own key or with the rest.
pub(crate) fn encrypted(file: &File, leaf: usize) -> Option<bool> {
    let footer = footer(file)?;
    let is_column = footer
        .row_groups
        .iter()
        .any(|group| group.columns.get(leaf).is_some_and(|chunk| chunk.crypto_metadata.is_some()));
    (is_column || footer.encryption_algorithm.is_some()).then_some(is_column)
}

/// The name of an encoding that is not read, if the file uses one.
pub(crate) fn unknown_encoding(file: &File) -> Option<String> {
    let footer = footer(file)?;
    let chunks = footer.row_groups.iter().flat_map(|group| &group.columns);
    let encodings = chunks.filter_map(|chunk| chunk.meta_data.as_ref()).flat_map(|meta| &meta.encodings);
    let unknown = encodings.map(|encoding| encoding.0).find(|number| *number > HIGHEST_ENCODING)?;
    Some(if unknown == ALP { "ALP".to_owned() } else { format!("number {unknown}") })
}
