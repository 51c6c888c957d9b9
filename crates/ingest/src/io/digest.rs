//! blake3 of stretches of files.

use std::fs::File;
use std::io;
use std::ops::Range;

use crate::io::read_at;

/// Bytes that are read and hashed at a time: as many as stay in the cache in between.
const BUFFER_BYTES: usize = 1 << 17;

/// A digest that stretches are added to, one after the other as if they were one.
#[derive(Debug)]
pub(crate) struct Digest {
    hash: blake3::Hasher,
    buffer: Vec<u8>,
}

impl Digest {
    pub(crate) fn new() -> Self {
        Self { hash: blake3::Hasher::new(), buffer: vec![0; BUFFER_BYTES] }
    }

    /// Adds a stretch of a file; an empty one adds nothing.
    pub(crate) fn take(&mut self, file: &File, stretch: Range<u64>) -> io::Result<()> {
        for at in stretch.clone().step_by(BUFFER_BYTES) {
            let bytes = &mut self.buffer[..BUFFER_BYTES.min((stretch.end - at) as usize)];
            read_at::read_exact(file, bytes, at)?;
            self.hash.update(bytes);
        }
        Ok(())
    }

    /// Adds a text and its length.
    pub(crate) fn take_text(&mut self, text: &str) {
        self.hash.update(&text.len().to_le_bytes());
        self.hash.update(text.as_bytes());
    }

    /// In hexadecimal.
    pub(crate) fn end(self) -> String {
        self.hash.finalize().to_hex().to_string()
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;

    /// However the stretches lie, their digest is that of their bytes in a row.
    #[test]
    fn stretches_are_one_stream() {
        let bytes: Vec<u8> = (0..5 * BUFFER_BYTES as u64).map(|k| (k * k % 251) as u8).collect();
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(&bytes).unwrap();
        let ends = [0, 1, 1, 3000, 140_000, 2 * BUFFER_BYTES + 140_000, 5 * BUFFER_BYTES];
        let (mut digest, mut all) = (Digest::new(), Vec::new());
        for pair in ends.windows(2).rev() {
            digest.take(&file, pair[0] as u64..pair[1] as u64).unwrap();
            all.extend_from_slice(&bytes[pair[0]..pair[1]]);
        }
        assert_eq!(digest.end(), blake3::hash(&all).to_hex().to_string());
        let beyond = bytes.len() as u64;
        assert!(Digest::new().take(&file, beyond - 1..beyond + 1).is_err());
    }
}
