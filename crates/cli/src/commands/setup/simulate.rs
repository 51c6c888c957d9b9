//! `simulate`: simulates a fleet with known gaps.

use pipeline::inspect::simulate as fleet;

use crate::args::SimulateArgs;
use crate::commands::context::display_path;
use crate::table::count;
use crate::{Code, Failure, Output, progress, row_output};

/// Simulates the fleet and prints the folder.
///
/// # Errors
/// If the spec is invalid, the folder already holds logs, or a file cannot be written.
pub(crate) fn simulate(args: &SimulateArgs, output: &Output) -> Result<Code, Failure> {
    row_output::check_folder(&args.output)?;
    let taken = ["logs", "pipeline.toml", "installations.csv"]
        .iter()
        .map(|name| args.output.join(name))
        .find(|p| p.exists());
    if let Some(path) = taken {
        let what = format!("{} already exists", display_path(&path));
        return Err(Failure::usage("would_overwrite", what, "give an empty folder; nothing was changed"));
    }
    let spec = fleet::spec(args.spec.as_deref(), args.seed)?;
    std::fs::create_dir_all(&args.output)?;
    let jobs = args.jobs.map(usize::from);
    let logs =
        progress::shown("simulate", output, |watch| fleet::simulate(&spec, &args.output, jobs, watch))?;
    let (folder, count) = (display_path(&args.output), count(logs, "log"));
    output.write_result(&format!(
        "{count} in {folder}, with their tables, truth.parquet and pipeline.toml\n"
    ))?;
    output.note(&format!("next: freeplay run --config {folder}/pipeline.toml"));
    Ok(Code::Success)
}
