//! `init`: a commented configuration, its schema and an example table, never over something that is there.

use std::fs::{self, OpenOptions};
use std::io::{ErrorKind, Write};
use std::path::Path;

use ingest::Role;
use ingest::propose::{Proposal, propose};

use crate::args::InitArgs;
use crate::exit::{Code, Failure};
use crate::talk::Talk;

use super::shown;

const TEMPLATE: &str = include_str!("../../templates/pipeline.toml");

const FILES: [(&str, &str); 2] =
    [("pipeline.toml", TEMPLATE), ("installations.csv", include_str!("../../templates/installations.csv"))];

/// What an editor needs to complete and to check the configuration; its first line points here.
const SCHEMA: &str = "pipeline.schema.json";

/// What a newcomer does next.
const NEXT: &str = "next: say in pipeline.toml where your logs are and what their columns are called, and in \
                    installations.csv which serial number sat where; then `freeplay check`";
const NEXT_OF_PROPOSAL: &str = "next: read pipeline.toml and mend what was guessed wrong, say in installations.csv which \
                                serial number sat where; then `freeplay check`";

/// Writes the configuration, the example table and the schema.
///
/// # Errors
/// When one of them is there already; then nothing is written.
pub(crate) fn init(args: &InitArgs, talk: &Talk) -> Result<Code, Failure> {
    let names = FILES.iter().map(|(name, _)| *name).chain([SCHEMA]);
    let there = names.map(|name| args.dir.join(name)).find(|path| path.exists());
    if let Some(path) = there {
        return Err(exists(&path));
    }
    let proposed = args.from.as_deref().map(|folder| proposed(folder, &args.dir)).transpose()?;
    fs::create_dir_all(&args.dir)?;
    for (name, text) in FILES {
        let text = proposed.as_deref().filter(|_| name == "pipeline.toml").unwrap_or(text);
        write(&args.dir.join(name), text, talk)?;
    }
    write(&args.dir.join(SCHEMA), &format!("{:#}\n", job::config::Document::schema()), talk)?;
    talk.note(if args.from.is_some() { NEXT_OF_PROPOSAL } else { NEXT });
    Ok(Code::Well)
}

/// Writes a file that was not there.
fn write(path: &Path, text: &str, talk: &Talk) -> Result<(), Failure> {
    let file = OpenOptions::new().write(true).create_new(true).open(path);
    let mut file =
        file.map_err(|e| if e.kind() == ErrorKind::AlreadyExists { exists(path) } else { e.into() })?;
    file.write_all(text.as_bytes())?;
    talk.answer(&format!("wrote {}\n", shown(path)))?;
    Ok(())
}

/// The template with what the logs below a folder seem to offer; a person confirms it with `check`.
fn proposed(folder: &Path, dir: &Path) -> Result<String, Failure> {
    let pattern = glob::Pattern::escape(&folder.to_string_lossy());
    let found = glob::glob(&format!("{pattern}/**/*.parquet")).ok();
    let Some(log) = found.and_then(|mut paths| paths.find_map(Result::ok)) else {
        let what = format!("no Parquet log lies below {}", shown(folder));
        return Err(Failure::usage("no_log_matched", what, "name the folder that holds your logs"));
    };
    let offer = propose(&log).map_err(|e| Failure::Refused(vec![e.complaint()]))?;
    let (head, rest) = TEMPLATE.split_once("# Which flight a log is.").unwrap_or((TEMPLATE, ""));
    let (_, tail) = rest.split_once("[estimate]").unwrap_or(("", rest));
    let here = dir == Path::new(".") || folder.is_absolute();
    let folder = if here { folder.to_owned() } else { std::path::absolute(folder)? };
    let files = format!("files = [{:?}]", format!("{}/**/*.parquet", shown(&folder)));
    let head = head.replace("files = [\"logs/**/*.parquet\"]", &files);
    Ok(format!("{head}{}[estimate]{tail}", mapping(&offer, &shown(&log))))
}

/// The part of a configuration that a proposal fills; what it could not tell is left to be said.
fn mapping(offer: &Proposal, log: &str) -> String {
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
        format!("# Proposed from {log}: names, units and signs are guesses until `freeplay check` agrees.\n"),
        format!("# Positions found: {positions}.\n\n[identity]\n{}", identity(offer)),
        "# The zone of departures that do not name one.\ntime_zone = \"UTC\"\n".to_owned(),
        format!("\n[clock]\n{}", clock(offer)),
        channels.concat(),
        if others.is_empty() {
            "\n".to_owned()
        } else {
            format!("\n# Columns of numbers that were not understood: {}\n\n", others.join(", "))
        },
    ]
    .concat()
}

fn identity(offer: &Proposal) -> String {
    if offer.metadata.is_empty() {
        return "# The footer says nothing of the flight: from the path, folders or columns?\n\
                path = '(?<tail_number>[^/]+)/(?<departure_utc>\\d{8}T\\d{6}Z)[^/]*\\.parquet$'\n\
                departure_format = \"%Y%m%dT%H%M%SZ\"\n"
            .to_owned();
    }
    let facts: Vec<String> =
        offer.metadata.iter().map(|(fact, key)| format!("{} = {key:?}", fact.as_str())).collect();
    format!("metadata = {{ {} }}\n", facts.join(", "))
}

fn clock(offer: &Proposal) -> String {
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

fn channel(offer: &Proposal, role: Role, usual: &str) -> String {
    match offer.channels.get(&role) {
        Some((column, Some(unit))) => format!("column = {column:?}\nunit = {:?}\n", unit.as_str()),
        Some((column, None)) => {
            format!("column = {column:?}\nunit = {usual:?}          # a guess: the name does not tell\n")
        }
        None => format!("column = \"\"           # no column was recognised\nunit = {usual:?}\n"),
    }
}

fn exists(path: &Path) -> Failure {
    let what = format!("{} is there already", shown(path));
    Failure::usage("would_overwrite", what, "`freeplay init DIR` writes elsewhere; nothing was changed")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What we hand to a newcomer must pass our own checks.
    #[test]
    fn the_configuration_we_hand_out_is_a_good_one() {
        let read = job::Config::parse(FILES[0].1, Path::new("pipeline.toml"), Path::new("."));
        assert!(read.is_ok(), "{:?}", read.err());
        let dir = tempfile::tempdir().unwrap();
        let table = dir.path().join("installations.csv");
        fs::write(&table, FILES[1].1).unwrap();
        assert!(ingest::tables::installations(&table, &std::collections::BTreeMap::new()).is_ok());
    }
}
