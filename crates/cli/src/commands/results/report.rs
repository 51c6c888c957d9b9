//! `report`: writes the HTML report.

use jiff::Timestamp;
use pipeline::Event;
use pipeline::fleet_trends::assess::UnitSelection;
use pipeline::report::{compose, publish};
use store::Store;

use crate::args::{Global, ReportArgs};
use crate::exit::{Code, Failure};
use crate::output::Output;
use crate::progress::Progress;
use crate::row_output;
use crate::table::count;

use crate::commands::context::{KnownNames, VERSION, display_path, load_with_installations, selection};

/// Writes the pages and prints the path of the first one.
///
/// # Errors
/// If configuration, tables or store cannot be read, or the folder cannot be written.
pub(crate) fn report(args: &ReportArgs, global: &Global, output: &Output) -> Result<Code, Failure> {
    row_output::check_folder(&args.output)?;
    let (config, installations) = load_with_installations(global)?;
    let ask = UnitSelection { statistics: true, ..args.units.selection(args.as_of) };
    let store = Store::open(config.store())?;
    let program = format!("Freeplay {VERSION}");
    let report = compose::compose(&config, &installations, &store, &ask, Timestamp::now(), &program)?;
    if report.units.is_empty() {
        let known = KnownNames::read(&config);
        known.check_units(&args.units)?;
        let what = format!("no unit{} has flown; {}", selection(&ask), known.searched());
        let hint = "list the store's contents with `freeplay store info`; fill it with `freeplay run`";
        return Err(Failure::usage("nothing_to_report", what, hint));
    }
    let progress = Progress::new("report", output);
    let watch = |event: Event| match event {
        Event::Planned { logs, .. } => progress.total(logs),
        Event::Finished { log, .. } => progress.finished(&log, 0, 0),
        _ => {}
    };
    let written = publish::write(&report, &args.output, &watch);
    progress.end();
    let written = written?;
    let index = display_path(&args.output.join("index.html"));
    let size = written.bytes as f64 / 1e6;
    let units = count(report.units.len(), "unit");
    output.write_result(&format!("{index}: {units}, {} files, {size:.1} MB\n", written.files))?;
    Ok(Code::Success)
}
