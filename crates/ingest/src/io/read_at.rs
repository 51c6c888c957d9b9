//! Reading at a position: workers that share a file share no cursor.
//!
//! Copies of a `File` have one cursor between them, and Parquet's own reader of files moves it: two actuators
//! of one log, read at a time, would get each other's bytes.

use std::fs::File;
use std::io::{self, BufReader, Read};

use bytes::Bytes;
use parquet::errors::Result;
use parquet::file::reader::{ChunkReader, Length};

use crate::io::transient;

/// A file for Parquet's readers.
#[derive(Debug)]
pub(crate) struct PreadFile {
    file: File,
    /// Length when it was opened, bytes: [`Length`] cannot report an error.
    length: u64,
}

impl PreadFile {
    /// A handle of its own on a file.
    ///
    /// # Errors
    /// When the system gives no handle or no length.
    pub(crate) fn new(file: &File) -> io::Result<Self> {
        Ok(Self { file: transient::with_retry(|| file.try_clone())?, length: file_length(file)? })
    }

    pub(crate) fn file(&self) -> &File {
        &self.file
    }
}

/// A stretch of a file from some byte on.
#[derive(Debug)]
pub(crate) struct PreadCursor {
    file: File,
    at: u64,
}

impl Read for PreadCursor {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = read_at(&self.file, buffer, self.at)?;
        self.at += count as u64;
        Ok(count)
    }
}

impl Length for PreadFile {
    fn len(&self) -> u64 {
        self.length
    }
}

impl ChunkReader for PreadFile {
    type T = BufReader<PreadCursor>;

    fn get_read(&self, start: u64) -> Result<Self::T> {
        Ok(BufReader::new(PreadCursor { file: self.file.try_clone()?, at: start }))
    }

    fn get_bytes(&self, start: u64, length: usize) -> Result<Bytes> {
        let mut buffer = vec![0; length];
        read_exact(&self.file, &mut buffer, start)?;
        Ok(buffer.into())
    }
}

/// Length of a file, bytes; a transient error is retried.
pub(crate) fn file_length(file: &File) -> io::Result<u64> {
    Ok(transient::with_retry(|| file.metadata())?.len())
}

/// Fills the buffer from some byte on.
///
/// # Errors
/// When the file ends before, or cannot be read.
pub(crate) fn read_exact(file: &File, mut buffer: &mut [u8], mut at: u64) -> io::Result<()> {
    while !buffer.is_empty() {
        match read_at(file, buffer, at) {
            Ok(0) => return Err(io::ErrorKind::UnexpectedEof.into()),
            Ok(count) => {
                buffer = &mut buffer[count..];
                at += count as u64;
            }
            Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
            Err(e) => return Err(e),
        }
    }
    Ok(())
}

/// Reads some bytes; a transient error is retried.
pub(crate) fn read_at(file: &File, buffer: &mut [u8], at: u64) -> io::Result<usize> {
    transient::with_retry(|| read_once(file, buffer, at))
}

#[cfg(unix)]
fn read_once(file: &File, buffer: &mut [u8], at: u64) -> io::Result<usize> {
    std::os::unix::fs::FileExt::read_at(file, buffer, at)
}

#[cfg(windows)]
fn read_once(file: &File, buffer: &mut [u8], at: u64) -> io::Result<usize> {
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
        let file = PreadFile::new(&file).unwrap();
        std::thread::scope(|scope| {
            for reader in 0..8_usize {
                let (file, content) = (&file, &content);
                scope.spawn(move || {
                    for step in 0..500_usize {
                        let start = (reader * 7_919 + step * 104_729) % 99_000;
                        let bytes = file.get_bytes(start as u64, 900).unwrap();
                        assert_eq!(bytes.as_ref(), &content[start..start + 900]);
                        let mut some = [0; 90];
                        file.get_read(start as u64).unwrap().read_exact(&mut some).unwrap();
                        assert_eq!(some, content[start..start + 90]);
                    }
                });
            }
        });
    }

    #[test]
    fn a_file_that_ends_early_is_an_error() {
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(b"short").unwrap();
        let ended = read_exact(&file, &mut [0; 4], 3).unwrap_err();
        assert_eq!(ended.kind(), io::ErrorKind::UnexpectedEof);
    }
}
