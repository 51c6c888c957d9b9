//! Proposes a mapping for `init --from` from a sample of the logs of a folder. A comment on each line says how sure it is.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Component, Path, PathBuf};

use askama::Template;
use ingest::infer::{
    InferredMapping, folder_value, is_piece, path_identity, path_position, path_tail, propose,
};
use ingest::mapping::units::{Dimension, Unit};
use ingest::mapping::{Epoch, IdentityField};
use ingest::{Layout, Role};
use records::Diagnostic;
use records::sanitize::csv_cell;

use crate::commands::context::display_path;
use crate::exit::Failure;
use crate::output::escape;
use crate::table::count;

const MOST_SAMPLES: usize = 60;

/// Maximum number of logs that are searched for tails and positions.
const MOST_LOGS: usize = 5000;

/// Maximum number of channel groups: more kinds of files are tails or days.
const MOST_GROUPS: usize = 6;

/// The configuration that `init` writes without logs.
pub(crate) const TEMPLATE: &str = include_str!("../../../templates/pipeline.toml");

/// Placeholder for the part number, which no log contains.
const PART: &str = "PART-NUMBER";

const INSTALLATIONS_HEAD: &str = "\
# Proposed: one row per tail and position found, each with a placeholder unit.
# Enter the real part and serial numbers and dates: a trend belongs to the unit and follows it to other positions.
# Empty removed_utc: still installed. A date without time is midnight UTC.
tail_number,position,part_number,serial_number,installed_utc,removed_utc
";

/// Logs from which the same mapping is inferred.
struct Variant {
    offer: InferredMapping,
    log: PathBuf,
    logs: usize,
}

impl Variant {
    fn lacks(&self, role: Role) -> bool {
        !self.offer.channels.contains_key(&role)
    }

    fn is_whole(&self) -> bool {
        !Role::NEEDED.iter().any(|role| self.lacks(*role))
    }

    /// The inferred mapping without what differs from log to log, for comparison.
    fn mapped(&self) -> InferredMapping {
        InferredMapping {
            positions: BTreeSet::new(),
            tails: BTreeSet::new(),
            others: Vec::new(),
            motor_wraps_at: None,
            ..self.offer.clone()
        }
    }

    /// Why no proposal covers these logs together with others.
    fn fault(&self) -> String {
        let lacking = Role::NEEDED.iter().filter(|role| self.lacks(**role));
        match lacking.map(|role| role.as_str()).collect::<Vec<_>>().as_slice() {
            [] => "rows are laid out otherwise".to_owned(),
            lacking => format!("no {}", lacking.join(", ")),
        }
    }

    fn tails(&self) -> String {
        self.offer.tails.iter().map(|tail| quoted(tail)).collect::<Vec<_>>().join(", ")
    }

    /// Whether a channel is read otherwise than in the usual logs.
    fn differs(&self, usual: &Self, role: Role) -> bool {
        !self.lacks(role) && self.offer.channel(role) != usual.offer.channel(role)
    }

    /// The value at which a channel starts again.
    fn turn(&self, role: Role) -> Option<String> {
        self.offer.motor_wraps_at.filter(|_| role == Role::Motor).map(|turn| format!("{turn:?}"))
    }

    /// The further columns of a channel as elements of a list, and whether one of them names no unit.
    fn alternatives(&self, role: Role) -> Option<(String, bool)> {
        let [(_, own_unit), others @ ..] = self.offer.channels.get(&role)?.as_slice() else { return None };
        let other = |(column, unit): &(String, Option<Unit>)| {
            let turn = self.turn(role).filter(|_| unit.is_none() || unit == own_unit);
            let turn = turn.map_or_else(String::new, |turn| format!(", wraps_at = {turn}"));
            let unit = unit.or(*own_unit).unwrap_or(usual(role)).as_str();
            format!("{{ column = {}, unit = {unit:?}{turn} }}", quoted(column))
        };
        let texts: Vec<String> = others.iter().map(other).collect();
        let is_guess = others.iter().any(|(_, unit)| unit.is_none());
        (!texts.is_empty()).then(|| (texts.join(", "), is_guess))
    }

    fn add(&mut self, other: Self) {
        self.offer.positions.extend(other.offer.positions);
        self.offer.tails.extend(other.offer.tails);
        self.offer.motor_wraps_at = self.offer.motor_wraps_at.or(other.offer.motor_wraps_at);
        self.logs += other.logs;
    }
}

/// Last word of a file's name, if it has no digit: `loads` of `0413_loads.parquet`.
fn last_word(log: &Path) -> Option<&str> {
    let word = log.file_stem()?.to_str()?.rsplit(|c: char| !c.is_alphanumeric()).next()?;
    (!word.is_empty() && !word.contains(|c: char| c.is_ascii_digit())).then_some(word)
}

/// The first and the last log of each folder, tail and kind of file; every n-th of them if they are too many.
fn sampled(logs: &[PathBuf]) -> Vec<PathBuf> {
    let mut ends: BTreeMap<_, (&PathBuf, &PathBuf)> = BTreeMap::new();
    for log in logs {
        let key = (log.parent(), path_tail(log), last_word(log));
        ends.entry(key).or_insert((log, log)).1 = log;
    }
    let all: BTreeSet<&PathBuf> = ends.into_values().flat_map(|(first, last)| [first, last]).collect();
    all.iter().step_by(all.len().div_ceil(MOST_SAMPLES).max(1)).map(|log| (*log).clone()).collect()
}

/// The different mappings that are inferred from a sample of logs, the most complete and most frequent first.
///
/// # Errors
/// If no log can be read: the error of the first.
fn variants(sample: Vec<PathBuf>) -> Result<Vec<Variant>, Failure> {
    let (mut found, mut failed): (Vec<Variant>, _) = (Vec::new(), None);
    for log in sample {
        let mut offer = match propose(&log) {
            Ok(offer) => offer,
            Err(error) => {
                failed.get_or_insert(error);
                continue;
            }
        };
        if offer.tails.is_empty() {
            offer.tails.extend(tail_of(&log, &offer));
        }
        let one = Variant { offer, log, logs: 1 };
        match found.iter_mut().find(|known| known.mapped() == one.mapped()) {
            Some(known) => known.add(one),
            None => found.push(one),
        }
    }
    found.sort_by_key(|variant| {
        let lacking = Role::NEEDED.iter().filter(|role| variant.lacks(**role)).count();
        (lacking, std::cmp::Reverse(variant.logs))
    });
    match failed {
        Some(error) if found.is_empty() => Err(Failure::Refused(vec![error.diagnostic()])),
        _ => Ok(found),
    }
}

/// Where a path names the kind of file: in the first folder below the given one, or at the end of the file's name.
#[derive(Clone, Copy)]
enum Kind {
    Folder,
    Name,
}

impl Kind {
    fn of(self, folder: &Path, log: &Path) -> Option<String> {
        let name = match self {
            Self::Folder => {
                log.strip_prefix(folder).ok()?.parent()?.components().next()?.as_os_str().to_str()?
            }
            Self::Name => last_word(log)?,
        };
        Some(name.to_owned())
    }

    /// Pattern of the files of a kind, relative to the folder of all logs.
    fn pattern(self, kind: &str) -> String {
        match self {
            Self::Folder => format!("{kind}/**/*.parquet"),
            Self::Name => format!("**/*{kind}.parquet"),
        }
    }
}

/// Files that hold some channels of a flight.
struct Group {
    offer: InferredMapping,
    /// Pattern of its files, relative to the folder of all logs.
    files: String,
    roles: Vec<Role>,
}

/// The mapping of the logs below a folder, and of the files of other kinds that belong to them.
pub(crate) struct Proposal {
    logs: usize,
    folders: usize,
    looked_at: usize,
    main: Variant,
    /// Pattern of the main logs, relative to the folder of all logs.
    files: String,
    groups: BTreeMap<String, Group>,
    overrides: Vec<Variant>,
    uncovered: Vec<Variant>,
}

impl Proposal {
    pub(crate) fn of(folder: &Path, logs: &[PathBuf]) -> Result<Self, Failure> {
        let found = variants(sampled(logs))?;
        let looked_at = found.iter().map(|variant| variant.logs).sum();
        let folders = logs.iter().map(|log| log.parent()).collect::<BTreeSet<_>>().len();
        let kinds = [Kind::Folder, Kind::Name];
        let grouped =
            kinds.iter().filter(|_| !found[0].is_whole()).find_map(|kind| group(folder, &found, *kind));
        let mut rest = found.into_iter();
        let (main, files, groups) = match (grouped, rest.next()) {
            (Some(grouped), _) => {
                // Each kind of file is a group, or the main log.
                rest = Vec::new().into_iter();
                grouped
            }
            (None, Some(main)) => (main, "**/*.parquet".to_owned(), BTreeMap::new()),
            (None, None) => return Err(Failure::usage("no_log_matched", "no log", "")),
        };
        let (overrides, uncovered) = (Vec::new(), Vec::new());
        let mut proposal =
            Self { logs: logs.len(), folders, looked_at, main, files, groups, overrides, uncovered };
        rest.for_each(|variant| proposal.add(variant));
        Ok(proposal)
    }

    /// Covers another layout: by an override if only other tails have it, else by alternatives of the channels.
    fn add(&mut self, variant: Variant) {
        let (main, tails) = (&mut self.main, &variant.offer.tails);
        if !variant.is_whole() || variant.offer.layout != main.offer.layout {
            self.uncovered.push(variant);
            return;
        }
        let is_taken = |other: &Variant| !other.offer.tails.is_disjoint(tails);
        let has_own_tails = !tails.is_empty() && !is_taken(main) && !self.overrides.iter().any(is_taken);
        unite(&mut main.offer, &variant.offer);
        if has_own_tails {
            self.overrides.push(variant);
            return;
        }
        for (role, own) in &variant.offer.channels {
            let known = main.offer.channels.entry(*role).or_default();
            known.extend(own.first().filter(|column| !known.contains(column)).cloned());
        }
        main.add(variant);
    }

    /// How many folders and logs the patterns match, and how many of them were looked at.
    pub(crate) fn coverage(&self) -> String {
        let uncovered = self.uncovered.iter().map(|variant| variant.logs).sum::<usize>();
        let covered = if self.main.is_whole() { self.looked_at - uncovered } else { 0 };
        let looked = count(self.looked_at, "log");
        let (folders, logs) = (count(self.folders, "folder"), count(self.logs, "log"));
        format!("{folders}, {logs} matched; {looked} looked at, of which the proposal reads {covered}")
    }

    /// Installations table with a placeholder unit per tail and position, if the logs name both.
    pub(crate) fn installations(&self, logs: &[PathBuf]) -> String {
        let offer = &self.main.offer;
        let has_own = offer.metadata.contains_key(&IdentityField::TailNumber);
        let mut places: BTreeSet<(String, String)> = BTreeSet::new();
        for variant in self.overrides.iter().chain([&self.main]) {
            places.extend(pairs(&variant.offer.tails, &variant.offer.positions));
        }
        let of_overrides: BTreeSet<&String> =
            self.overrides.iter().flat_map(|one| &one.offer.tails).collect();
        for log in logs.iter().take(MOST_LOGS) {
            let own = if has_own { propose(log).ok().map(|own| own.tails) } else { None };
            let mut tails = own.unwrap_or_else(|| tail_of(log, offer).into_iter().collect());
            tails.retain(|tail| !of_overrides.contains(tail));
            let position = folder_of(log, offer, IdentityField::Position)
                .or_else(|| Some(needed_position(log, offer)?.0));
            let positions = position.map_or_else(|| offer.positions.clone(), |own| BTreeSet::from([own]));
            places.extend(pairs(&tails, &positions));
        }
        let is_plain = |name: &str| {
            !name.contains(|c: char| matches!(c, '"' | ',' | '#') || c.is_control()) && csv_cell(name) == name
        };
        places.retain(|(tail, position)| is_plain(tail) && is_plain(position));
        let row = |(tail, position): &(String, String)| {
            format!("{tail},{position},{PART},{tail} {position},1970-01-01,\n")
        };
        format!("{INSTALLATIONS_HEAD}{}", places.iter().map(row).collect::<String>())
    }

    /// Template with the mapping of the logs below a folder, to be verified with `check`.
    pub(crate) fn configuration(&self, folder: &Path, dir: &Path) -> Result<String, Failure> {
        let (offer, log) = (&self.main.offer, &self.main.log);
        let names = |names: Vec<&str>| escape(&names.join(", "));
        let positions = names(offer.positions.iter().map(String::as_str).collect());
        let [has_tail, has_departure] =
            [IdentityField::TailNumber, IdentityField::DepartureUtc].map(|fact| has(offer, fact));
        let is_identified = has_tail && has_departure;
        let position_path = needed_position(log, offer).filter(|_| is_identified);
        let identity_path = if is_identified { None } else { identity_path(log, offer) };
        let lacks_format = identity_path.as_ref().map_or(has_tail, |(_, format)| format.is_none());
        let text = Configuration {
            proposal: self,
            positions: if positions.is_empty() { "none".to_owned() } else { positions },
            position_path: position_path.map(|(_, path)| path),
            identity_path,
            has_tail,
            has_departure,
            lacks_departure: lacks_format && !has_departure,
            others: names(offer.others.iter().take(12).map(String::as_str).collect()),
            folder: relative(folder, dir)?,
        };
        text.render().map_err(|e| Failure::failed(Diagnostic::new("output_failed", e)))
    }

    /// Whether load and screw position are those of a part that only turns.
    fn is_rotary(&self) -> bool {
        let dimension = |role: Role| Some(self.main.offer.channel(role)?.1?.dimension());
        dimension(Role::Load) == Some(Dimension::Torque) && dimension(Role::Screw) == Some(Dimension::Angle)
    }

    fn seen_in(&self, variant: &Variant) -> String {
        let log = escape(&display_path(&variant.log));
        format!("In {} of {} logs looked at, the first of them {log}", variant.logs, self.looked_at)
    }

    /// The group whose files hold a channel.
    fn group_of(&self, role: Role) -> Option<&String> {
        Some(self.groups.iter().find(|(_, group)| group.roles.contains(&role))?.0)
    }
}

/// The part of the template between two texts, or to its end where the second one does not occur.
fn common(from: &str, to: &str) -> &'static str {
    let (_, rest) = TEMPLATE.split_once(from).unwrap_or_default();
    rest.split_once(to).map_or(rest, |(text, _)| text)
}

/// A proposed `pipeline.toml`: the common template with the mapping of some logs, and placeholders of a part without limits,
/// which a run refuses. Keys that could not be inferred are left to fill in.
#[derive(Template)]
#[template(path = "proposal.toml", escape = "none")]
struct Configuration<'p> {
    proposal: &'p Proposal,
    positions: String,
    /// The expression that finds the position in the path, where the path holds nothing else of the identity.
    position_path: Option<String>,
    /// The expression that finds what metadata and columns do not hold, and the format of its departure.
    identity_path: Option<(String, Option<String>)>,
    has_tail: bool,
    has_departure: bool,
    lacks_departure: bool,
    others: String,
    folder: PathBuf,
}

impl Configuration<'_> {
    /// A pattern of files below the folder of the logs.
    fn below(&self, files: &str) -> String {
        quoted(&format!("{}/{files}", display_path(&self.folder)))
    }

    /// Whether the files are pieces, by their names, of flights that the identity knows.
    fn are_pieces(&self) -> bool {
        let main = &self.proposal.main;
        let is_in_path = self.identity_path.as_ref().is_some_and(|(path, _)| path.contains("<flight_id>"));
        is_piece(&main.log) && (is_in_path || has(&main.offer, IdentityField::FlightId))
    }

    /// Sources of the identity other than the path, each with its facts as keys of a table.
    fn identity_sources(&self) -> Vec<(&'static str, String)> {
        let offer = &self.proposal.main.offer;
        let fact = |(fact, name): (&IdentityField, &String)| format!("{} = {}", fact.as_str(), quoted(name));
        let sources =
            [("metadata", &offer.metadata), ("columns", &offer.columns), ("folders", &offer.folders)];
        let given = sources.into_iter().filter(|(_, facts)| !facts.is_empty());
        given.map(|(source, facts)| (source, facts.iter().map(fact).collect::<Vec<_>>().join(", "))).collect()
    }
}

const CHANNELS: [(Role, &str); 4] = [
    (Role::Motor, "motor_position"),
    (Role::Screw, "screw_position"),
    (Role::Load, "load"),
    (Role::Temperature, "temperature"),
];

fn usual(role: Role) -> Unit {
    let units = [(Role::Motor, Unit::Degree), (Role::Screw, Unit::Millimetre), (Role::Load, Unit::Newton)];
    units.iter().find(|(of, _)| *of == role).map_or(Unit::Celsius, |(_, unit)| *unit)
}

/// Main log and groups, if each kind of file has only some of the channels.
fn group(folder: &Path, found: &[Variant], kind: Kind) -> Option<(Variant, String, BTreeMap<String, Group>)> {
    let mut kinds: BTreeMap<String, &Variant> = BTreeMap::new();
    for variant in found {
        kinds.entry(kind.of(folder, &variant.log)?).or_insert(variant);
    }
    let holder = |role: Role| kinds.iter().find(|(_, variant)| !variant.lacks(role));
    let is_grouped =
        (2..=MOST_GROUPS).contains(&kinds.len()) && Role::NEEDED.iter().all(|role| holder(*role).is_some());
    let (name, motor) = holder(Role::Motor).filter(|_| is_grouped)?;
    let mut main = Variant { offer: motor.offer.clone(), log: motor.log.clone(), logs: motor.logs };
    let mut groups: BTreeMap<String, Group> = BTreeMap::new();
    for role in Role::ALL.into_iter().filter(|role| motor.lacks(*role)) {
        let Some((name, variant)) = holder(role) else { continue };
        let of_kind = || Group { offer: variant.offer.clone(), files: kind.pattern(name), roles: Vec::new() };
        groups.entry(name.clone()).or_insert_with(of_kind).roles.push(role);
        main.offer.channels.insert(role, variant.offer.channels[&role].clone());
    }
    Some((main, kind.pattern(name), groups))
}

/// Adds the sources of a flight's identity that only other logs have.
fn unite(offer: &mut InferredMapping, other: &InferredMapping) {
    let sources = [
        (&mut offer.metadata, &other.metadata),
        (&mut offer.columns, &other.columns),
        (&mut offer.folders, &other.folders),
    ];
    for (own, others) in sources {
        for (fact, name) in others {
            own.entry(*fact).or_insert_with(|| name.clone());
        }
    }
    offer.by_row |= other.by_row;
}

fn pairs(tails: &BTreeSet<String>, positions: &BTreeSet<String>) -> Vec<(String, String)> {
    tails.iter().flat_map(|tail| positions.iter().map(|own| (tail.clone(), own.clone()))).collect()
}

/// The tail that the path of a log names.
fn tail_of(log: &Path, offer: &InferredMapping) -> Option<String> {
    folder_of(log, offer, IdentityField::TailNumber).or_else(|| path_tail(log))
}

/// The value of the folder `name=value` that holds a field of the identity.
fn folder_of(log: &Path, offer: &InferredMapping, fact: IdentityField) -> Option<String> {
    folder_value(log, offer.folders.get(&fact)?)
}

/// Path of a folder relative to another one; an absolute path stays absolute.
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

/// The keys of a layout that have a column.
fn layout_keys(layout: &Layout) -> impl Iterator<Item = (&'static str, &String)> {
    let keys = [
        ("name_column", &layout.name_column),
        ("value_column", &layout.value_column),
        ("position_column", &layout.position_column),
    ];
    keys.into_iter().filter_map(|(key, column)| Some((key, column.as_ref()?)))
}

/// Whether neither columns nor folders name the position of a log.
fn needs_position(offer: &InferredMapping) -> bool {
    offer.positions.is_empty()
        && !offer.folders.contains_key(&IdentityField::Position)
        && offer.layout.position_column.is_none()
}

/// The position that only the path of a log names, and the expression that finds it.
fn needed_position(log: &Path, offer: &InferredMapping) -> Option<(String, String)> {
    if needs_position(offer) { path_position(log) } else { None }
}

/// Whether metadata, columns or folders hold a fact of the identity.
fn has(offer: &InferredMapping, fact: IdentityField) -> bool {
    [&offer.metadata, &offer.columns, &offer.folders].iter().any(|facts| facts.contains_key(&fact))
}

/// The expression that finds the rest of the identity in the path of a log, and the format of its departure.
fn identity_path(log: &Path, offer: &InferredMapping) -> Option<(String, Option<String>)> {
    let (mut path, format) = path_identity(log, needs_position(offer))?;
    for fact in [IdentityField::TailNumber, IdentityField::FlightId, IdentityField::DepartureUtc] {
        if has(offer, fact) {
            path = path.replace(&format!("(?<{}>", fact.as_str()), "(?:");
        }
    }
    Some((path, format))
}
