//! blake3 of stretches of files.

use std::fs::File;
use std::io;
use std::ops::Range;

use blake3::Hasher;

use crate::io::read_at;

/// Bytes that are read and hashed at a time: as many as stay in the cache in between.
const BUFFER_BYTES: usize = 1 << 17;

/// Adds stretches of a file to a digest, one after the other as if they were one; an empty one adds nothing.
pub(crate) fn add_stretches(
    hash: &mut Hasher,
    file: &File,
    stretches: impl IntoIterator<Item = Range<u64>>,
) -> io::Result<()> {
    let mut buffer = vec![0; BUFFER_BYTES];
    for stretch in stretches {
        for at in stretch.clone().step_by(BUFFER_BYTES) {
            let bytes = &mut buffer[..BUFFER_BYTES.min((stretch.end - at) as usize)];
            read_at::read_exact(file, bytes, at)?;
            hash.update(bytes);
        }
    }
    Ok(())
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
        let stretches = || ends.windows(2).rev().map(|pair| pair[0]..pair[1]);
        let all: Vec<u8> = stretches().flat_map(|stretch| &bytes[stretch]).copied().collect();
        let mut hash = Hasher::new();
        add_stretches(&mut hash, &file, stretches().map(|s| s.start as u64..s.end as u64)).unwrap();
        assert_eq!(hash.finalize(), blake3::hash(&all));
        let beyond = bytes.len() as u64;
        assert!(add_stretches(&mut hash, &file, std::iter::once(beyond - 1..beyond + 1)).is_err());
    }
}
