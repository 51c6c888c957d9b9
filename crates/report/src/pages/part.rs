//! Part pages: all units of a part number as small multiples on shared axes.

use askama::Template;

use crate::charts::small_multiple::SharedAxes;
use crate::format::{counted, date_or, micrometres};
use crate::model::{Report, UnitView};
use crate::page::{Error, Page, part_path, unit_path};

/// Maximum number of units on one page.
const UNITS: usize = 200;

#[derive(Template)]
#[template(path = "part.html")]
struct View<'a> {
    root: &'static str,
    title: String,
    footer: String,
    part: &'a str,
    /// Axes of all pictures, and what they show.
    axes: Option<SharedAxes>,
    description: String,
    units: &'a [&'a UnitView],
    /// Paths of all pages of the part, relative to this one.
    pages: Vec<String>,
}

/// Renders the pages of all part numbers: the most urgent units first, then by share of the limit.
///
/// # Errors
/// When the template cannot be filled.
pub fn part_pages(report: &Report) -> Result<Vec<Page>, Error> {
    let mut pages = Vec::new();
    for (part, mut units) in report.by_part() {
        let order = |unit: &UnitView| (unit.badge().rank(), -unit.share().unwrap_or(0.0));
        units.sort_by(|a, b| order(a).partial_cmp(&order(b)).unwrap_or(std::cmp::Ordering::Equal));
        let axes = SharedAxes::of(&units);
        let paths: Vec<String> = (0..units.len().div_ceil(UNITS)).map(|k| part_path(part, k)).collect();
        for (units, path) in units.chunks(UNITS).zip(&paths) {
            let view = View {
                root: "../",
                title: format!("{part} · actuator free play"),
                footer: report.footer(),
                part,
                axes,
                description: axes.map(description).unwrap_or_default(),
                units,
                pages: if paths.len() > 1 { paths.clone() } else { Vec::new() },
            };
            pages.push(Page::html(path.clone(), &view.render()?));
        }
    }
    Ok(pages)
}

fn description(axes: SharedAxes) -> String {
    let (from, to, full_m) = axes.extent();
    format!(
        "Gap from {} to {}, 0 to {} µm, the same axes for all; dashed: act limit.",
        date_or(from),
        date_or(to),
        micrometres(full_m)
    )
}
