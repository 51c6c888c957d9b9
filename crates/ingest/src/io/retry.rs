//! Local files: positional reads, and a repetition where an error may pass by itself.
//!
//! A disk or a network share may fail a read once and serve the next. Reads name their position, since a `File` has one
//! cursor: two actuators of one log, read at a time by it, would get each other's bytes.

use std::fs::File;
use std::io;
use std::time::Duration;

/// Waits between attempts; a log that still fails is read again as a whole by the run.
const DELAYS: [Duration; 3] =
    [Duration::from_millis(10), Duration::from_millis(40), Duration::from_millis(160)];

/// `EIO`, which [`io::ErrorKind`] does not know, and `EREMOTEIO` of Linux.
const INPUT_OUTPUT_ERRORS: [i32; 2] = [5, 121];
/// `ENFILE` and `EMFILE`: the system, or the process, has as many files open as it may.
const TOO_MANY_OPEN_FILES: [i32; 2] = [23, 24];

/// Whether the same operation may succeed later although nothing is changed here.
pub(crate) fn is_transient(error: &io::Error) -> bool {
    use io::ErrorKind as Kind;
    let by_kind = matches!(
        error.kind(),
        Kind::Interrupted
            | Kind::WouldBlock
            | Kind::TimedOut
            | Kind::StaleNetworkFileHandle
            | Kind::ResourceBusy
            | Kind::NetworkDown
            | Kind::NetworkUnreachable
            | Kind::HostUnreachable
            | Kind::ConnectionReset
            | Kind::ConnectionAborted
            | Kind::NotConnected
            | Kind::OutOfMemory
    );
    by_kind || is_one_of(error, INPUT_OUTPUT_ERRORS) || is_file_limit(error)
}

pub(crate) fn is_file_limit(error: &io::Error) -> bool {
    is_one_of(error, TOO_MANY_OPEN_FILES)
}

fn is_one_of(error: &io::Error, numbers: [i32; 2]) -> bool {
    cfg!(unix) && error.raw_os_error().is_some_and(|number| numbers.contains(&number))
}

pub(crate) fn with_retry<T>(mut operation: impl FnMut() -> io::Result<T>) -> io::Result<T> {
    for delay in DELAYS {
        match operation() {
            Err(error) if is_transient(&error) => std::thread::sleep(delay),
            result => return result,
        }
    }
    operation()
}

/// Length of a file, bytes; a transient error is retried.
pub(crate) fn file_length(file: &File) -> io::Result<u64> {
    Ok(with_retry(|| file.metadata())?.len())
}

/// Fills the buffer from some byte on; a transient error is retried.
pub(crate) fn read_exact(file: &File, mut buffer: &mut [u8], mut at: u64) -> io::Result<()> {
    while !buffer.is_empty() {
        let count = with_retry(|| read_at(file, buffer, at))?;
        if count == 0 {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        buffer = &mut buffer[count..];
        at += count as u64;
    }
    Ok(())
}

#[cfg(unix)]
fn read_at(file: &File, buffer: &mut [u8], at: u64) -> io::Result<usize> {
    std::os::unix::fs::FileExt::read_at(file, buffer, at)
}

#[cfg(windows)]
fn read_at(file: &File, buffer: &mut [u8], at: u64) -> io::Result<usize> {
    std::os::windows::fs::FileExt::seek_read(file, buffer, at)
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;

    /// Numbers of Linux, `errno(3)`.
    #[cfg(target_os = "linux")]
    #[test]
    fn errors_of_a_share_that_comes_back_are_transient_and_missing_files_are_not() {
        // EINTR, EIO, EAGAIN, ENOMEM, EBUSY, ENFILE, EMFILE, ETIMEDOUT, ESTALE.
        for number in [4, 5, 11, 12, 16, 23, 24, 110, 116] {
            assert!(is_transient(&io::Error::from_raw_os_error(number)), "{number}");
        }
        // ENOENT, EACCES, EISDIR, ENOSPC.
        for number in [2, 13, 21, 28] {
            assert!(!is_transient(&io::Error::from_raw_os_error(number)), "{number}");
        }
    }

    #[test]
    fn one_failure_is_not_seen() {
        let mut tries = 0;
        let once = with_retry(|| {
            tries += 1;
            if tries == 1 { Err(io::Error::from_raw_os_error(INPUT_OUTPUT_ERRORS[0])) } else { Ok(tries) }
        });
        assert_eq!(once.unwrap(), 2);
    }

    /// Each byte encodes its offset; eight readers read one file at random offsets.
    #[test]
    fn readers_of_one_file_do_not_move_each_other() {
        let mut file = tempfile::tempfile().unwrap();
        let content: Vec<u8> = (0..251_u8).cycle().take(100_000).collect();
        file.write_all(&content).unwrap();
        std::thread::scope(|scope| {
            for reader in 0..8_usize {
                let (file, content) = (&file, &content);
                scope.spawn(move || {
                    for step in 0..500_usize {
                        let start = (reader * 7_919 + step * 104_729) % 99_000;
                        let mut bytes = [0; 900];
                        read_exact(file, &mut bytes, start as u64).unwrap();
                        assert_eq!(bytes, content[start..start + 900]);
                    }
                });
            }
        });
    }
}
