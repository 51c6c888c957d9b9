//! `init`: writes a commented configuration, its JSON schema and an example table; never overwrites a file.

use std::collections::BTreeSet;
use std::fs::{self, OpenOptions};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use ingest::Role;
use ingest::log::infer_mapping::{InferredMapping, path_identity, propose};
use ingest::mapping::IdentityField;

use crate::args::InitArgs;
use crate::exit::{Code, Failure};
use crate::output::Output;

use crate::commands::context::display_path;

const TEMPLATE: &str = include_str!("../../../templates/pipeline.toml");

const FILES: [(&str, &str); 2] = [
    ("pipeline.toml", TEMPLATE),
    ("installations.csv", include_str!("../../../templates/installations.csv")),
];

/// JSON schema with which editors complete and check the configuration.
const SCHEMA: &str = "pipeline.schema.json";

/// Maximum number of logs that are read for their tail numbers.
const MOST_LOGS: usize = 5000;

const STAYS: &str = "\
# Proposed: one row per tail and position found, each with a placeholder unit.
# Enter the real part and serial numbers and dates: a trend belongs to the unit and follows it to other positions.
# Empty removed_utc: still installed. A date without time is midnight UTC.
tail_number,position,part_number,serial_number,installed_utc,removed_utc
";

/// Next steps after `init`.
const NEXT: &str = "next: set the log paths and column names in pipeline.toml, enter in installations.csv which serial \
                    number was installed where, then run `freeplay check`";
const NEXT_OF_PROPOSAL: &str = "next: review pipeline.toml and correct wrong guesses, enter in installations.csv which serial \
                                number was installed where, then run `freeplay check`";

/// Writes the configuration, the example table and the schema.
///
/// # Errors
/// If one of them already exists; then nothing is written.
pub(crate) fn init(args: &InitArgs, output: &Output) -> Result<Code, Failure> {
    let names = FILES.iter().map(|(name, _)| *name).chain([SCHEMA]);
    let there = names.map(|name| args.dir.join(name)).find(|path| path.exists());
    if let Some(path) = there {
        return Err(exists(&path));
    }
    let [mut toml, mut table] = FILES.map(|(_, text)| text.to_owned());
    if let Some(folder) = &args.from {
        let logs = logs(folder)?;
        let offer = propose(&logs[0]).map_err(|e| Failure::Refused(vec![e.diagnostic()]))?;
        toml = proposed(folder, &args.dir, &logs[0], &offer)?;
        table = installation_rows(&logs, &offer).unwrap_or(table);
    }
    fs::create_dir_all(&args.dir)?;
    for ((name, _), text) in FILES.iter().zip([toml, table]) {
        write(&args.dir.join(name), &text, output)?;
    }
    write(&args.dir.join(SCHEMA), &format!("{:#}\n", job::config::Document::schema()), output)?;
    output.note(if args.from.is_some() { NEXT_OF_PROPOSAL } else { NEXT });
    Ok(Code::Success)
}

/// Writes a new file.
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
    let found: Vec<PathBuf> =
        glob::glob(&format!("{pattern}/**/*.parquet")).into_iter().flatten().flatten().collect();
    if found.is_empty() {
        let what = format!("no *.parquet files found under {}", display_path(folder));
        return Err(Failure::usage("no_log_matched", what, "give the folder that holds your logs"));
    }
    Ok(found)
}

/// Installations table with a placeholder unit per tail and position, if the logs name both.
fn installation_rows(logs: &[PathBuf], offer: &InferredMapping) -> Option<String> {
    let by_folder = |log: &PathBuf| {
        path_identity(log)?;
        Some(log.parent()?.file_name()?.to_str()?.to_owned())
    };
    let named = offer.metadata.contains_key(&IdentityField::TailNumber);
    let tail = |log: &PathBuf| if named { propose(log).ok()?.tail } else { by_folder(log) };
    let is_plain = |name: &String| !name.contains(['"', ',', '#', '\n']);
    let tails: BTreeSet<String> = logs.iter().take(MOST_LOGS).filter_map(tail).filter(is_plain).collect();
    let positions = || offer.positions.iter().filter(|name| is_plain(name));
    let row =
        |tail: &String, position| format!("{tail},{position},EMA-27-1040,{tail} {position},1970-01-01,\n");
    let rows: Vec<String> = tails.iter().flat_map(|t| positions().map(move |p| row(t, p))).collect();
    (!rows.is_empty()).then(|| format!("{STAYS}{}", rows.concat()))
}

/// Template with the mapping inferred from the logs below a folder, to be verified with `check`.
fn proposed(folder: &Path, dir: &Path, log: &Path, offer: &InferredMapping) -> Result<String, Failure> {
    let (head, rest) = TEMPLATE.split_once("# Which flight a log is.").unwrap_or((TEMPLATE, ""));
    let (_, tail) = rest.split_once("[estimate]").unwrap_or(("", rest));
    let here = dir == Path::new(".") || folder.is_absolute();
    let folder = if here { folder.to_owned() } else { std::path::absolute(folder)? };
    let files = format!("files = [{:?}]", format!("{}/**/*.parquet", display_path(&folder)));
    let head = head.replace("files = [\"logs/**/*.parquet\"]", &files);
    Ok(format!("{head}{}[estimate]{tail}", mapping(offer, log)))
}

/// Inferred part of the configuration; keys that could not be inferred are left to fill in.
fn mapping(offer: &InferredMapping, log: &Path) -> String {
    let positions: Vec<&str> = offer.positions.iter().map(String::as_str).collect();
    let positions = if positions.is_empty() { "none".to_owned() } else { positions.join(", ") };
    let others: Vec<&str> = offer.others.iter().take(12).map(String::as_str).collect();
    let channels = [
        (Role::Motor, "motor_position", "deg"),
        (Role::Screw, "screw_position", "mm"),
        (Role::Load, "load", "N"),
    ];
    let channels =
        channels.map(|(role, name, usual)| format!("\n[channel.{name}]\n{}", channel(offer, role, usual)));
    [
        format!(
            "# Inferred from {}: verify names, units and signs with `freeplay check`.\n",
            display_path(log)
        ),
        format!("# Positions found: {positions}.\n\n[identity]\n{}", identity(offer, log)),
        "# Time zone of departures without one.\ntime_zone = \"UTC\"\n".to_owned(),
        format!("\n[clock]\n{}", clock(offer)),
        channels.concat(),
        if others.is_empty() {
            "\n".to_owned()
        } else {
            format!("\n# Unmapped numeric columns: {}\n\n", others.join(", "))
        },
    ]
    .concat()
}

fn identity(offer: &InferredMapping, log: &Path) -> String {
    if offer.metadata.is_empty() {
        let found = path_identity(log);
        let remark = match found {
            Some(_) => "# No identity in the file metadata; inferred from the path.\n",
            None => "# TODO: no tail/departure found in metadata or path; set path, folders or columns\n",
        };
        let (path, format) = found.unwrap_or_else(|| {
            (
                r"(?<tail_number>[^/]+)/(?<departure_utc>\d{8}T\d{6}Z)[^/]*\.parquet$".to_owned(),
                "%Y%m%dT%H%M%SZ",
            )
        });
        return format!("{remark}path = '{path}'\ndeparture_format = \"{format}\"\n");
    }
    let facts: Vec<String> =
        offer.metadata.iter().map(|(fact, key)| format!("{} = {key:?}", fact.as_str())).collect();
    format!("metadata = {{ {} }}\n", facts.join(", "))
}

fn clock(offer: &InferredMapping) -> String {
    match &offer.clock {
        Some((column, Some(unit))) => format!("column = {column:?}\nunit = {unit:?}\n"),
        Some((column, None)) => {
            format!(
                "column = {column:?}\n# unit = \"s\"          # s, ms, us, ns; not needed for timestamps\n"
            )
        }
        None => "# No time column was recognised.\ncolumn = \"\"\nunit = \"s\"\n".to_owned(),
    }
}

fn channel(offer: &InferredMapping, role: Role, usual: &str) -> String {
    match offer.channels.get(&role) {
        Some((column, Some(unit))) => format!("column = {column:?}\nunit = {:?}\n", unit.as_str()),
        Some((column, None)) => {
            format!("column = {column:?}\nunit = {usual:?}          # a guess: the name has no unit\n")
        }
        None => format!("column = \"\"           # no column was recognised\nunit = {usual:?}\n"),
    }
}

fn exists(path: &Path) -> Failure {
    let what = format!("{} already exists", display_path(path));
    Failure::usage(
        "would_overwrite",
        what,
        "write to another folder with `freeplay init DIR`; nothing was changed",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The template must pass the program's own checks.
    #[test]
    fn the_template_configuration_is_valid() {
        let read = job::Config::parse(FILES[0].1, Path::new("pipeline.toml"), Path::new("."));
        assert!(read.is_ok(), "{:?}", read.err());
        let dir = tempfile::tempdir().unwrap();
        let table = dir.path().join("installations.csv");
        fs::write(&table, FILES[1].1).unwrap();
        assert!(ingest::tables::installations(&table, &std::collections::BTreeMap::new()).is_ok());
    }
}
