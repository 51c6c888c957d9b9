//! `init`: writes a commented configuration, its JSON schema and an example table, or the sample fleet; never
//! overwrites a file.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs::{self, OpenOptions};
use std::io::{ErrorKind, Write};
use std::path::{Component, Path, PathBuf};

use ingest::infer::{
    InferredMapping, PLACE_END, folder_value, path_identity, path_position, path_tail, propose,
};
use ingest::mapping::IdentityField;
use ingest::mapping::units::Unit;
use ingest::{Layout, Role};
use pipeline::inspect::simulate::{SAMPLE_FOLDER, write_sample};
use pipeline::logs::temporary_files::is_temporary;
use records::sanitize::csv_cell;

use crate::args::InitArgs;
use crate::exit::{Code, Failure};
use crate::output::{Output, escape};
use crate::row_output;
use crate::table::count;

use crate::commands::context::display_path;
use crate::commands::setup::simulate::with_progress;

const TEMPLATE: &str = include_str!("../../../templates/pipeline.toml");

const FILES: [(&str, &str); 2] = [
    ("pipeline.toml", TEMPLATE),
    ("installations.csv", include_str!("../../../templates/installations.csv")),
];

/// JSON schema with which editors complete and check the configuration.
const SCHEMA: &str = "pipeline.schema.json";

/// Maximum number of logs that are read for their tail numbers.
const MOST_LOGS: usize = 5000;

/// Head of a proposed installations table.
const INSTALLATIONS_HEAD: &str = "\
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
        toml = proposed(folder, &args.dir, &proposal)?;
        // Without a tail and a position there is no row: a serial number is never invented for one.
        table = installation_rows(&proposal.logs, &proposal.offer)
            .unwrap_or_else(|| INSTALLATIONS_HEAD.to_owned());
    }
    fs::create_dir_all(&args.dir)?;
    for ((name, _), text) in FILES.iter().zip([toml, table]) {
        write(&args.dir.join(name), &text, output)?;
    }
    write(&args.dir.join(SCHEMA), &format!("{:#}\n", job::config::Document::schema()), output)?;
    output.note(if args.from.is_some() { NEXT_OF_PROPOSAL } else { NEXT });
    Ok(Code::Success)
}

/// Writes the sample fleet with its configuration.
fn sample(dir: &Path, output: &Output) -> Result<Code, Failure> {
    let there = ["pipeline.toml", SAMPLE_FOLDER].map(|name| dir.join(name)).into_iter().find(|p| p.exists());
    if let Some(path) = there {
        return Err(exists(&path));
    }
    fs::create_dir_all(dir)?;
    let logs = with_progress(output, |watch| write_sample(dir, watch))?;
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
    let found = glob::glob(&format!("{pattern}/**/*.parquet")).into_iter().flatten().flatten();
    let found: Vec<PathBuf> = found.filter(|path| !is_temporary(path, folder)).collect();
    if found.is_empty() {
        let what = format!("no *.parquet files found under {}", display_path(folder));
        return Err(Failure::usage("no_log_matched", what, "give the folder that holds your logs"));
    }
    Ok(found)
}

/// The mapping of the logs below a folder, and of the files of other kinds that belong to them.
struct Proposal<'p> {
    /// The main logs, and the first of them.
    logs: Vec<PathBuf>,
    log: &'p Path,
    offer: InferredMapping,
    /// The folder of the main logs below the given one, if others hold groups.
    main: Option<String>,
    /// Groups by their folder, with what their files offer and the channels that they alone hold.
    groups: BTreeMap<String, (InferredMapping, Vec<Role>)>,
}

impl<'p> Proposal<'p> {
    /// Logs whose channels lie in several folders, each with a part of them, are a main log and groups.
    fn of(folder: &Path, logs: &'p [PathBuf]) -> Result<Self, Failure> {
        let offer_of = |log: &Path| propose(log).map_err(|e| Failure::Refused(vec![e.diagnostic()]));
        let kind = |log: &PathBuf| -> Option<String> {
            let below = log.strip_prefix(folder).ok()?.parent()?;
            Some(below.components().next()?.as_os_str().to_str()?.to_owned())
        };
        let mut firsts: BTreeMap<String, &PathBuf> = BTreeMap::new();
        for log in logs {
            if let Some(kind) = kind(log) {
                firsts.entry(kind).or_insert(log);
            }
        }
        let whole = Self {
            logs: logs.to_vec(),
            log: &logs[0],
            offer: offer_of(&logs[0])?,
            main: None,
            groups: BTreeMap::new(),
        };
        let lacks = |offer: &InferredMapping, role: &Role| !offer.channels.contains_key(role);
        let is_whole = !Role::NEEDED.iter().any(|role| lacks(&whole.offer, role));
        if is_whole || !(2..=MOST_GROUPS).contains(&firsts.len()) {
            return Ok(whole);
        }
        let mut offers = BTreeMap::new();
        for (kind, log) in &firsts {
            offers.insert(kind.clone(), (offer_of(log)?, *log));
        }
        let holder = |role: Role| offers.iter().find(|(_, (offer, _))| offer.channels.contains_key(&role));
        let Some((main, (offer, log))) = holder(Role::Motor) else { return Ok(whole) };
        let mut groups: BTreeMap<String, (InferredMapping, Vec<Role>)> = BTreeMap::new();
        for role in Role::ALL.into_iter().filter(|role| lacks(offer, role)) {
            if let Some((kind, (of_group, _))) = holder(role) {
                groups.entry(kind.clone()).or_insert_with(|| (of_group.clone(), Vec::new())).1.push(role);
            }
        }
        let mut offer = offer.clone();
        for (of_group, roles) in groups.values() {
            for role in roles {
                offer.channels.insert(*role, of_group.channels[role].clone());
                offer
                    .alternatives
                    .extend(of_group.alternatives.get(role).map(|others| (*role, others.clone())));
            }
        }
        let is_main = |log: &&PathBuf| kind(log).as_ref() == Some(main);
        let logs = logs.iter().filter(is_main).cloned().collect();
        Ok(Self { logs, log, offer, main: Some(main.clone()), groups })
    }

    fn group_of(&self, role: Role) -> Option<&str> {
        self.groups.iter().find(|(_, (_, roles))| roles.contains(&role)).map(|(name, _)| name.as_str())
    }
}

/// Folders of more kinds than this are tails or days, not groups.
const MOST_GROUPS: usize = 6;

/// Installations table with a placeholder unit per tail and position, if the logs name both.
fn installation_rows(logs: &[PathBuf], offer: &InferredMapping) -> Option<String> {
    let folder = |log: &Path, fact| folder_value(log, offer.folders.get(&fact)?);
    let tail = |log: &PathBuf| {
        let own = offer.tail.is_some().then(|| propose(log).ok()?.tail).flatten();
        own.or_else(|| folder(log, IdentityField::TailNumber)).or_else(|| path_tail(log))
    };
    let is_plain = |name: &String| {
        !name.contains(|c: char| matches!(c, '"' | ',' | '#') || c.is_control()) && csv_cell(name) == *name
    };
    let mut places: BTreeSet<(String, String)> = BTreeSet::new();
    for log in logs.iter().take(MOST_LOGS) {
        let Some(tail) = tail(log).filter(is_plain) else { continue };
        let own = folder(log, IdentityField::Position)
            .or_else(|| path_position(log).filter(|_| needs_position(offer)));
        let positions = own.iter().chain(offer.positions.iter().filter(|_| own.is_none()));
        places
            .extend(positions.filter(|name| is_plain(name)).map(|position| (tail.clone(), position.clone())));
    }
    let row = |(tail, position): &(String, String)| {
        format!("{tail},{position},EMA-27-1040,{tail} {position},1970-01-01,\n")
    };
    let rows: Vec<String> = places.iter().map(row).collect();
    (!rows.is_empty()).then(|| format!("{INSTALLATIONS_HEAD}{}", rows.concat()))
}

/// Template with the mapping inferred from the logs below a folder, to be verified with `check`.
fn proposed(folder: &Path, dir: &Path, proposal: &Proposal<'_>) -> Result<String, Failure> {
    let (head, rest) = TEMPLATE.split_once("# Which flight a log is.").unwrap_or((TEMPLATE, ""));
    let (_, tail) = rest.split_once("[estimate]").unwrap_or(("", rest));
    let folder = relative(folder, dir)?;
    let below = |kind: Option<&String>| {
        let deeper = kind.map_or_else(String::new, |kind| format!("/{kind}"));
        quoted(&format!("{}{deeper}/**/*.parquet", display_path(&folder)))
    };
    let files = format!("files = [{}]", below(proposal.main.as_ref()));
    let mut head = head.replace("files = [\"logs/**/*.parquet\"]", &files);
    for (kind, (offer, _)) in &proposal.groups {
        let files = below(Some(kind));
        let kind = key(kind);
        let _ = write!(head, "[group.{kind}]\nfiles = [{files}]\n\n");
        if offer.clock != proposal.offer.clock {
            let _ = write!(head, "[group.{kind}.clock]\n{}\n", clock(offer));
        }
        if offer.layout != Layout::default() {
            let _ = write!(head, "[group.{kind}.layout]\n{}\n", layout(&offer.layout));
        }
    }
    Ok(format!("{head}{}[estimate]{tail}", mapping(proposal)))
}

/// A folder as it is named from another one; as it is where they share no root.
fn relative(folder: &Path, from: &Path) -> Result<PathBuf, Failure> {
    if folder.is_absolute() {
        return Ok(folder.to_owned());
    }
    let plain = |path: &Path| -> Result<PathBuf, Failure> {
        let mut found = PathBuf::new();
        for part in std::path::absolute(path)?.components() {
            match part {
                Component::CurDir => {}
                Component::ParentDir => drop(found.pop()),
                part => found.push(part),
            }
        }
        Ok(found)
    };
    let (folder, from) = (plain(folder)?, plain(from)?);
    let shared = folder.components().zip(from.components()).take_while(|(a, b)| a == b).count();
    let up = from.components().skip(shared).map(|_| Component::ParentDir);
    let found: PathBuf = up.chain(folder.components().skip(shared)).collect();
    Ok(if found.as_os_str().is_empty() { PathBuf::from(".") } else { found })
}

/// Inferred part of the configuration; keys that could not be inferred are left to fill in.
fn mapping(proposal: &Proposal<'_>) -> String {
    let Proposal { offer, log, .. } = proposal;
    let positions: Vec<&str> = offer.positions.iter().map(String::as_str).collect();
    let positions = if positions.is_empty() { "none".to_owned() } else { escape(&positions.join(", ")) };
    let others: Vec<&str> = offer.others.iter().take(12).map(String::as_str).collect();
    let channels = [
        (Role::Motor, "motor_position", "deg"),
        (Role::Screw, "screw_position", "mm"),
        (Role::Load, "load", "N"),
    ];
    let channels =
        channels.map(|(role, name, usual)| format!("\n[channel.{name}]\n{}", channel(proposal, role, usual)));
    let temperature = if offer.channels.contains_key(&Role::Temperature) {
        format!("\n[channel.temperature]\n{}", channel(proposal, Role::Temperature, "degC"))
    } else {
        String::new()
    };
    let rows = if offer.layout == Layout::default() {
        String::new()
    } else {
        format!("\n[layout]\n{}", layout(&offer.layout))
    };
    [
        format!(
            "# Inferred from {}: verify names, units and signs with `freeplay check`.\n",
            escape(&display_path(log))
        ),
        format!("# Positions found: {positions}.\n\n[identity]\n{}", identity(offer, log)),
        "# Time zone of departures without one.\ntime_zone = \"UTC\"\n".to_owned(),
        rows,
        format!("\n[clock]\n{}", clock(offer)),
        channels.concat(),
        temperature,
        if others.is_empty() {
            "\n".to_owned()
        } else {
            format!("\n# Unmapped numeric columns: {}\n\n", escape(&others.join(", ")))
        },
    ]
    .concat()
}

/// A text as a basic string of TOML 1.0.
fn quoted(text: &str) -> String {
    let escaped = |c: char| match c {
        '"' | '\\' => format!("\\{c}"),
        c if is_escaped(c) => format!("\\U{:08X}", u32::from(c)),
        c => c.to_string(),
    };
    format!("\"{}\"", text.chars().map(escaped).collect::<String>())
}

/// Whether a character has an effect in an editor without being seen.
fn is_escaped(c: char) -> bool {
    escape(c.encode_utf8(&mut [0; 4])).len() > c.len_utf8()
}

/// A key of TOML 1.0: bare where it can be.
fn key(text: &str) -> String {
    let is_bare = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_');
    if text.chars().all(is_bare) { text.to_owned() } else { quoted(text) }
}

fn layout(layout: &Layout) -> String {
    let keys = [
        ("name_column", &layout.name_column),
        ("value_column", &layout.value_column),
        ("position_column", &layout.position_column),
    ];
    keys.iter().filter_map(|(key, column)| Some(format!("{key} = {}\n", quoted(column.as_ref()?)))).collect()
}

/// Whether neither columns nor folders name the position of a log.
fn needs_position(offer: &InferredMapping) -> bool {
    offer.positions.is_empty()
        && !offer.folders.contains_key(&IdentityField::Position)
        && offer.layout.position_column.is_none()
}

fn identity(offer: &InferredMapping, log: &Path) -> String {
    let table = |key: &str, facts: &BTreeMap<IdentityField, String>| {
        let facts: Vec<String> =
            facts.iter().map(|(fact, name)| format!("{} = {}", fact.as_str(), quoted(name))).collect();
        if facts.is_empty() { String::new() } else { format!("{key} = {{ {} }}\n", facts.join(", ")) }
    };
    let mut text = [
        table("metadata", &offer.metadata),
        table("columns", &offer.columns),
        table("folders", &offer.folders),
    ]
    .concat();
    let has = |fact| {
        [&offer.metadata, &offer.columns, &offer.folders].iter().any(|facts| facts.contains_key(&fact))
    };
    if has(IdentityField::TailNumber) && has(IdentityField::DepartureUtc) {
        if needs_position(offer) && path_position(log).is_some() {
            let _ = writeln!(text, "# The position is inferred from the file name.\npath = '{PLACE_END}$'");
        }
        return text;
    }
    match path_identity(log, needs_position(offer)) {
        Some((path, format)) => {
            text.push_str(
                "# Not all of the identity is in metadata or columns; the rest is inferred from the path.\n",
            );
            let _ = writeln!(text, "path = '{path}'\ndeparture_format = {format:?}");
        }
        None if has(IdentityField::TailNumber) => {
            text.push_str("# No departure was found: it is the first timestamp if the clock has a date.\n");
        }
        None => {
            text.push_str(
                "# TODO: no tail/departure found in metadata or path; set path, folders or columns\n",
            );
            text.push_str(
                "path = '(?<tail_number>[^/]+)/(?<departure_utc>\\d{8}T\\d{6}Z)[^/]*\\.parquet$'\n",
            );
            text.push_str("departure_format = \"%Y%m%dT%H%M%SZ\"\n");
        }
    }
    text
}

fn clock(offer: &InferredMapping) -> String {
    let epoch = if offer.is_unix_clock { "epoch = \"unix\"\n" } else { "" };
    match &offer.clock {
        Some((column, Some(unit))) => {
            format!("column = {}\nunit = {}\n{epoch}", quoted(column), quoted(unit))
        }
        Some((column, None)) => {
            let column = quoted(column);
            format!("column = {column}\n# unit = \"s\"          # s, ms, us, ns; not needed for timestamps\n")
        }
        None => "# No time column was recognised.\ncolumn = \"\"\nunit = \"s\"\n".to_owned(),
    }
}

fn channel(proposal: &Proposal<'_>, role: Role, usual: &str) -> String {
    let offer = &proposal.offer;
    let mut text = match offer.channels.get(&role) {
        Some((column, Some(unit))) => format!("column = {}\nunit = {:?}\n", quoted(column), unit.as_str()),
        Some((column, None)) => {
            format!(
                "column = {}\nunit = {usual:?}          # a guess: the name has no unit\n",
                quoted(column)
            )
        }
        None => format!("column = \"\"           # no column was recognised\nunit = {usual:?}\n"),
    };
    if let Some(group) = proposal.group_of(role) {
        let _ = writeln!(text, "group = {}", quoted(group));
    }
    let turn = offer.motor_wraps_at.filter(|_| role == Role::Motor);
    if let Some(turn) = turn {
        let _ = writeln!(text, "wraps_at = {turn:?}");
    }
    let own_unit = offer.channels.get(&role).and_then(|(_, unit)| *unit);
    let other = |(column, unit): &(String, Option<Unit>)| {
        let unit = unit.or(own_unit).map_or(usual, |unit| unit.as_str());
        let wraps = turn.map_or_else(String::new, |turn| format!(", wraps_at = {turn:?}"));
        let column = quoted(column);
        format!("{{ column = {column}, unit = {unit:?}{wraps} }}")
    };
    if let Some(others) = offer.alternatives.get(&role) {
        let others: Vec<String> = others.iter().map(other).collect();
        let _ = writeln!(text, "alternatives = [{}]", others.join(", "));
    }
    text
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
        assert!(ingest::tables::installations(&table, &BTreeMap::new()).is_ok());
    }
}
