//! Tail page: actuators of one aircraft, its flights and failed logs.

use askama::Template;

use crate::format::{count, minute_or};
use crate::model::{Report, Tail};
use crate::page::{Error, Page, tail_path};
use crate::pages::fleet::Row;
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
    groups: Vec<(String, String, Vec<Row>)>,
    quantity_changes: Vec<Change>,
    charts: Vec<Chart>,
    log_errors: Vec<(String, String, String)>,
}

/// Renders the page of a tail.
///
/// # Errors
/// When the template cannot be filled.
pub fn tail_page(report: &Report, tail: &Tail) -> Result<Page, Error> {
    let name = tail.tail_number.as_str();
    let mine = report.units.iter().filter(|u| u.tail_number.as_deref() == Some(name));
    let mut rows: Vec<Row> = mine.map(|u| Row::of(u, "../")).collect();
    rows.sort_by(|a, b| a.position.cmp(&b.position).then_with(|| a.name.cmp(&b.name)));
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
        groups: if rows.is_empty() { Vec::new() } else { vec![(String::new(), String::new(), rows)] },
        quantity_changes: quantities::changes(report, "../", |change| {
            change.tail_number.as_deref() == Some(name)
        }),
        charts: quantities::tail_charts(report, name)?,
        log_errors: log_errors
            .map(|f| (f.log_path.clone(), f.code.clone(), crate::format::minute(f.processed_utc)))
            .collect(),
    };
    Ok(Page::html(tail_path(name), &view.render()?))
}
