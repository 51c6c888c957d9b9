//! Tail page: actuators of one aircraft, its flights and failed logs.

use askama::Template;

use crate::format::{NO_DATA, count, minute, minute_or};
use crate::model::{LogError, Report, Tail, UnitView};
use crate::page::{Error, Page, tail_path};
use crate::pages::fleet::Group;
use crate::pages::quantities::{self, Change, Chart};

#[derive(Template)]
#[template(path = "tail.html")]
struct View<'a> {
    root: &'static str,
    title: String,
    footer: String,
    tail: &'a str,
    facts: Vec<(&'static str, String)>,
    label: &'static str,
    groups: Vec<Group<'a>>,
    quantity_changes: Vec<Change>,
    charts: Vec<Chart>,
    log_errors: Vec<&'a LogError>,
}

/// Renders the page of a tail.
///
/// # Errors
/// When the template cannot be filled.
pub fn tail_page(report: &Report, tail: &Tail) -> Result<Page, Error> {
    let name = tail.tail_number.as_str();
    let mut units: Vec<&UnitView> =
        report.units.iter().filter(|u| u.tail_number.as_deref() == Some(name)).collect();
    units.sort_by_key(|unit| (unit.position.clone().unwrap_or_else(|| NO_DATA.to_owned()), unit.name()));
    let log_errors = report.log_errors.iter().filter(|f| f.tail_number.as_deref() == Some(name));
    let view = View {
        root: "../",
        title: format!("{name} · actuator free play"),
        footer: report.footer(),
        tail: name,
        facts: vec![
            ("Flights", count(tail.flights)),
            ("Records", format!("{}, {} rejected", count(tail.records), count(tail.refused))),
            ("Failed logs", count(tail.logs_in_error)),
            ("Last flight", minute_or(tail.last_departure_utc)),
            ("Last estimate", minute_or(tail.last_estimate_utc)),
        ],
        label: "Actuators of this tail",
        groups: if units.is_empty() { Vec::new() } else { vec![Group { tail: "", units }] },
        quantity_changes: quantities::changes(report, "../", |change| {
            change.tail_number.as_deref() == Some(name)
        }),
        charts: quantities::tail_charts(report, name)?,
        log_errors: log_errors.collect(),
    };
    Ok(Page::html(tail_path(name), &view.render()?))
}
