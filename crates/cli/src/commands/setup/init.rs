//! `init`: writes a commented configuration, its JSON schema and an example table, or the sample fleet; never
//! overwrites a file.

use std::fs::{self, OpenOptions};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use pipeline::inspect::simulate::{SAMPLE_FOLDER, write_sample};
use pipeline::logs::local_files::is_temporary;

use crate::args::InitArgs;
use crate::commands::context::display_path;
use crate::commands::setup::proposal::{Proposal, TEMPLATE};
use crate::table::count;
use crate::{Code, Failure, Output, progress, row_output};

const FILES: [(&str, &str); 2] = [
    ("pipeline.toml", TEMPLATE),
    ("installations.csv", include_str!("../../../templates/installations.csv")),
];

/// JSON schema with which editors complete and check the configuration.
const SCHEMA: &str = "pipeline.schema.json";

const NEXT: &str = "next: set the log paths and column names in pipeline.toml, enter in installations.csv which serial \
                    number was installed where, then run `freeplay check`";
const NEXT_OF_PROPOSAL: &str = "next: review pipeline.toml and correct wrong guesses, enter in installations.csv which part and \
                                serial number was installed where, then run `freeplay check`";

/// Next steps after `init --sample`, in its folder.
const NEXT_OF_SAMPLE: &str = "freeplay run && freeplay report --output report && freeplay work list";

/// Writes the configuration, the example table and the schema; or the sample fleet.
///
/// # Errors
/// If one of the files already exists; then nothing is written.
pub(crate) fn init(args: &InitArgs, output: &Output) -> Result<Code, Failure> {
    row_output::check_folder(&args.dir)?;
    if args.sample {
        return sample(&args.dir, output);
    }
    let names = FILES.iter().map(|(name, _)| *name).chain([SCHEMA]);
    let there = names.map(|name| args.dir.join(name)).find(|path| path.exists());
    if let Some(path) = there {
        return Err(exists(&path));
    }
    let [mut toml, mut table] = FILES.map(|(_, text)| text.to_owned());
    if let Some(folder) = &args.from {
        let logs = logs(folder)?;
        let proposal = Proposal::of(folder, &logs)?;
        (toml, table) = (proposal.configuration(folder, &args.dir)?, proposal.installations(&logs));
        output.note(&proposal.coverage());
    }
    fs::create_dir_all(&args.dir)?;
    for ((name, _), text) in FILES.iter().zip([toml, table]) {
        write(&args.dir.join(name), &text, output)?;
    }
    write(&args.dir.join(SCHEMA), &format!("{:#}\n", job::config::Document::schema()), output)?;
    output.note(if args.from.is_some() { NEXT_OF_PROPOSAL } else { NEXT });
    Ok(Code::Success)
}

fn sample(dir: &Path, output: &Output) -> Result<Code, Failure> {
    let there = ["pipeline.toml", SAMPLE_FOLDER].map(|name| dir.join(name)).into_iter().find(|p| p.exists());
    if let Some(path) = there {
        return Err(exists(&path));
    }
    fs::create_dir_all(dir)?;
    let logs = progress::shown("simulate", output, |watch| write_sample(dir, watch))?;
    let data = display_path(&dir.join(SAMPLE_FOLDER));
    output.write_result(&format!(
        "wrote {}\nwrote {data}: {}, installations, flights, maintenance, inspections and the true gaps\n",
        display_path(&dir.join("pipeline.toml")),
        count(logs, "simulated log"),
    ))?;
    let is_here = dir == Path::new(".");
    let change = if is_here { String::new() } else { format!("cd {} && ", display_path(dir)) };
    output.note(&format!("next: {change}{NEXT_OF_SAMPLE}"));
    Ok(Code::Success)
}

fn write(path: &Path, text: &str, output: &Output) -> Result<(), Failure> {
    let file = OpenOptions::new().write(true).create_new(true).open(path);
    let mut file =
        file.map_err(|e| if e.kind() == ErrorKind::AlreadyExists { exists(path) } else { e.into() })?;
    file.write_all(text.as_bytes())?;
    output.write_result(&format!("wrote {}\n", display_path(path)))?;
    Ok(())
}

/// All Parquet files below a folder; an error if there is none.
fn logs(folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let pattern = glob::Pattern::escape(&folder.to_string_lossy());
    let found = glob::glob(&format!("{pattern}/**/*.parquet")).into_iter().flatten().flatten();
    let found: Vec<PathBuf> = found.filter(|path| !is_temporary(path, folder)).collect();
    if found.is_empty() {
        let what = format!("no *.parquet files found under {}", display_path(folder));
        return Err(Failure::usage(
            "no_log_matched",
            what,
            "give the folder that holds your logs; docs/convert-logs.md converts CSV and others",
        ));
    }
    Ok(found)
}

fn exists(path: &Path) -> Failure {
    let what = format!("{} already exists", display_path(path));
    Failure::usage(
        "would_overwrite",
        what,
        "write to another folder with `freeplay init DIR`; nothing was changed",
    )
}
