//! `normalize`: the canonical log of each actuator.

use ingest::Files;
use pipeline::{Event, bundle};

use crate::args::{Global, NormalizeArgs};
use crate::exit::{Code, Failure};
use crate::progress::Progress;
use crate::table::count;
use crate::talk::Talk;

use super::{booked, shown};

/// Writes normalized logs and says how many.
///
/// # Errors
/// When configuration or tables are wrong. Logs in error make the code 1.
pub(crate) fn normalize(args: &NormalizeArgs, global: &Global, talk: &Talk) -> Result<Code, Failure> {
    let (config, installations) = booked(global)?;
    let logs: Vec<(Files, String)> = if args.logs.is_empty() {
        bundle::find(&config)?.logs.into_iter().map(|(name, files)| (files, name)).collect()
    } else {
        let whole = |path: &std::path::PathBuf| Ok((bundle::around(&config, path)?, shown(path)));
        args.logs.iter().map(whole).collect::<Result<_, Failure>>()?
    };
    let progress = Progress::new("normalize", talk);
    let watch = |event: Event| match event {
        Event::Planned { logs, .. } => progress.total(logs),
        Event::Finished { log, diagnostics, .. } => progress.finished(&log, 0, diagnostics.len()),
        _ => {}
    };
    let place = (args.output.as_path(), args.encoding.into());
    let done = pipeline::normalize::normalize(
        &config,
        &installations,
        &logs,
        place,
        args.jobs.map(usize::from),
        &watch,
    );
    progress.end();
    let done = done?;
    talk.answer(&format!(
        "{} of {} below {}\n",
        count(done.written.len(), "normalized log"),
        count(logs.len(), "log"),
        shown(&args.output)
    ))?;
    talk.complain_all(&done.diagnostics);
    Ok(if done.diagnostics.is_empty() { Code::Well } else { Code::LogsInError })
}
