//! Proposes a mapping for `init --from` from a sample of the logs of a folder. A comment on each line says how sure it is.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Component, Path, PathBuf};

use ingest::infer::{InferredMapping, folder_value, path_identity, path_position, path_tail, propose};
use ingest::mapping::units::{Dimension, Unit};
use ingest::mapping::{Epoch, IdentityField};
use ingest::{Layout, Role};
use records::sanitize::csv_cell;

use crate::commands::context::display_path;
use crate::exit::Failure;
use crate::output::escape;
use crate::table::count;

/// Maximum number of logs from which a mapping is inferred.
const MOST_SAMPLES: usize = 60;

/// Maximum number of logs that are searched for tails and positions.
const MOST_LOGS: usize = 5000;

/// Maximum number of channel groups: more kinds of files are tails or days.
const MOST_GROUPS: usize = 6;

/// Placeholder for the part number, which no log contains.
const PART: &str = "PART-NUMBER";

/// Head of a proposed installations table.
const INSTALLATIONS_HEAD: &str = "\
# Proposed: one row per tail and position found, each with a placeholder unit.
# Enter the real part and serial numbers and dates: a trend belongs to the unit and follows it to other positions.
# Empty removed_utc: still installed. A date without time is midnight UTC.
tail_number,position,part_number,serial_number,installed_utc,removed_utc
";

/// Placeholder values of a rotary part; the template has those of a linear part.
const ROTARY_PART: &str = r#"
kind = "rotary"           # loads are torques, and both positions are angles
stiffness_nm_per_rad = 2.0e4
damping_nm_s_per_rad = 1.0
inertia_kg_m2 = 3.0e-3
reference_radius_m = 0.1  # the radius at which the gap is stated
# limit_m and watch_m: removal limit and alert level; without them a unit is not assessed

[part."PART-NUMBER".noise]
screw_rms_rad = 5.0e-5
screw_resolution_rad = 5.0e-5
motor_rms_rad = 5.0e-5    # at the driven side
motor_resolution_rad = 5.0e-5
unknown_torque_nm = 5.0   # mainly friction; about 2 % of the rated torque
bandwidth_hz = 10.0       # bandwidth of the backlash random walk

"#;

/// Logs from which the same mapping is inferred.
struct Variant {
    offer: InferredMapping,
    /// The first of these logs.
    log: PathBuf,
    /// Number of these logs in the sample.
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
    /// The usual layout.
    main: Variant,
    /// Pattern of the main logs, relative to the folder of all logs.
    files: String,
    groups: BTreeMap<String, Group>,
    /// Layouts of single tails.
    overrides: Vec<Variant>,
    /// Layouts that the proposal does not cover.
    uncovered: Vec<Variant>,
}

impl Proposal {
    /// Looks at a sample of the logs.
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
        let covered = self.looked_at - self.uncovered.iter().map(|variant| variant.logs).sum::<usize>();
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
    pub(crate) fn configuration(&self, template: &str, folder: &Path, dir: &Path) -> Result<String, Failure> {
        let (head, rest) = template.split_once("# Which flight a log is.").unwrap_or((template, ""));
        let (_, rest) = rest.split_once("[estimate]").unwrap_or(("", rest));
        let (estimate, rest) = rest.split_once("# One table per part number").unwrap_or((rest, ""));
        let (part, trend) = rest.split_once("[trend]").unwrap_or(("", rest));
        let folder = relative(folder, dir)?;
        let below = |files: &str| quoted(&format!("{}/{files}", display_path(&folder)));
        let files = format!("# {}.\nfiles = [{}]", self.coverage(), below(&self.files));
        let mut head = head.replace("files = [\"logs/**/*.parquet\"]", &files);
        for (kind, group) in &self.groups {
            let kind = key(kind);
            let _ = write!(head, "[group.{kind}]\nfiles = [{}]\n\n", below(&group.files));
            if group.offer.clock != self.main.offer.clock {
                let _ = write!(head, "[group.{kind}.clock]\n{}\n", clock(&group.offer));
            }
            if group.offer.layout != Layout::default() {
                let _ = write!(head, "[group.{kind}.layout]\n{}\n", layout(&group.offer.layout));
            }
        }
        let overrides: String = self.overrides.iter().map(|variant| self.of_tails(variant)).collect();
        let part = self.part(part);
        Ok(format!("{head}{}{overrides}[estimate]{estimate}{part}[trend]{trend}", self.mapping()))
    }

    /// Placeholders of a part, without limits: a run refuses them.
    fn part(&self, of_template: &str) -> String {
        let dimension = |role: Role| Some(self.main.offer.channel(role)?.1?.dimension());
        let is_rotary = dimension(Role::Load) == Some(Dimension::Torque)
            && dimension(Role::Screw) == Some(Dimension::Angle);
        let (_, linear) = of_template.split_once("[part.\"EMA-27-1040\"]").unwrap_or(("", of_template));
        let linear = linear.replace("EMA-27-1040", PART);
        let linear = linear.replace("\nlimit_m", "\n# limit_m").replace("\nwatch_m", "\n# watch_m");
        format!(
            "# One table per part number in installations.csv. These values are placeholders, and `freeplay run` refuses them:\n\
             # enter part number and data sheet, then delete the line `placeholder`. `freeplay check` on ten logs or more\n\
             # prints what it identifies.\n[part.\"{PART}\"]\nplaceholder = true{}",
            if is_rotary { ROTARY_PART } else { &linear }
        )
    }

    /// Override for tails whose logs differ from the main ones.
    fn of_tails(&self, variant: &Variant) -> String {
        let tails: Vec<String> = variant.offer.tails.iter().map(|tail| quoted(tail)).collect();
        let mut text =
            format!("# {}.\n[[override]]\ntails = [{}]\n", self.seen_in(variant), tails.join(", "));
        let (own, usual) = (&variant.offer, &self.main.offer);
        let differs =
            |role: &Role| own.channels.contains_key(role) && own.channel(*role) != usual.channel(*role);
        for (role, name) in CHANNELS.iter().filter(|(role, _)| differs(role)) {
            let _ = write!(text, "[override.channel.{name}]\n{}", self.channel(variant, *role));
        }
        if (&own.clock, own.epoch) != (&usual.clock, usual.epoch) {
            let none = if own.epoch == Epoch::None { "epoch = \"none\"\n" } else { "" };
            let _ = write!(text, "[override.clock]\n{}{none}", clock(own));
        }
        text + "\n"
    }

    fn seen_in(&self, variant: &Variant) -> String {
        let log = escape(&display_path(&variant.log));
        format!("In {} of {} logs looked at, the first of them {log}", variant.logs, self.looked_at)
    }

    /// Inferred part of the configuration; keys that could not be inferred are left to fill in.
    fn mapping(&self) -> String {
        let offer = &self.main.offer;
        let positions: Vec<&str> = offer.positions.iter().map(String::as_str).collect();
        let positions = if positions.is_empty() { "none".to_owned() } else { escape(&positions.join(", ")) };
        let others: Vec<&str> = offer.others.iter().take(12).map(String::as_str).collect();
        let has = |role: &Role| Role::NEEDED.contains(role) || offer.channels.contains_key(role);
        let mut channels = String::new();
        for (role, name) in CHANNELS.iter().filter(|(role, _)| has(role)) {
            let _ = write!(channels, "\n[channel.{name}]\n{}", self.channel(&self.main, *role));
        }
        let rows = if offer.layout == Layout::default() {
            String::new()
        } else {
            format!("\n[layout]\n{}", layout(&offer.layout))
        };
        let uncovered = self.uncovered.iter().map(|variant| {
            let lacking = Role::NEEDED.iter().filter(|role| variant.lacks(**role));
            let lacking: Vec<&str> = lacking.map(|role| role.as_str()).collect();
            let why = if lacking.is_empty() {
                "rows are laid out otherwise".to_owned()
            } else {
                format!("no {}", lacking.join(", "))
            };
            format!("# Not covered: {why}. {}.\n", self.seen_in(variant))
        });
        [
            format!(
                "# Inferred: verify names, units and signs with `freeplay check`. Each line says how sure it is, and why.\n\
                 # {}.\n",
                self.seen_in(&self.main)
            ),
            uncovered.collect(),
            format!("# Positions found: {positions}.\n\n[identity]\n{}", identity(offer, &self.main.log)),
            "# Time zone of departures without one.\ntime_zone = \"UTC\"   # low: a guess\n".to_owned(),
            rows,
            format!("\n[clock]\n{}", clock(offer)),
            channels,
            if others.is_empty() {
                "\n".to_owned()
            } else {
                format!("\n# Unmapped numeric columns: {}\n\n", escape(&others.join(", ")))
            },
        ]
        .concat()
    }

    fn channel(&self, variant: &Variant, role: Role) -> String {
        let (offer, usual) = (&variant.offer, usual(role).as_str());
        let seen = format!("in {} of {} logs looked at", variant.logs, self.looked_at);
        let mut text = match offer.channel(role) {
            Some((column, unit)) => {
                let (unit, sure) = match unit {
                    Some(unit) => (unit.as_str(), "high: the log names it"),
                    None => (usual, "low: a guess, the log names no unit"),
                };
                format!("column = {}   # high: {seen}\nunit = {unit:?}   # {sure}\n", quoted(column))
            }
            None => format!("column = \"\"           # no column was recognised\nunit = {usual:?}\n"),
        };
        let group = self.groups.iter().find(|(_, group)| group.roles.contains(&role));
        if let Some((name, _)) = group {
            let _ = writeln!(text, "group = {}", quoted(name));
        }
        let turn = offer.motor_wraps_at.filter(|_| role == Role::Motor);
        if let Some(turn) = turn {
            let _ = writeln!(text, "wraps_at = {turn:?}   # high: it leaps by more than half a turn");
        }
        let own_unit = offer.channel(role).and_then(|(_, unit)| *unit);
        let other = |(column, unit): &(String, Option<Unit>)| {
            let is_alike = unit.is_none() || *unit == own_unit;
            let unit = unit.or(own_unit).map_or(usual, |unit| unit.as_str());
            let wraps =
                turn.filter(|_| is_alike).map_or_else(String::new, |turn| format!(", wraps_at = {turn:?}"));
            format!("{{ column = {}, unit = {unit:?}{wraps} }}", quoted(column))
        };
        if let Some([_, others @ ..]) = offer.channels.get(&role).map(Vec::as_slice)
            && !others.is_empty()
        {
            let is_guess = others.iter().any(|(_, unit)| unit.is_none());
            let sure =
                if is_guess { "   # low: a column that names no unit may have another one" } else { "" };
            let others: Vec<String> = others.iter().map(other).collect();
            let _ = writeln!(text, "alternatives = [{}]{sure}", others.join(", "));
        }
        text
    }
}

/// Channels by the names of their tables.
const CHANNELS: [(Role, &str); 4] = [
    (Role::Motor, "motor_position"),
    (Role::Screw, "screw_position"),
    (Role::Load, "load"),
    (Role::Temperature, "temperature"),
];

/// The usual unit of a channel.
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

/// Every pair of a tail and a position.
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

/// The position that only the path of a log names, and the expression that finds it.
fn needed_position(log: &Path, offer: &InferredMapping) -> Option<(String, String)> {
    if needs_position(offer) { path_position(log) } else { None }
}

/// Comment of a proposal whose departures only the clock can give.
const NO_DEPARTURE: &str = "# No departure was found: it is the first timestamp if the clock has a date.\n";

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
        if offer.by_row {
            "by_row = true   # high: rows of one file name several flights\n".to_owned()
        } else {
            String::new()
        },
    ]
    .concat();
    let has = |fact| {
        [&offer.metadata, &offer.columns, &offer.folders].iter().any(|facts| facts.contains_key(&fact))
    };
    if has(IdentityField::TailNumber) && has(IdentityField::DepartureUtc) {
        if let Some((_, path)) = needed_position(log, offer) {
            let _ = writeln!(text, "# The position is inferred from the path.\npath = '{path}'");
        }
        return text;
    }
    match path_identity(log, needs_position(offer)) {
        Some((mut path, format)) => {
            text.push_str(
                "# Not all of the identity is in metadata or columns; the rest is inferred from the path.\n",
            );
            for fact in
                [IdentityField::TailNumber, IdentityField::DepartureUtc].into_iter().filter(|fact| has(*fact))
            {
                path = path.replace(&format!("(?<{}>", fact.as_str()), "(?:");
            }
            let _ = writeln!(text, "path = '{path}'   # medium: the form of {}", escape(&display_path(log)));
            if !has(IdentityField::TailNumber) && !path.contains("<tail_number>") {
                text.push_str("# TODO: no tail was found: set it in `path`, `folders` or `columns`.\n");
            }
            match format {
                _ if has(IdentityField::DepartureUtc) => {}
                Some(format) => drop(writeln!(text, "departure_format = {format:?}")),
                None => text.push_str(NO_DEPARTURE),
            }
        }
        None if has(IdentityField::TailNumber) => {
            text.push_str(NO_DEPARTURE);
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
    let epoch = match offer.epoch {
        Epoch::Unix => "epoch = \"unix\"   # high: its values lie between 1990 and 2100\n",
        Epoch::Midnight => "epoch = \"midnight\"   # medium: its name, and values below a day\n",
        Epoch::Excel => {
            "epoch = \"excel\"   # high: as days since 1899, its values lie between 1990 and 2100\n"
        }
        Epoch::None => "",
    };
    match &offer.clock {
        Some((column, Some(unit))) => format!(
            "column = {}\nunit = {}   # medium: by its name or its steps\n{epoch}",
            quoted(column),
            quoted(unit)
        ),
        Some((column, None)) => {
            let column = quoted(column);
            format!(
                "column = {column}\n# unit = \"s\"          # s, ms, us, ns; not needed for timestamps\n{epoch}"
            )
        }
        None => "# No time column was recognised: name it, or delete `column` and give `rate_hz`.\ncolumn = \"\"\nunit = \"s\"\n".to_owned(),
    }
}
