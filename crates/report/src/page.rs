//! One file of a report: its path, its content, and the errors of writing it.

use jiff::Timestamp;
use records::sanitize::escape_invisible;

use crate::file_names::file_stem;
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
