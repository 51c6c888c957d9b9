//! Log discovery: usually one file per log; with groups or pieces, the files of one flight.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::{Path, PathBuf};
use std::str::Utf8Chunk;

use ingest::log::flight_rows::split_path;
use ingest::{IdentityMapping, LogFiles};
use jiff::Timestamp;
use job::Config;
use job::flight_log::{MAX_BETWEEN_PIECES, flights_in, identify};
use object_io::{Address, ListEntry};
use rayon::prelude::*;
use records::{Diagnostic, Flight, FlightId, Position, TailNumber};

use crate::error::{Error, is_passing};
use crate::logs::discover_remote;
use crate::logs::file_stat::{FileStat, SeenObjects};
use crate::logs::local_files;
use crate::logs::local_files::is_temporary;
use crate::logs::table_folders::{TableFault, TableFolders};

/// The logs that fit the patterns.
#[derive(Debug, Clone, Default)]
pub struct DiscoveredLogs {
    /// Their files, by the name of the first, and why they cannot be read.
    pub(crate) logs: BTreeMap<String, (LogFiles, Option<Diagnostic>)>,
    /// Files of groups whose flight has no main log.
    strays: Vec<String>,
    /// File status of objects from listings, by address.
    pub(crate) seen: SeenObjects,
}

/// A log after its name in records.
pub type NamedLog = (String, LogFiles);

/// Every log that fits the patterns, by the shown name of its first file.
///
/// # Errors
/// [`Error::Refused`] when a pattern fits no file, or is no pattern.
pub fn discover(config: &Config) -> Result<DiscoveredLogs, Error> {
    let mut found = DiscoveredLogs::default();
    let main = matching(config, &config.document.logs.files, &mut found)?;
    let main = flights_of(config, main, &config.document.identity, &mut found);
    let mut companions = Vec::new();
    for (name, group) in &config.document.group {
        let files = matching(config, &group.files, &mut found)?;
        let identity = group.identity.as_ref().unwrap_or(&config.document.identity);
        let files = flights_of(config, files, identity, &mut found);
        companions.extend(files.into_iter().map(|file| (name.as_str(), file)));
    }
    if companions.is_empty() && !config.document.logs.has_pieces() {
        found.logs.extend(main.into_iter().map(|(log_path, path)| (log_path, (LogFiles::one(path), None))));
    } else {
        group_files(config, main, companions, &mut found);
    }
    Ok(found)
}

/// The flights of some files, each with a name and a path of its own; a file that cannot be read keeps its name, and is
/// a log in error.
fn flights_of(
    config: &Config,
    files: Vec<(String, PathBuf)>,
    identity: &IdentityMapping,
    found: &mut DiscoveredLogs,
) -> Vec<(String, PathBuf)> {
    if !identity.by_row {
        return files;
    }
    let split: Vec<_> =
        files.into_par_iter().map(|(name, path)| (flights_in(&path, &name, identity), name, path)).collect();
    let mut named = Vec::new();
    for (flights, name, path) in split {
        match flights {
            Ok(paths) => named.extend(paths.into_iter().map(|path| (log_path(config, &path), path))),
            Err(diagnostic) if is_passing(&diagnostic.code) => {
                found.logs.insert(name, (LogFiles::one(path), Some(diagnostic)));
            }
            Err(_) => named.push((name, path)),
        }
    }
    named
}

/// The flights of files given by hand, as paths of their own.
pub fn flight_paths(config: &Config, paths: &[PathBuf]) -> Vec<PathBuf> {
    let of = |path: &PathBuf| {
        flights_in(path, "", &config.document.identity).unwrap_or_else(|_| vec![path.clone()])
    };
    paths.iter().flat_map(of).collect()
}

/// Logs to inspect.
#[derive(Debug, Clone, Default)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub struct SelectedLogs {
    /// The logs, each with its name.
    pub logs: Vec<NamedLog>,
    pub faults: Vec<Diagnostic>,
    pub notes: Vec<String>,
}

/// The logs that the named files hold or belong to; without names, about `most` of all logs.
///
/// # Errors
/// As [`discover`].
pub fn select(config: &Config, paths: Option<&[PathBuf]>, most: usize) -> Result<SelectedLogs, Error> {
    if let Some(paths) = paths {
        let named = |path: &PathBuf| Ok((path.display().to_string(), log_containing(config, path)?));
        let logs = flight_paths(config, paths).iter().map(named).collect::<Result<_, Error>>()?;
        return Ok(SelectedLogs { logs, ..SelectedLogs::default() });
    }
    let found = discover(config)?;
    let stray = |file| format!("{file}: no matching main log for this flight; not used");
    let mut notes: Vec<String> = found.strays.into_iter().map(stray).collect();
    let (mut logs, mut faults) = (Vec::<NamedLog>::new(), Vec::new());
    for (name, (files, fault)) in found.logs {
        fault.map_or_else(|| logs.push((name, files)), |fault| faults.push(fault));
    }
    let all = logs.len();
    if all > most {
        logs = sampled(config, logs, most.max(1));
        notes.push(format!("checking {} of {all} logs; use `--limit` to check more", logs.len()));
    }
    Ok(SelectedLogs { logs, faults, notes })
}

/// About `most` of some logs: evenly among all, which are in order of their names, and at least one of each tail.
fn sampled(config: &Config, logs: Vec<NamedLog>, most: usize) -> Vec<NamedLog> {
    /// Of more logs the tails are not read: each takes a read of its footer.
    const IDENTIFIED: usize = 10_000;
    let all = logs.len();
    let tail = |(name, files): &NamedLog| Some(identify(files, None, name, config).ok()?.0.tail_number);
    let tails: Vec<_> = logs.par_iter().map(|log| if all > IDENTIFIED { None } else { tail(log) }).collect();
    let is_even = |k: usize| (k + 1) * most / all > k * most / all;
    let mut seen: BTreeSet<_> = (0..all).filter(|k| is_even(*k)).filter_map(|k| tails[k].clone()).collect();
    let chosen = logs.into_iter().zip(tails).enumerate();
    let chosen = chosen.filter(|(k, (_, tail))| is_even(*k) || tail.clone().is_some_and(|t| seen.insert(t)));
    chosen.map(|(_, (log, _))| log).collect()
}

/// The whole log that a file given by hand belongs to.
///
/// # Errors
/// As [`discover`], where groups or pieces must be searched.
pub(crate) fn log_containing(config: &Config, path: &Path) -> Result<LogFiles, Error> {
    if config.document.group.is_empty() && !config.document.logs.has_pieces() {
        return Ok(LogFiles::one(path));
    }
    let whole = |path: &Path| {
        let (file, rows) = split_path(path, &config.document.identity);
        Some((std::fs::canonicalize(file).ok()?, rows))
    };
    let same =
        |other: &PathBuf| other == path || whole(other).is_some_and(|other| Some(other) == whole(path));
    let found = discover(config)?.logs.into_values().find(|(files, _)| files.all().any(same));
    Ok(found.map_or_else(|| LogFiles::one(path), |(files, _)| files))
}

/// The whole log of a stored record; its first file alone where the search for the others fails.
pub(crate) fn stored_log(config: &Config, log_path: &str) -> LogFiles {
    let path = config.path(log_path);
    log_containing(config, &path).unwrap_or_else(|_| LogFiles::one(path))
}

type FlightIdentity = (Flight, Option<Position>);

/// A file of the main logs, with the flight it belongs to or why that is unknown.
type IdentifiedFile = (Result<FlightIdentity, Diagnostic>, String, PathBuf);

/// Gives pieces that name one flight the identity of its first piece, and puts them in order of departure.
fn join_pieces(known: &mut [IdentifiedFile]) {
    let departure = |file: &IdentifiedFile| file.0.as_ref().ok().map(|(flight, _)| flight.departure_utc);
    known.sort_by(|a, b| departure(a).cmp(&departure(b)).then_with(|| a.1.cmp(&b.1)));
    // The first piece of each flight, and when the latest one departed.
    let mut flights: HashMap<(TailNumber, FlightId, Option<Position>), (FlightIdentity, Timestamp)> =
        HashMap::new();
    for who in known.iter_mut().filter_map(|(who, ..)| who.as_mut().ok()) {
        let (flight, position) = &*who;
        let departed = flight.departure_utc;
        let key = (flight.tail_number.clone(), flight.flight_id.clone(), position.clone());
        match flights.get_mut(&key) {
            Some((first, latest)) if departed.duration_since(*latest) <= MAX_BETWEEN_PIECES => {
                *latest = departed;
                *who = first.clone();
            }
            _ => drop(flights.insert(key, (who.clone(), departed))),
        }
    }
}

/// Who the logs are, tail by tail, each with the name that its files go by.
type IdentityIndex = HashMap<TailNumber, Vec<(FlightIdentity, String)>>;

fn group_files(
    config: &Config,
    main: Vec<(String, PathBuf)>,
    companions: Vec<(&str, (String, PathBuf))>,
    found: &mut DiscoveredLogs,
) {
    let mut known: Vec<IdentifiedFile> = main
        .into_par_iter()
        .map(|(log_path, path)| (identify(&LogFiles::one(&path), None, &log_path, config), log_path, path))
        .collect();
    if config.document.logs.has_pieces() {
        join_pieces(&mut known);
    }
    let mut whose = IdentityIndex::new();
    for (who, log_path, path) in known {
        let who = match who {
            Ok(who) => who,
            // Without its companions it would be an error of another kind, which no run would try again.
            Err(diagnostic) if is_passing(&diagnostic.code) => {
                found.logs.insert(log_path, (LogFiles::one(path), Some(diagnostic)));
                continue;
            }
            Err(_) => {
                found.logs.insert(log_path, (LogFiles::one(path), None));
                continue;
            }
        };
        let on_tail = whose.entry(who.0.tail_number.clone()).or_default();
        let is_piece =
            |(other, _): &&(FlightIdentity, String)| config.document.logs.has_pieces() && *other == who;
        match on_tail.iter().find(is_piece).and_then(|(_, first)| found.logs.get_mut(first)) {
            Some((files, _)) => files.main.push(path),
            None => {
                on_tail.push((who, log_path.clone()));
                found.logs.insert(log_path, (LogFiles::one(path), None));
            }
        }
    }
    let identified: Vec<_> = companions
        .into_par_iter()
        .map(|(group, (log_path, path))| {
            (identify(&LogFiles::one(&path), Some(group), &log_path, config), group, log_path, path)
        })
        .collect();
    for (who, group, log_path, path) in identified {
        let attached =
            who.and_then(|who| attach_companion(config, found, &whose, &who, (group, &log_path, &path)));
        if let Err(diagnostic) = attached {
            let diagnostic = diagnostic.in_file(&log_path);
            found.logs.insert(log_path, (LogFiles::one(path), Some(diagnostic)));
        }
    }
}

/// A file of a group goes to every main log of its flight, of its actuator only where it names one.
///
/// # Errors
/// A diagnostic where samples of two actuators, or of two copies, would be taken for one sequence.
fn attach_companion(
    config: &Config,
    found: &mut DiscoveredLogs,
    whose: &IdentityIndex,
    (flight, position): &FlightIdentity,
    (group, name, path): (&str, &str, &Path),
) -> Result<(), Diagnostic> {
    let on_tail = whose.get(&flight.tail_number).map_or(&[][..], Vec::as_slice);
    let is_placed = |other: &Option<Position>| position.is_none() || other.is_none() || position == other;
    let placed = || on_tail.iter().filter(|((_, other), _)| is_placed(other));
    let departs = |main: &Flight| main.departure_utc == flight.departure_utc;
    // A flight number flies again another day: the departure decides, and the number only where none is equal.
    let is_known = placed().any(|((main, _), _)| departs(main));
    let is_near = |main: &Flight| {
        let between = main.departure_utc.duration_since(flight.departure_utc).abs();
        main.flight_id == flight.flight_id && between <= MAX_BETWEEN_PIECES
    };
    let is_own = |main: &Flight| if is_known { departs(main) } else { is_near(main) };
    let mut is_stray = true;
    for ((_, main), first) in placed().filter(|((main, _), _)| is_own(main)) {
        let Some((files, _)) = found.logs.get_mut(first) else { continue };
        if let (Some(position), None) = (position, main) {
            let what =
                format!("this file of group `{group}` is of {position} alone, and {first} names no position");
            return Err(Diagnostic::new("group_ambiguous", what)
                .hint("map `position` for the main logs too, or write the loads of a flight to one file"));
        }
        let of_group = files.groups.entry(group.to_owned()).or_default();
        if let (Some(other), false) = (of_group.first(), config.document.logs.has_pieces()) {
            let other = log_path(config, other);
            let what = format!("another file of group `{group}` belongs to the same flight: {other}");
            let hint = "if they are pieces of one flight, set `logs.pieces = true`; else remove one of them";
            return Err(Diagnostic::new("group_ambiguous", what).hint(hint));
        }
        of_group.push(path.to_owned());
        is_stray = false;
    }
    if is_stray {
        found.strays.push(name.to_owned());
    }
    Ok(())
}

/// A file or object that fits a pattern, with its status where the listing has it; or a path at fault, and why.
type Listed = Result<(PathBuf, Option<FileStat>), TableFault>;

/// Files that fit some patterns, each by its shown name, in order of it.
fn matching(
    config: &Config,
    patterns: &[String],
    found: &mut DiscoveredLogs,
) -> Result<Vec<(String, PathBuf)>, Error> {
    let mut named = BTreeMap::new();
    let (mut silent, mut tables) = (BTreeSet::new(), TableFolders::default());
    // `**` reaches our own results and tables, which are no logs.
    let user_tables: Vec<PathBuf> = config.document.logs.tables().map(|table| config.path(table)).collect();
    let store = config.store();
    let is_ours = |path: &Path| path.starts_with(&store) || user_tables.iter().any(|table| table == path);
    for pattern in patterns {
        let invalid = |e: glob::PatternError| {
            let what = format!("`{pattern}` is not a valid file pattern: {}", e.msg);
            Error::refused(config.at(pattern, Diagnostic::new("bad_pattern", what)))
        };
        let listed = if object_io::is_address(pattern) {
            let address = Address::parse_required(pattern)?;
            let wanted = glob::Pattern::new(address.key()).map_err(invalid)?;
            let objects = discover_remote::matching(&address, &wanted, &mut tables)?;
            let stat = |object: ListEntry| {
                let (size_bytes, file_id) = (object.size_bytes as i64, object.e_tag);
                (object.path, Some(FileStat { size_bytes, modified_utc_ns: object.modified_utc_ns, file_id }))
            };
            objects.into_iter().map(|object| Ok(stat(object))).collect()
        } else {
            local(config, pattern).map_err(invalid)?
        };
        let (mut is_silent, whole) = (true, config.path(pattern));
        for entry in listed {
            let checked = entry.and_then(|(path, stat)| {
                let is_log =
                    !is_ours(&path) && !is_temporary(&path, &whole) && tables.is_log(&path, &whole)?;
                Ok(is_log.then_some((path, stat)))
            });
            is_silent &= matches!(checked, Ok(None));
            match checked {
                Ok(None) => {}
                Ok(Some((path, stat))) => {
                    found.seen.extend(stat.map(|stat| (path.clone(), stat)));
                    named.insert(log_path(config, &path), path);
                }
                Err((path, diagnostic)) => {
                    let shown = log_path(config, &path);
                    let diagnostic = diagnostic.in_file(&shown);
                    found.logs.insert(shown, (LogFiles::one(path), Some(diagnostic)));
                }
            }
        }
        if is_silent {
            silent.insert(pattern.as_str());
        }
    }
    // Silence is a fault: a pattern that fits nothing is more often a moved folder than a day without flights.
    if silent.is_empty() {
        Ok(named.into_iter().collect())
    } else {
        Err(Error::refused(no_log(config, &silent)))
    }
}

fn local(config: &Config, pattern: &str) -> Result<Vec<Listed>, glob::PatternError> {
    let found = local_files::matching(&config.folder, pattern)?;
    let file = |path: PathBuf| match is_file(&path) {
        Ok(is_file) => is_file.then_some(Ok((path, None))),
        Err(e) => Some(Err((path, e))),
    };
    let listed = found.paths.into_iter().filter_map(file).chain(found.faults.into_iter().map(Err));
    let unreadable = |(path, e): (PathBuf, std::io::Error)| {
        let diagnostic = unreadable(&path, &log_path(config, &path), &e);
        (path, Box::new(diagnostic))
    };
    Ok(listed.map(|entry| entry.map_err(unreadable)).collect())
}

/// Whether a path is a file; links that lead nowhere, pipes and devices are errors, files that were deleted meanwhile
/// are none.
fn is_file(path: &Path) -> std::io::Result<bool> {
    match std::fs::metadata(path) {
        Ok(data) if data.is_file() || data.is_dir() => Ok(data.is_file()),
        Ok(_) => Err(std::io::Error::other("it is a pipe, a socket or a device, not a file")),
        Err(e) if e.kind() == std::io::ErrorKind::NotFound && path.symlink_metadata().is_err() => Ok(false),
        Err(e) => Err(e),
    }
}

/// A folder that cannot be listed may hold any number of logs: it is an error and not an empty folder.
fn unreadable(path: &Path, log_path: &str, error: &std::io::Error) -> Diagnostic {
    let (code, kind) =
        if path.is_dir() { ("folder_unreadable", "folder") } else { ("file_unreadable", "file") };
    Diagnostic::new(code, format!("the {kind} {log_path} cannot be listed: {error}"))
        .in_file(log_path)
        .hint("check its owner and mode, or the link; then `freeplay run --retry`")
}

fn no_log(config: &Config, silent: &BTreeSet<&str>) -> Diagnostic {
    let patterns = silent.iter().map(|p| format!("`{p}`")).collect::<Vec<_>>().join(", ");
    let folder = if config.folder.as_os_str().is_empty() { Path::new(".") } else { &config.folder };
    // Other files are passed over, so that a broad pattern may match notes and tables too.
    let others = silent.iter().filter_map(|p| local_files::matching(&config.folder, p).ok());
    let what = match others.flat_map(|found| found.paths).find(|path| path.is_file()) {
        Some(ours) if ours.starts_with(config.store()) => {
            let ours = log_path(config, &ours);
            format!("{patterns} matches `{ours}`, but this is in the store: move the store, or the logs")
        }
        Some(other) => format!("{patterns} matches no Parquet file, but `{}`", log_path(config, &other)),
        None => format!("no log matches {patterns}"),
    };
    let diagnostic = Diagnostic::new("no_log_matched", what).hint(format!(
        "patterns are relative to {}; check that the logs are present and end in `.parquet`",
        folder.display()
    ));
    config.at(silent.first().copied().unwrap_or_default(), diagnostic)
}

/// Whether a pattern of `logs.files` names a file, which is given without links.
pub fn is_log(config: &Config, file: &Path) -> bool {
    // The folder of a bare file name is empty, which no path leads to.
    let folder = config.folder.join(".").canonicalize().unwrap_or_default();
    let file = file.strip_prefix(&folder).unwrap_or(file);
    let names =
        |pattern: &String| glob::Pattern::new(pattern).is_ok_and(|pattern| pattern.matches_path(file));
    config.document.logs.files.iter().any(names)
}

/// The path of a log in records and messages. Bytes that are no text are written as `%ff`, so that each file has a path of
/// its own.
fn log_path(config: &Config, path: &Path) -> String {
    let path = path.strip_prefix(&config.folder).unwrap_or(path);
    let as_text = |chunk: Utf8Chunk<'_>| {
        let others = chunk.invalid().escape_ascii().to_string().replace("\\x", "%");
        chunk.valid().replace('\\', "/") + &others
    };
    path.as_os_str().as_encoded_bytes().utf8_chunks().map(as_text).collect()
}
