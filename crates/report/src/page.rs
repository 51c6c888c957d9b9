//! One file of a report: its path, its content, and the errors of writing it.

use jiff::Timestamp;
use records::sanitize::escape_invisible;

use crate::model::UnitView;

/// One file of a report.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Page {
    /// Path relative to the report folder.
    pub path: String,
    /// Content of the file.
    pub body: Vec<u8>,
}

impl Page {
    /// Makes an HTML page; invisible characters are escaped so that no name can disguise itself as another.
    pub fn html(path: String, html: &str) -> Self {
        Self { path, body: escape_invisible(html).into_owned().into_bytes() }
    }
}

/// The files shared by all pages: style sheet and script; and the licence of uPlot (MIT), which pages of single flights contain.
pub fn assets() -> Vec<Page> {
    let files = [
        ("assets/report.css", include_str!("../assets/report.css")),
        ("assets/report.js", include_str!("../assets/report.js")),
        ("assets/uplot-LICENSE.txt", include_str!("../assets/uplot-LICENSE.txt")),
    ];
    files.map(|(path, body)| Page { path: path.to_owned(), body: body.into() }).into()
}

/// Why a page could not be made.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A template could not be rendered.
    #[error("a page cannot be written: {0}")]
    Template(#[from] askama::Error),
}

/// Path of a unit's page, relative to the report folder.
pub fn unit_path(unit: &UnitView) -> String {
    let part = unit.row.part_number.as_deref().unwrap_or("");
    format!("serial/{}.html", file_stem("unit", &[part, &unit.row.serial_number]))
}

/// Path of the page with the diagnostic plot of an actuator in a flight, relative to the report folder.
pub fn flight_path(tail_number: &str, departure_utc: Timestamp, position: &str) -> String {
    let departure = departure_utc.strftime("%Y%m%dT%H%M%S%fZ").to_string();
    format!("flight/{}.html", file_stem("flight", &[tail_number, &departure, position]))
}

/// Path of a page of a part number, relative to the report folder; a part with many units has several.
pub(crate) fn part_path(part_number: &str, page: usize) -> String {
    let stem = file_stem("part", &[part_number]);
    if page == 0 { format!("part/{stem}.html") } else { format!("part/{stem}.page-{}.html", page + 1) }
}

pub(crate) fn tail_path(tail_number: &str) -> String {
    format!("tail/{}.html", file_stem("tail", &[tail_number]))
}

/// Maximum length of the readable part of a file name, bytes.
const READABLE: usize = 60;

/// File stem for a kind of page and the names it describes.
///
/// Capital letters, digits and `-` are kept. If any other character occurs, a digest of all names is appended,
/// so that two names never share a file, even on a case-insensitive file system.
fn file_stem(kind: &str, names: &[&str]) -> String {
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
