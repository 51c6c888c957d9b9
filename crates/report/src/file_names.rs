//! Safe, unique file names from tail, part and serial numbers.

/// Maximum length of the readable part of a file name, bytes.
const READABLE: usize = 60;

/// File stem for a kind of page and the names it describes.
///
/// Capital letters, digits and `-` are kept. If any other character occurs, a digest of all names is appended,
/// so that two names never share a file, even on a case-insensitive file system.
pub(crate) fn file_stem(kind: &str, names: &[&str]) -> String {
    let plain = |c: char| c.is_ascii_uppercase() || c.is_ascii_digit() || c == '-';
    let whole = names.join("_");
    let clean = names.iter().all(|name| name.chars().all(plain)) && whole.len() <= READABLE;
    if clean {
        return format!("{kind}-{whole}");
    }
    let shown: String = whole
        .chars()
        .map(|c| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' })
        .take(READABLE)
        .collect();
    // A separator between names, so that `a`, `bc` differs from `ab`, `c`.
    let bytes: Vec<u8> = names.iter().flat_map(|name| name.bytes().chain([0xff])).collect();
    format!("{kind}-{shown}.{:.32}", blake3::hash(&bytes).to_hex())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_plain_name_stays_readable() {
        assert_eq!(file_stem("unit", &["EMA-27-1040", "00317"]), "unit-EMA-27-1040_00317");
    }

    proptest! {
        #[test]
        fn different_names_have_different_files_even_without_capitals(a in ".{0,80}", b in ".{0,80}") {
            prop_assume!(a != b);
            prop_assert_ne!(file_stem("tail", &[&a]).to_lowercase(), file_stem("tail", &[&b]).to_lowercase());
        }

        #[test]
        fn a_file_name_is_plain_ascii_and_short_and_cannot_leave_its_folder(a in "(\\.\\./|.){0,300}") {
            let name = file_stem("unit", &["P", &a]);
            prop_assert!(name.len() < 100 && !name.contains(".."));
            prop_assert!(name.chars().all(|c| c.is_ascii_alphanumeric() || "-_.".contains(c)), "{}", name);
        }
    }
}
