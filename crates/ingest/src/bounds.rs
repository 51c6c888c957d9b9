//! Bounds of logs and tables, checked before memory is taken: an allocation that fails ends the process, and no error
//! can be caught then.
//!
//! A file of a kilobyte may claim 2³¹ row groups, values or bytes. Each claim is compared with what the file can hold
//! and with what any recorder writes. `docs/limits.md` lists the bounds; a configured one names its key.

use std::sync::atomic::{AtomicU64, Ordering};

use crate::error::Fault;

/// Bytes of a footer: 1 KiB for each of 262,144 column chunks.
pub(crate) const FOOTER_BYTES: u64 = 256 << 20;
/// Groups inside groups of a schema: readers call themselves for each.
pub(crate) const SCHEMA_DEPTH: usize = 64;
/// Columns of all row groups together: each takes about 700 bytes of memory.
pub(crate) const COLUMN_CHUNKS: u64 = 1 << 20;
/// Columns of a CSV table: those of a spreadsheet.
pub(crate) const TABLE_COLUMNS: usize = 16_384;
/// Bytes of a page. Writers make pages of about 1 MiB; a row group without cuts some tens.
pub(crate) const PAGE_BYTES: i64 = 256 << 20;
/// Bytes that the texts of one batch may take when each is the longest of its dictionary.
pub(crate) const BATCH_TEXT_BYTES: usize = 128 << 20;
/// Bytes of text that a page may hold for each byte stored, beyond [`FREE_TEXT_BYTES`].
const TEXT_RATIO: i64 = 1000;
const FREE_TEXT_BYTES: i64 = 16 << 20;
/// Rows of a log or a table where `run.max_rows` is not set: 55 h at 1 kHz.
pub const DEFAULT_MAX_ROWS: u64 = 200_000_000;
/// Rows that a file may hold for each of its bytes, beyond [`FREE_ROWS`]. A clock of even steps takes a byte for 20
/// rows, constant channels a byte for some hundreds.
const ROWS_PER_BYTE: u64 = 1000;
const FREE_ROWS: u64 = 1 << 20;

static MAX_ROWS: AtomicU64 = AtomicU64::new(DEFAULT_MAX_ROWS);

/// Sets the most rows of a log or a table, `run.max_rows`, for the process.
pub fn set_max_rows(rows: u64) {
    MAX_ROWS.store(rows, Ordering::Relaxed);
}

fn beyond_limit(what: &str, found: u64, most: u64, hint: &str) -> Fault {
    let message = format!("the file claims {found} {what}, more than the limit of {most}");
    Fault::new("beyond_limit", message, hint)
}

pub(crate) fn check(what: &str, found: u64, most: u64) -> Result<(), Fault> {
    let hint = "the file is damaged or made to exhaust memory: fetch it again, or exclude it in `logs.files` (docs/limits.md)";
    if found <= most { Ok(()) } else { Err(beyond_limit(what, found, most, hint)) }
}

/// Compares rows, or values of a column, with the configured most and with the bytes of their file.
pub(crate) fn check_rows(what: &str, found: u64, file_bytes: u64) -> Result<(), Fault> {
    let configured = MAX_ROWS.load(Ordering::Relaxed);
    if found > configured {
        let hint = "if the file is sound, raise `run.max_rows`; docs/limits.md lists all limits";
        return Err(beyond_limit(what, found, configured, hint));
    }
    check(what, found, file_bytes.saturating_mul(ROWS_PER_BYTE).saturating_add(FREE_ROWS))
}

/// Largest size of an unpacked page of texts, from its size in the file.
pub(crate) fn text_page_bytes(stored: i64) -> i64 {
    stored.saturating_mul(TEXT_RATIO).clamp(FREE_TEXT_BYTES, PAGE_BYTES)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_bounded_by_the_setting_and_by_the_bytes_of_the_file() {
        check_rows("rows", 1 << 20, 100).unwrap();
        check_rows("rows", 20_000_000, 100_000).unwrap();
        let small = check_rows("rows", 20_000_000, 2_400).unwrap_err().0;
        assert!(small.message.ends_with("limit of 3448576"), "{small}");
        let large = check_rows("rows", 1_000_000_000, 1 << 40).unwrap_err().0;
        assert!(large.message.ends_with("limit of 200000000"), "{large}");
        assert!(
            large.hint.unwrap().contains("run.max_rows") && !small.hint.unwrap().contains("run.max_rows")
        );
    }
}
