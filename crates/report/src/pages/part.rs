//! Part pages: all units of a part number as small multiples on shared axes.

use askama::Template;
use jiff::Timestamp;

use crate::charts::frame::{day, thinned};
use crate::charts::quantities::sparkline;
use crate::format::{date, micrometres};
use crate::model::{Head, Report, UnitView};
use crate::page::{Error, Page, part_path, unit_path};
use crate::pages::work_list::what;
use crate::peers::Peers;

/// Maximum number of units on one page.
const UNITS: usize = 200;
/// Most points of a picture: neighbouring flights are averaged.
const MAX_POINTS: usize = 60;

#[derive(Template)]
#[template(path = "part.html")]
struct View<'a> {
    head: Head,
    part: &'a str,
    axes: Axes,
    units: &'a [&'a UnitView],
    peers: &'a Peers<'a>,
    /// Paths of the pages of the part, relative to this one; none if the part has one page.
    pages: Vec<String>,
}

/// First and last departure and the largest gap or limit of the units of a part, m.
#[derive(Debug, Clone, Copy)]
struct Axes {
    span: Option<(Timestamp, Timestamp)>,
    full_m: f64,
}

impl Axes {
    fn of(units: &[&UnitView]) -> Self {
        let flights = || units.iter().flat_map(|unit| &unit.flights).filter(|flight| flight.gap_m.is_some());
        let times = || flights().map(|flight| flight.departure_utc);
        let limits_m = units.iter().filter_map(|unit| unit.row.limit_m);
        let full_m =
            flights().filter_map(|flight| flight.gap_m).chain(limits_m).fold(f64::MIN_POSITIVE, f64::max);
        Self { span: times().min().zip(times().max()), full_m }
    }

    fn draw(self, unit: &UnitView) -> String {
        let Some((from, to)) = self.span else { return String::new() };
        let x = [day(from), day(to).max(day(from) + 1.0)];
        let limit = unit.row.limit_m.map(|limit_m| limit_m * 1e6);
        sparkline([200.0, 64.0], x, 1.08e6 * self.full_m, &thinned(&unit.gaps(), MAX_POINTS), limit)
    }
}

/// Renders the pages of all part numbers: the most urgent units first.
///
/// # Errors
/// When the template cannot be filled.
pub fn part_pages(report: &Report, peers: &Peers<'_>) -> Result<Vec<Page>, Error> {
    let mut pages = Vec::new();
    for (part, mut units) in report.by_part() {
        units.sort_by(|a, b| a.row.by_urgency(&b.row));
        let axes = Axes::of(&units);
        let paths: Vec<String> = (0..units.len().div_ceil(UNITS)).map(|k| part_path(part, k)).collect();
        for (units, path) in units.chunks(UNITS).zip(&paths) {
            let view = View {
                head: report.head("../", format!("{part} · actuator free play")),
                part,
                axes,
                units,
                peers,
                pages: if paths.len() > 1 { paths.clone() } else { Vec::new() },
            };
            pages.push(Page::html(path.clone(), &view.render()?));
        }
    }
    Ok(pages)
}
