//! `report`: writes the HTML report.

use std::sync::Arc;

use jiff::Timestamp;

use pipeline::report::{compose, data, flight_plots, publish};

use crate::args::{Global, ReportArgs};
use crate::commands::context::{KnownNames, VERSION, display_path, load_with_installations, note_future};
use crate::table::count;
use crate::{Code, Failure, Output, progress, row_output};

/// Writes the pages; prints the path of the first one, their number and size.
///
/// # Errors
/// If configuration, tables or store cannot be read, or the folder cannot be written. Logs that cannot be drawn make the
/// exit code 1; the report is written without them.
pub(crate) fn report(args: &ReportArgs, global: &Global, output: &Output) -> Result<Code, Failure> {
    row_output::check_folder(&args.output)?;
    note_future(args.as_of, output);
    let (config, installations) = load_with_installations(global)?;
    let ask = args.units.selection(args.as_of);
    let store = pipeline::open_store(&config, &installations)?;
    let program = format!("Freeplay {VERSION}");
    let mut report = compose::compose(&config, &installations, &store, &ask, Timestamp::now(), &program)?;
    if report.units.is_empty() {
        let known = KnownNames::of(&config);
        known.check_units(&args.units)?;
        let what = known.why_nothing(&ask);
        let hint = "list all units of the store with `freeplay trend --all`; fill it with `freeplay run`";
        return Err(Failure::usage("nothing_to_report", what, hint));
    }
    let (config, installations) = (Arc::new(config), Arc::new(installations));
    let mut files = Vec::new();
    let mut diagnostics = Vec::new();
    if let Some(flights) = args.diagnostics {
        let plots = flight_plots::draw(&mut report, usize::from(flights), &config, &installations, &store)?;
        if plots.left_out > 0 {
            output.note(&format!(
                "{} without a diagnostic plot: a report has at most {}; select units with `--tail`, `--serial` or `--part`",
                count(plots.left_out, "flight"),
                flight_plots::MAX_PLOTS
            ));
        }
        files.extend(plots.pages);
        diagnostics = plots.diagnostics;
    }
    if args.data {
        files.extend(data::tables(&report)?);
    }
    let written =
        progress::shown("report", output, |watch| publish::write(&report, files, &args.output, &watch))?;
    let index = display_path(&args.output.join("index.html"));
    let size = written.bytes as f64 / 1e6;
    let units = count(report.units.len(), "unit");
    output.write_result(&format!("{index}: {units}, {} files, {size:.1} MB\n", written.files))?;
    output.diagnostics(&diagnostics);
    Ok(if diagnostics.is_empty() { Code::Success } else { Code::LogsInError })
}
