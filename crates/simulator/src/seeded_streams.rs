//! Streams of random numbers that depend on a seed and on names, never on the order of asking.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// The stream that belongs to a seed and a path of names, for example tail, flight, position.
pub(crate) fn seeded_rng(seed: u64, names: &[&str]) -> ChaCha8Rng {
    let mut key = [0; 32];
    key[..8].copy_from_slice(&seed.to_le_bytes());
    key[8..16].copy_from_slice(&digest(names).to_le_bytes());
    ChaCha8Rng::from_seed(key)
}

pub(crate) fn derive_seed(seed: u64, names: &[&str]) -> u64 {
    use rand::RngCore;
    seeded_rng(seed, names).next_u64()
}

/// FNV-1a in 64 bits; each name is closed by a byte that UTF-8 never uses, so `ab, c` is not `a, bc`.
fn digest(names: &[&str]) -> u64 {
    let bytes = names.iter().flat_map(|name| name.bytes().chain([0xff]));
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_cut_differently_give_different_streams() {
        assert_ne!(derive_seed(1, &["ab", "c"]), derive_seed(1, &["a", "bc"]));
        assert_ne!(derive_seed(1, &["ab", "c"]), derive_seed(2, &["ab", "c"]));
    }
}
