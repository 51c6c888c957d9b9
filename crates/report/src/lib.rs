//! Statements and flights as pages people read: a fleet page, a page per tail, a page per serial.
//!
//! A [`Report`] goes in, [`Page`]s come out; nothing is read, written or computed from flights here. Every
//! number stands in the page as text; scripts add hover and zoom. Templates escape every foreign string.

mod agreement;
mod assets;
mod chart;
mod crossing;
mod fleet;
mod look;
mod model;
mod names;
mod rates;
mod removals;
mod scatter;
mod serial;
mod standing;
mod tail;
mod words;

pub use agreement::Agreement;
pub use assets::assets;
pub use fleet::fleet_pages;
pub use look::{Look, Stretch, look_html, look_png, look_svg};
pub use model::{
    Banded, Event, FlightRow, Inspection, LogFault, Past, Prior, Quality, Report, Statement, Stay, Tail, Unit,
};
pub use rates::Spreads;
pub use serial::serial_page;
pub use standing::Standing;
pub use tail::tail_page;

/// One file of a report.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Page {
    /// Where it goes, below the folder of the report.
    pub path: String,
    /// What it holds.
    pub body: Vec<u8>,
}

impl Page {
    /// A page for people: characters that no reader sees are named, so that no text can pose as another.
    fn html(path: String, html: &str) -> Self {
        Self { path, body: words::visible(html).into_bytes() }
    }
}

/// Why a page could not be made.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A template could not be filled.
    #[error("a page cannot be written: {0}")]
    Template(#[from] askama::Error),
    /// The twin could not be written.
    #[error("the machine-readable twin cannot be written: {0}")]
    Twin(#[from] serde_json::Error),
    /// A picture could not be drawn.
    #[error("a picture cannot be drawn: {0}")]
    Picture(String),
}

/// The page of a unit, below the folder of the report.
pub fn serial_path(unit: &Unit) -> String {
    let part = unit.part_number.as_deref().unwrap_or("");
    format!("serial/{}.html", names::stem("unit", &[part, &unit.serial_number]))
}

/// The page of a tail, below the folder of the report.
pub fn tail_path(tail_number: &str) -> String {
    format!("tail/{}.html", names::stem("tail", &[tail_number]))
}
