//! Files shared by all pages: style sheet, chart library (uPlot, MIT) and the scripts of charts and tables.

use crate::page::Page;

/// The shared files of a report.
pub fn assets() -> Vec<Page> {
    let files: [(&str, &[u8]); 6] = [
        ("assets/report.css", include_bytes!("../assets/report.css")),
        ("assets/report.js", include_bytes!("../assets/report.js")),
        ("assets/tables.js", include_bytes!("../assets/tables.js")),
        ("assets/uplot.js", include_bytes!("../assets/uplot.js")),
        ("assets/uplot.css", include_bytes!("../assets/uplot.css")),
        ("assets/uplot-LICENSE.txt", include_bytes!("../assets/uplot-LICENSE.txt")),
    ];
    files.map(|(path, body)| Page { path: path.to_owned(), body: body.to_vec() }).into()
}
