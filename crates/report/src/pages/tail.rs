//! Tail page: verdict of one aircraft, its actuators, its sensors and its data.

use askama::Template;
use records::assessment::action::counts_text;
use records::report_rows::{ReportLogErrorRow, ReportTailRow};

use crate::format::{minute, minute_or, unbroken};
use crate::model::{Head, Report, UnitView};
use crate::page::{Error, Page, tail_path};
use crate::pages::fleet::logged;
use crate::pages::quantities::{self, Change};
use crate::pages::work_list::Group;
use crate::peers::Peers;

#[derive(Template)]
#[template(path = "tail.html")]
struct View<'a> {
    head: Head,
    tail: &'a ReportTailRow,
    verdict: String,
    warnings: Vec<&'a str>,
    peers: &'a Peers<'a>,
    groups: Vec<Group<'a>>,
    removed: Vec<&'a UnitView>,
    quantity_changes: Vec<Change<'a>>,
    log_errors: Vec<&'a ReportLogErrorRow>,
}

/// Renders the page of a tail.
///
/// # Errors
/// When the template cannot be filled.
pub fn tail_page(report: &Report, peers: &Peers<'_>, tail: &ReportTailRow) -> Result<Page, Error> {
    let name = tail.tail_number.as_str();
    let of_tail = report.units.iter().filter(|u| u.row.tail_number.as_deref() == Some(name));
    let (removed, units): (Vec<&UnitView>, Vec<&UnitView>) =
        of_tail.partition(|unit| unit.row.removed_utc.is_some());
    let view = View {
        head: report.head("../", format!("{name} · actuator free play")),
        tail,
        verdict: counts_text(units.iter().map(|unit| &unit.row)),
        warnings: report.warnings(Some(name)),
        peers,
        groups: if units.is_empty() { Vec::new() } else { vec![Group::new("", units)] },
        removed,
        quantity_changes: quantities::changes(report, "../", |change| {
            change.tail_number.as_deref() == Some(name)
        }),
        log_errors: report.log_errors.iter().filter(|f| f.tail_number.as_deref() == Some(name)).collect(),
    };
    Ok(Page::html(tail_path(name), &view.render()?))
}
