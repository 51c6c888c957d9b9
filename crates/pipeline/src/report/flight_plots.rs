//! Diagnostic plots of a report's latest flights, drawn from their logs.

use std::collections::BTreeMap;
use std::sync::Arc;

use ::report::{EstimatePlot, Page, Report, UnitView, estimate_plot_html, flight_path, unit_path};
use jiff::Timestamp;
use job::Config;
use job::flight_log::FlightLog;
use rayon::prelude::*;
use records::report_rows::ReportFlight;
use records::{Diagnostic, Installations};
use store::{Query, Store};

use crate::error::Error;
use crate::inspect::estimate::plot;
use crate::logs::discover;
use crate::run::time_limit::within_time_limit;

/// Most flights of actuators that one report draws: some 40 MB of pages.
pub const MAX_PLOTS: usize = 200;

/// What was drawn.
#[derive(Debug, Default)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub struct FlightPlots {
    pub pages: Vec<Page>,
    pub diagnostics: Vec<Diagnostic>,
    /// Flights that are not drawn because of [`MAX_PLOTS`].
    pub left_out: usize,
}

/// One actuator in one flight: its place in the report.
#[derive(Debug, Clone, Copy)]
struct Wanted {
    unit: usize,
    flight: usize,
}

impl Wanted {
    fn of(self, report: &Report) -> &ReportFlight {
        &report.units[self.unit].flights[self.flight]
    }
}

/// Draws the last `flights_per_unit` flights of each unit that needs action, or of each unit if the report is limited to
/// some, and names the pages in the report's flights. The most urgent units come first where not all can be drawn.
///
/// # Errors
/// When the store cannot be read.
pub fn draw(
    report: &mut Report,
    flights_per_unit: usize,
    config: &Arc<Config>,
    installations: &Arc<Installations>,
    store: &Store,
) -> Result<FlightPlots, Error> {
    let latest = |unit: usize| {
        let flights = 0..report.units[unit].flights.len();
        flights.rev().take(flights_per_unit).map(move |flight| Wanted { unit, flight })
    };
    let mut wanted: Vec<Wanted> = by_urgency(report).into_iter().flat_map(latest).collect();
    let left_out = wanted.len().saturating_sub(MAX_PLOTS);
    wanted.truncate(MAX_PLOTS);
    let mut logs = BTreeMap::<StoredLog, Vec<Wanted>>::new();
    for of_unit in wanted.chunk_by(|a, b| a.unit == b.unit) {
        let log_paths = log_paths(&report.units[of_unit[0].unit], of_unit[of_unit.len() - 1].flight, store)?;
        for wanted in of_unit {
            let row = wanted.of(report);
            let log = log_paths.get(&(row.tail_number.to_string(), row.departure_utc));
            log.into_iter().for_each(|log| logs.entry(log.clone()).or_default().push(*wanted));
        }
    }
    let drawn: Vec<Result<Vec<(Wanted, Page)>, Diagnostic>> = logs
        .into_par_iter()
        .map(|(stored, wanted)| of_log(&stored, &wanted, report, config, installations))
        .collect();
    let mut plots = FlightPlots { left_out, ..FlightPlots::default() };
    for pages in drawn {
        match pages {
            Ok(pages) => {
                for (wanted, page) in pages {
                    report.units[wanted.unit].flights[wanted.flight].plot_path.0 =
                        Some(page.path.as_str().into());
                    plots.pages.push(page);
                }
            }
            Err(diagnostic) => plots.diagnostics.push(diagnostic),
        }
    }
    Ok(plots)
}

fn by_urgency(report: &Report) -> Vec<usize> {
    let units = &report.units;
    let is_wanted = |k: &usize| report.scope.is_some() || units[*k].row.action.is_some();
    let mut chosen: Vec<usize> = (0..units.len()).filter(is_wanted).collect();
    chosen.sort_by(|a, b| units[*a].row.by_urgency(&units[*b].row));
    chosen
}

/// Path of a log, and the digest that it had when its records were stored.
type StoredLog = (String, String);

/// Logs of a unit's flights from the `first` on, by tail and departure.
fn log_paths(
    unit: &UnitView,
    first: usize,
    store: &Store,
) -> Result<BTreeMap<(String, Timestamp), StoredLog>, Error> {
    let query = Query {
        serial_number: Some(unit.row.serial_number.clone()),
        part_number: unit.row.part_number.clone(),
        since_utc: Some(unit.flights[first].departure_utc),
        ..Query::default()
    };
    let key = |record: records::GapRecord| {
        let (flight, source) = (record.flight, record.provenance);
        let key = (flight.tail_number.to_string(), flight.departure_utc);
        (key, (source.log_path, source.log_digest))
    };
    Ok(store.records(&query)?.into_iter().map(key).collect())
}

fn of_log(
    (log, digest): &StoredLog,
    wanted: &[Wanted],
    report: &Report,
    config: &Arc<Config>,
    installations: &Arc<Installations>,
) -> Result<Vec<(Wanted, Page)>, Diagnostic> {
    let (name, digest, config, installations) =
        (log.clone(), digest.clone(), Arc::clone(config), Arc::clone(installations));
    let positions: Vec<Arc<str>> =
        wanted.iter().map(|wanted| Arc::clone(&wanted.of(report).position)).collect();
    let plots = within_time_limit(log, &Arc::clone(&config), move || {
        let files = discover::stored_log(&config, &name);
        let opened = FlightLog::open(&files, &name, &config, &installations)?;
        if opened.digest != digest {
            let what = "the log, or which of its columns are read, has changed since its records were stored";
            let hint = "its flights are not drawn; `freeplay run` stores them anew";
            return Err(Diagnostic::new("log_changed", what).in_file(&name).hint(hint));
        }
        let plotted = |position: &Arc<str>| {
            let at = opened.actuator_at(position)?;
            let (_, part) = opened.unit(at)?;
            let (estimate, channels) = opened.estimate(at, part)?;
            channels.map(|channels| plot(&name, &channels, part, &estimate)).transpose()
        };
        positions.iter().map(plotted).collect::<Result<Vec<_>, _>>()
    })?;
    let page = |(wanted, plot): (&Wanted, Option<EstimatePlot>)| {
        let plot = plot?;
        let (unit, row) = (&report.units[wanted.unit], wanted.of(report));
        let path = flight_path(&row.tail_number, row.departure_utc, &row.position);
        let back = format!("../{}", unit_path(unit));
        let html = estimate_plot_html(&[plot], Some((&back, &unit.name())));
        let html = html.map_err(|e| Diagnostic::new("cannot_draw", e).in_file(log));
        Some(html.map(|html| (*wanted, Page::html(path, &html))))
    };
    wanted.iter().zip(plots).filter_map(page).collect()
}
