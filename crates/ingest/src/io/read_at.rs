//! Reading at a position: workers that share a file share no cursor.
//!
//! A `File` has one cursor: two actuators of one log, read at a time by it, would get each other's bytes.

use std::fs::File;
use std::io;

use crate::io::transient;

/// Length of a file, bytes; a transient error is retried.
pub(crate) fn file_length(file: &File) -> io::Result<u64> {
    Ok(transient::with_retry(|| file.metadata())?.len())
}

/// Fills the buffer from some byte on; a transient error is retried.
pub(crate) fn read_exact(file: &File, mut buffer: &mut [u8], mut at: u64) -> io::Result<()> {
    while !buffer.is_empty() {
        let count = transient::with_retry(|| read_at(file, buffer, at))?;
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
