//! A data file: Parquet whose name contains the digest of its content.
//!
//! The digest is in the name, not in the tags of the Delta action nor in a second file: checkpoints and
//! log clean-up may drop tags, a second file can be lost, and `b3sum` verifies the file against its name.

use std::path::Path;

use arrow::array::RecordBatch;
use deltalake::kernel::Add;
use jiff::Timestamp;
use parquet::arrow::ArrowWriter;
use parquet::basic::{Compression, ZstdLevel};
use parquet::file::properties::WriterProperties;

use crate::delta::file_stats;
use crate::delta::location::Location;
use crate::error::Error;

/// Rows of a row group: few enough that reading one tail's history decodes little of a big file.
pub(crate) const GROUP_ROWS: usize = 16_384;

const DIGEST_DIGITS: usize = 64;

/// Writes a batch as a data file into a table's folder and returns the action that adds it.
///
/// The name begins with the table version, so that the same content written again later is another
/// file: Delta cannot remove and add one name in one commit.
pub(crate) fn write(
    location: &Location,
    version: u64,
    batch: &RecordBatch,
    data_change: bool,
) -> Result<Add, Error> {
    let properties = WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::try_new(3)?))
        .set_max_row_group_row_count(Some(GROUP_ROWS))
        .build();
    let mut writer = ArrowWriter::try_new(Vec::new(), batch.schema(), Some(properties))?;
    writer.write(batch)?;
    let content = writer.into_inner()?;
    let name = format!("{version:012}-{}.parquet", blake3::hash(&content).to_hex());
    // An interrupted attempt may have left the same content under the same name.
    location.create(&location.dir().join(&name), &content)?;
    Ok(Add {
        path: name,
        size: content.len() as i64,
        modification_time: Timestamp::now().as_millisecond(),
        data_change,
        stats: Some(file_stats::of(batch)),
        ..Add::default()
    })
}

/// The digest in a file's name; `None` for a file that another program wrote.
pub(crate) fn digest_of_name(name: &str) -> Option<&str> {
    let (_, digest) = name.strip_suffix(".parquet")?.rsplit_once('-')?;
    let hexadecimal = digest.len() == DIGEST_DIGITS && digest.bytes().all(|b| b.is_ascii_hexdigit());
    hexadecimal.then_some(digest)
}

pub(crate) fn check(path: &Path) -> Result<(), Error> {
    let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    let Some(wanted) = digest_of_name(name) else { return Ok(()) };
    let mut hasher = blake3::Hasher::new();
    let file = std::fs::File::open(path).map_err(Error::io(path, "opened"))?;
    hasher.update_reader(file).map_err(Error::io(path, "read"))?;
    let found = hasher.finalize().to_hex();
    if found.as_str() == wanted {
        return Ok(());
    }
    Err(Error::Damaged { path: path.to_owned(), found: found.to_string(), wanted: wanted.to_owned() })
}
