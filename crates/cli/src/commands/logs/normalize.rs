//! `normalize`: writes the normalized log of each actuator.

use pipeline::logs::discover;

use crate::args::{Global, NormalizeArgs};
use crate::commands::context::{display_path, load_with_installations};
use crate::table::count;
use crate::{Code, Failure, Output, progress, row_output};

/// Writes normalized logs and prints their number.
///
/// # Errors
/// If configuration or tables are wrong. Failed logs make the exit code 1.
pub(crate) fn normalize(args: &NormalizeArgs, global: &Global, output: &Output) -> Result<Code, Failure> {
    row_output::check_folder(&args.output)?;
    let (config, installations) = load_with_installations(global)?;
    let selected = discover::select(&config, args.logs.as_deref(), usize::MAX)?;
    selected.notes.iter().for_each(|note| output.note(note));
    let logs = selected.logs.len();
    let (folder, jobs) = (args.output.as_path(), args.jobs.map(usize::from));
    let done = progress::shown("normalize", output, |watch| {
        pipeline::inspect::normalize::normalize(
            &config,
            &installations,
            selected,
            folder,
            args.encoding,
            jobs,
            watch,
        )
    })?;
    output.write_result(&format!(
        "{} of {} below {}\n",
        count(done.written.len(), "normalized log"),
        count(logs, "log"),
        display_path(&args.output)
    ))?;
    output.diagnostics(&done.diagnostics);
    Ok(if done.diagnostics.is_empty() { Code::Success } else { Code::LogsInError })
}
