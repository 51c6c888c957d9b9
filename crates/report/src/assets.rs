//! Files shared by all pages: style sheet and script; and the licence of uPlot (MIT), which pages of single flights contain.

use crate::page::Page;

/// The shared files of a report.
pub fn assets() -> Vec<Page> {
    let files = [
        ("assets/report.css", include_str!("../assets/report.css")),
        ("assets/report.js", include_str!("../assets/report.js")),
        ("assets/uplot-LICENSE.txt", include_str!("../assets/uplot-LICENSE.txt")),
    ];
    files.map(|(path, body)| Page { path: path.to_owned(), body: body.into() }).into()
}
