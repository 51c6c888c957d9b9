//! `simulate`: a fleet whose gaps are known.

use pipeline::{Event, simulate as fleet};

use crate::args::SimulateArgs;
use crate::exit::{Code, Failure};
use crate::progress::Progress;
use crate::table::count;
use crate::talk::Talk;

use super::shown;

/// Flies the fleet and says where it landed.
///
/// # Errors
/// When the spec cannot be flown, the folder holds logs already, or a file cannot be written.
pub(crate) fn simulate(args: &SimulateArgs, talk: &Talk) -> Result<Code, Failure> {
    let taken = ["logs", "pipeline.toml", "installations.csv"]
        .iter()
        .map(|name| args.output.join(name))
        .find(|p| p.exists());
    if let Some(path) = taken {
        let what = format!("{} is there already", shown(&path));
        return Err(Failure::usage("would_overwrite", what, "name an empty folder; nothing was changed"));
    }
    let spec = fleet::spec(args.spec.as_deref(), args.seed)?;
    std::fs::create_dir_all(&args.output)?;
    let progress = Progress::new("simulate", talk);
    let watch = |event: Event| match event {
        Event::Planned { logs, .. } => progress.total(logs),
        Event::Finished { log, .. } => progress.finished(&log, 0, 0),
        _ => {}
    };
    let flights = fleet::simulate(&spec, &args.output, args.jobs.map(usize::from), &watch);
    progress.end();
    let folder = shown(&args.output);
    let count = count(flights?, "flight");
    talk.answer(&format!("{count} in {folder}, with installations.csv, truth.parquet and pipeline.toml\n"))?;
    talk.note(&format!("next: freeplay run --config {folder}/pipeline.toml"));
    Ok(Code::Well)
}
