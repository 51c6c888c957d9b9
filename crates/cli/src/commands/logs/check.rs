//! `check`: shows how logs are mapped, channel by channel, and what would be refused; reports no gap, writes nothing.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::sync::Arc;

use ingest::channel::quality;
use ingest::{ActuatorChannels, ActuatorColumns, LogFiles, Quality};
use job::flight_log::{FlightLog, duplicate_flight, may_be_pieces, pieces_undeclared, sample_digest};
use job::{Config, estimate, rejection};
use pipeline::run::discover;
use pipeline::time_limit::within_time_limit;
use records::uncertainty::NORMAL_95;
use records::{Diagnostic, Installations, PartNumber};

use crate::args::{CheckArgs, Format, Global};
use crate::exit::{Code, Failure};
use crate::output::{Output, escape};
use crate::row_output;
use crate::table::{self, number, text};

use crate::commands::context::{display_path, load_with_installations};

/// Tolerance of the slope of screw on motor around 1; beyond it the mapping is suspect.
const SLOPE_TOLERANCE: f64 = 0.02;

/// Usual logging rates; a rate outside mostly means a wrong unit of time.
const USUAL_RATES_HZ: std::ops::RangeInclusive<f64> = 1.0..=20e3;

/// Note on the slope of screw on motor.
const RATIO: &str = "screw/motor ratio";

/// More logs than these are summarised, one line each.
const MOST_WHOLE_LOGS: usize = 3;

/// Why page checksums matter, and how to write them.
const NO_CHECKSUMS: &str = "silent corruption would not be detected (`write_page_checksum=True` in pyarrow)";

/// Replaces the channel table if no actuator could be checked.
const NOTHING: &str = "  no actuator could be checked; see errors above\n";

/// Checks logs and prints what was found.
///
/// # Errors
/// If configuration or tables are wrong. Failed logs make the exit code 1.
pub(crate) fn check(args: &CheckArgs, global: &Global, output: &Output) -> Result<Code, Failure> {
    let (config, installations) = load_with_installations(global)?;
    let (logs, faults) = logs(args, &config, output)?;
    let count = logs.len();
    let (config, installations) = (Arc::new(config), Arc::new(installations));
    let (mut seen, mut schemas) = (CheckSummary::default(), ColumnTypes::default());
    let mut flights = FlightOwners::default();
    seen.diagnostics.extend(faults);
    for (files, name) in logs {
        let (of_log, installed, shown) = (Arc::clone(&config), Arc::clone(&installations), name.clone());
        let own_files = files.clone();
        let looked = within_time_limit(&name, &config, move || {
            let opened = FlightLog::open(&files, &shown, &of_log, &installed)?;
            let keys = flight_keys(&opened, &installed);
            let digest = opened.digest.clone();
            Ok((opened.column_types(), one(&opened, &shown, &of_log, &installed), keys, digest))
        });
        match looked {
            Ok((types, found, keys, digest)) => {
                schemas.enter(&name, &types);
                seen.extend(found);
                let log = CheckedLog { files: own_files, name, digest };
                seen.diagnostics.extend(flights.enter(log, keys, &config, &installations));
            }
            Err(diagnostic) => seen.diagnostics.push(diagnostic),
        }
    }
    if config.document.logs.pieces.is_none() {
        seen.diagnostics.extend(flights.undeclared_pieces());
    }
    let CheckSummary { channels, facts, rejections, mut diagnostics, page, overview } = seen;
    let failed = diagnostics.len();
    diagnostics.extend(mapping_faults(&rejections));
    let is_short = count > MOST_WHOLE_LOGS && args.rows.output.is_none() && !output.is_verbose();
    let page = if is_short { overview.page(&channels) } else { page };
    let table = || {
        format!(
            "{page}{}{}{}",
            schemas.drift(),
            proposals(&facts, &config),
            summary(count, &channels, &diagnostics[..failed])
        )
    };
    if args.rows.format() == Format::Table && args.rows.output.is_none() {
        output.write_result(&table())?;
    } else {
        row_output::write_rows(&args.rows, output, || row_output::batch(&channels), table)?;
    }
    output.diagnostics(&diagnostics);
    Ok(if diagnostics.is_empty() { Code::Success } else { Code::LogsInError })
}

type NamedLogs = Vec<(LogFiles, String)>;

/// The logs to be checked, and the faults of what cannot be listed.
fn logs(args: &CheckArgs, config: &Config, output: &Output) -> Result<(NamedLogs, Vec<Diagnostic>), Failure> {
    if !args.logs.is_empty() {
        let whole =
            |path: &std::path::PathBuf| Ok((discover::log_containing(config, path)?, display_path(path)));
        return Ok((args.logs.iter().map(whole).collect::<Result<_, Failure>>()?, Vec::new()));
    }
    let found = discover::discover(config)?;
    for stray in &found.strays {
        output.note(&format!("{stray}: no matching main log for this flight; not used"));
    }
    let faults = found.faulty.into_values().map(|(_, diagnostic)| diagnostic).collect();
    let mut logs: Vec<_> = found.logs.into_iter().map(|(name, files)| (files, name)).collect();
    if logs.len() > args.limit {
        output.note(&format!("checking {} of {} logs; use `--limit` to check more", args.limit, logs.len()));
        logs.truncate(args.limit);
    }
    Ok((logs, faults))
}

/// Departure, tail, flight and position: what one log holds, no other may.
type FlightKey = (jiff::Timestamp, String, String, String);

fn flight_keys(opened: &FlightLog, installations: &Installations) -> Vec<FlightKey> {
    let id = &opened.identity;
    let key = |at: &ActuatorColumns| {
        (id.departure_utc, id.tail_number.to_string(), id.flight_id.to_string(), at.position.to_string())
    };
    opened.actuators(installations).map(key).collect()
}

/// A log that was opened.
struct CheckedLog {
    files: LogFiles,
    name: String,
    digest: String,
}

/// The log of each flight and position: another log of the same flight is an error in a run, too.
#[derive(Default)]
struct FlightOwners {
    owners: BTreeMap<FlightKey, usize>,
    logs: Vec<CheckedLog>,
}

impl FlightOwners {
    /// Enters a log; an error where another log holds its flight with other samples.
    fn enter(
        &mut self,
        log: CheckedLog,
        keys: Vec<FlightKey>,
        config: &Config,
        installations: &Installations,
    ) -> Option<Diagnostic> {
        let own = self.logs.len();
        let owners = keys.into_iter().map(|key| *self.owners.entry(key).or_insert(own));
        let other = owners.filter(|owner| *owner != own).min();
        let first = other.map(|other| &self.logs[other]).filter(|first| first.digest != log.digest);
        let samples = |log: &CheckedLog| sample_digest(&log.files, &log.name, config, installations).ok();
        let fault = first.and_then(|first| {
            let is_copy = samples(first).is_some_and(|digest| samples(&log) == Some(digest));
            (!is_copy).then(|| duplicate_flight(&log.name, &first.name))
        });
        self.logs.push(log);
        fault
    }

    /// An error for each log with the tail, flight id and position of another, and another departure close by.
    fn undeclared_pieces(&self) -> Vec<Diagnostic> {
        let mut same_id: BTreeMap<_, Vec<(jiff::Timestamp, usize)>> = BTreeMap::new();
        for ((departure, tail, flight, position), log) in &self.owners {
            same_id.entry((tail, flight, position)).or_default().push((*departure, *log));
        }
        let mut found = BTreeMap::new();
        for logs in same_id.values() {
            for (departure, log) in logs {
                let others = logs.iter().filter(|(other, _)| may_be_pieces(*departure, *other));
                if let Some((other_departure, other)) =
                    others.min_by_key(|(_, other)| &self.logs[*other].name)
                {
                    let (name, other) = (&self.logs[*log].name, &self.logs[*other].name);
                    let fault = || pieces_undeclared(name, *departure, other, *other_departure);
                    found.entry(*log).or_insert_with(fault);
                }
            }
        }
        found.into_values().collect()
    }
}

/// One line for each log, and each note once.
#[derive(Default)]
struct Overview {
    lines: Vec<Vec<String>>,
    without_checksums: usize,
}

impl Overview {
    fn page(&self, channels: &[Channel]) -> String {
        let columns = [
            text("log", 0),
            text("tail", 3),
            text("flight", 2),
            text("departed", 4),
            number("rows", 5),
            text("clock", 0),
            number("actuators", 0),
            number("notes", 1),
        ];
        let mut page = table::layout(&columns, &self.lines);
        // Ratios differ from log to log, and mean the same.
        let kind = |channel: &Channel| {
            let note = channel.note.as_deref().unwrap_or_default();
            if note.starts_with(RATIO) {
                format!("{RATIO} differs from 1: check sign, unit, lead or gear ratio")
            } else {
                note_of(channel)
            }
        };
        let mut notes: BTreeMap<(&str, String), (usize, &Channel)> = BTreeMap::new();
        for channel in channels.iter().filter(|channel| is_warning(channel)) {
            notes.entry((channel.channel, kind(channel))).or_insert((0, channel)).0 += 1;
        }
        for ((channel, note), (count, first)) in notes {
            let note = format!("{count} × {channel}: {note} (first {}, {})", first.log, first.position);
            let _ = writeln!(page, "{}", escape(&note));
        }
        if self.without_checksums > 0 {
            let logs = table::count(self.without_checksums, "log");
            let _ = writeln!(page, "{logs} without page checksums: {NO_CHECKSUMS}");
        }
        page.push_str("channels of each log: -v, --json, or name at most three logs\n\n");
        page
    }
}

/// The note of a channel, with its remedy.
fn note_of(channel: &Channel) -> String {
    channel.note.iter().map(String::as_str).chain(channel.remedy).collect::<Vec<_>>().join(": ")
}

records::row! {
    /// One channel of one actuator of one log.
    #[derive(Debug)]
    struct Channel {
        log: String,
        tail_number: String,
        flight_id: String,
        position: String,
        serial_number: Option<String>,
        channel: &'static str,
        column: String,
        unit: &'static str,
        samples: i64,
        missing_share: Option<f64>,
        min: Option<f64>,
        max: Option<f64>,
        resolution: Option<f64>,
        rate_hz: Option<f64>,
        frozen_share: Option<f64>,
        saturated_share: Option<f64>,
        spikes: Option<i64>,
        note: Option<String>,
        /// What to do about a rejection.
        remedy: Option<&'static str>,
    }
}

/// Findings of one log, or of all logs so far.
#[derive(Default)]
struct CheckSummary {
    channels: Vec<Channel>,
    facts: Facts,
    rejections: Rejections,
    diagnostics: Vec<Diagnostic>,
    page: String,
    overview: Overview,
}

impl CheckSummary {
    fn extend(&mut self, log: Self) {
        self.channels.extend(log.channels);
        self.diagnostics.extend(log.diagnostics);
        self.page.push_str(&log.page);
        self.overview.lines.extend(log.overview.lines);
        self.overview.without_checksums += log.overview.without_checksums;
        for (part, found) in log.facts {
            self.facts.entry(part).or_default().extend(found);
        }
        for (part, found) in log.rejections {
            self.rejections.entry(part).or_default().extend(found);
        }
    }
}

/// Identified parameters by part number.
type Facts = BTreeMap<PartNumber, Vec<job::part_identification::IdentifiedParams>>;

/// Rejection codes of the checked actuator-flights by part number; `None` for an accepted one.
type Rejections = BTreeMap<PartNumber, Vec<Option<&'static str>>>;

/// One error for each part number most of whose actuator-flights would be refused for a wrong mapping.
fn mapping_faults(rejections: &Rejections) -> Vec<Diagnostic> {
    let fault = |(part, codes): (&PartNumber, &Vec<Option<&'static str>>)| {
        let (code, refused) = rejection::majority(codes)?;
        let remedy = rejection::part_remedy(code)?;
        let flights = table::count(codes.len(), "checked actuator-flight");
        let what = format!("part {part}: {refused} of {flights} would be refused");
        Some(Diagnostic::new(code, what).hint(remedy))
    };
    rejections.iter().filter_map(fault).collect()
}

/// Findings of one actuator.
struct ActuatorCheck {
    found: Vec<Channel>,
    clock: Option<String>,
    says: Option<(PartNumber, job::part_identification::IdentifiedParams)>,
    rejection: Option<&'static str>,
}

fn one(opened: &FlightLog, name: &str, config: &Config, installations: &Installations) -> CheckSummary {
    let id = &opened.identity;
    let mut seen = CheckSummary::default();
    let CheckSummary { channels, facts, rejections, diagnostics, page, overview } = &mut seen;
    let mut clocks = Vec::new();
    for at in opened.actuators(installations) {
        match actuator(opened, name, at, config, installations) {
            Ok(ActuatorCheck { found, clock, says, rejection }) => {
                channels.extend(found);
                clocks.extend(clock);
                if let Some((part, says)) = says {
                    rejections.entry(part.clone()).or_default().push(rejection);
                    facts.entry(part).or_default().push(says);
                }
            }
            // A fault of the whole log is reported for each of its actuators.
            Err(diagnostic) => {
                let diagnostic = diagnostic.in_file(name);
                if !diagnostics.contains(&diagnostic) {
                    diagnostics.push(diagnostic);
                }
            }
        }
    }
    clocks.dedup();
    let checksums = match opened.is_checked() {
        Ok(true) => "all pages have checksums".to_owned(),
        Ok(false) => {
            overview.without_checksums += 1;
            format!("no page checksums: {NO_CHECKSUMS}")
        }
        Err(_) => "page headers cannot be read".to_owned(),
    };
    let positions: BTreeSet<&str> = channels.iter().map(|channel| channel.position.as_str()).collect();
    let notes = channels.iter().filter(|channel| is_warning(channel)).count();
    overview.lines.push(vec![
        name.to_owned(),
        id.tail_number.to_string(),
        id.flight_id.to_string(),
        id.departure_utc.to_string(),
        opened.rows().to_string(),
        clocks.first().cloned().unwrap_or_default(),
        positions.len().to_string(),
        notes.to_string(),
    ]);
    let clocks = if clocks.is_empty() { String::new() } else { format!(", {}", clocks.join("; ")) };
    let flight = format!("{} flight {} departed {}", id.tail_number, id.flight_id, id.departure_utc);
    let _ = writeln!(
        page,
        "{}\n  {}\n  {} rows{clocks}\n  {checksums}",
        escape(name),
        escape(&flight),
        opened.rows(),
    );
    page.push_str(&if channels.is_empty() { NOTHING.to_owned() } else { layout(channels) });
    page.push('\n');
    seen
}

/// Time base of an actuator as text.
fn clock(a: &ActuatorChannels) -> String {
    let segments = match a.segments.len() {
        1 => "no gaps".to_owned(),
        n => format!("{n} segments"),
    };
    let r = a.repairs;
    let repaired = [
        (r.out_of_order, "out of order"),
        (r.repeated, "repeated"),
        (r.unstamped, "without a timestamp"),
        (r.filled, "filled in from the rate"),
    ];
    let repaired: Vec<String> = repaired
        .iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, what)| format!("{count} {what}"))
        .collect();
    let repaired =
        if repaired.is_empty() { String::new() } else { format!("; repaired: {}", repaired.join(", ")) };
    let rate_hz = a.step_s.recip();
    let hint = if USUAL_RATES_HZ.contains(&rate_hz) { "" } else { " (unusual: check `clock.unit`)" };
    let kept = 1.0 - a.apart as f64 / a.dx_m.len().max(1) as f64;
    let selected =
        if a.apart > 0 { format!(", {:.1} % of the rows selected", 100.0 * kept) } else { String::new() };
    format!("{rate_hz:.3} Hz{hint}, {segments}{selected}{repaired}")
}

fn actuator(
    opened: &FlightLog,
    name: &str,
    at: &ActuatorColumns,
    config: &Config,
    installations: &Installations,
) -> Result<ActuatorCheck, Diagnostic> {
    let id = &opened.identity;
    let (installation, part) = opened.unit(at, config, installations)?;
    let base = |channel: &'static str, column: &Option<String>, unit: &'static str| Channel {
        log: name.to_owned(),
        tail_number: id.tail_number.to_string(),
        flight_id: id.flight_id.to_string(),
        position: at.position.to_string(),
        serial_number: Some(installation.serial_number.to_string()),
        channel,
        column: column.clone().unwrap_or_default(),
        unit,
        samples: 0,
        missing_share: None,
        min: None,
        max: None,
        resolution: None,
        rate_hz: None,
        frozen_share: None,
        saturated_share: None,
        spikes: None,
        note: None,
        remedy: None,
    };
    let [motor, screw, load, _] = &at.columns;
    if !at.lacking.is_empty() {
        let note =
            Some(format!("would be refused, channel_unmapped: the log lacks {}", at.lacking.join(", ")));
        return Ok(ActuatorCheck {
            found: vec![Channel {
                note,
                remedy: rejection::remedy("channel_unmapped"),
                ..base("all", motor, "")
            }],
            clock: None,
            says: None,
            rejection: None,
        });
    }
    let a = opened.channels(at, part)?;
    let slope = if a.output_locked {
        Some("the output is locked: minus the motor position".to_owned())
    } else {
        quality::regression_slope(&a.motor_m, &a.dx_m).map(slope_note)
    };
    let [motor_seen, screw_seen, load_seen] = a.quality;
    let mut found = vec![
        describe(base("motor_position", motor, "m"), motor_seen, &channel_flags(&a, "motor")),
        describe(base("screw_position", screw, "m"), screw_seen, &channel_flags(&a, "screw")),
        describe(base("screw − motor", screw, "m"), a.dx_quality(), &[]),
        describe(base("load", load, "N"), load_seen, &channel_flags(&a, "load")),
    ];
    found[2].note = found[2].note.take().or(slope);
    if a.output_locked {
        found[1].note = None;
    }
    // The estimator's own tests of sign, exchange, ratio and rate; its gap is dropped.
    let tested = estimate::contact_regression(&a, part)?;
    let rejection = tested.as_ref().err().copied();
    if let Some(code) = rejection {
        let channel = &mut found[tested_channel(code)];
        let before = channel.note.take().filter(|note| !note.starts_with(RATIO));
        let before = before.map(|note| format!("{note}; ")).unwrap_or_default();
        channel.note = Some(format!("{before}would be refused, {code}"));
        channel.remedy = rejection::remedy(code);
    }
    let params = job::part_identification::IdentifiedParams::of(&a, tested.as_deref().ok());
    let says = Some((installation.part_number.clone(), params));
    Ok(ActuatorCheck { found, clock: Some(clock(&a)), says, rejection })
}

/// Row of the channel that a rejection concerns: motor, screw, their difference, load.
fn tested_channel(code: &str) -> usize {
    match code {
        "positions_swapped" | "position_ratio" | "motion_unexplained" => 2,
        "load_sign_flipped" | "load_too_small" | "no_load_reversal" | "one_side_brief" => 3,
        _ => 0,
    }
}

/// Quality flags of one channel.
fn channel_flags<'a>(a: &'a ActuatorChannels, channel: &str) -> Vec<&'a str> {
    a.flags.iter().map(String::as_str).filter(|flag| flag.starts_with(channel)).collect()
}

fn slope_note(slope: f64) -> String {
    if (slope - 1.0).abs() > SLOPE_TOLERANCE {
        format!("{RATIO} {slope:.4} (expected 1): check sign, unit, lead or gear ratio")
    } else {
        format!("{RATIO} {slope:.5}")
    }
}

fn describe(base: Channel, q: Quality, flags: &[&str]) -> Channel {
    let still = if q.samples == 0 {
        Some("no sample selected: nothing_selected".to_owned())
    } else if q.span().is_none() {
        Some("no finite value: channel_constant".to_owned())
    } else if q.is_zero() {
        Some("always zero: channel_zero".to_owned())
    } else {
        q.is_constant().then(|| "constant: channel_constant".to_owned())
    };
    Channel {
        samples: q.samples as i64,
        missing_share: Some(q.missing_share),
        min: q.span().map(|span| span.0),
        max: q.span().map(|span| span.1),
        resolution: q.resolution,
        rate_hz: Some(q.rate_hz),
        frozen_share: Some(q.frozen_share),
        saturated_share: Some(q.saturated_share),
        spikes: Some(q.spikes as i64),
        note: still.or_else(|| {
            let flagged = (!flags.is_empty()).then(|| flags.join(", "));
            let notes: Vec<String> = flagged.into_iter().chain(slower_channel(base.channel, &q)).collect();
            (!notes.is_empty()).then(|| notes.join("; "))
        }),
        ..base
    }
}

/// A position that holds a value in every second row, or fewer, is recorded more slowly than its rows.
fn slower_channel(channel: &str, q: &Quality) -> Option<String> {
    const LEAST_MISSING: f64 = 0.4;
    let is_position = channel.ends_with("_position");
    let is_slower = q.missing_share > LEAST_MISSING && q.missing_share < 1.0;
    (is_position && is_slower).then(|| {
        format!(
            "{:.0} % of its rows are empty: if it is recorded more slowly, set its `rate_hz = {:.6}`",
            100.0 * q.missing_share,
            q.rate_hz
        )
    })
}

fn layout(channels: &[Channel]) -> String {
    let columns = [
        text("position", 0),
        text("serial", 3),
        text("channel", 0),
        text("column", 1),
        number("min", 0),
        number("max", 0),
        text("unit", 1),
        number("resolution", 4),
        number("rate [Hz]", 6),
        number("missing [%]", 2),
        number("frozen [%]", 5),
        number("spikes", 7),
        text("note", 0),
    ];
    let cells = |c: &Channel| {
        let scale = if c.unit == "m" { 1e3 } else { 1.0 };
        let value = |v: Option<f64>| v.map_or_else(table::empty_cell, |v| format!("{:.3}", v * scale));
        let share = |v: Option<f64>| v.map_or_else(table::empty_cell, |v| format!("{:.2}", v * 100.0));
        let step = c.resolution.map_or_else(table::empty_cell, |v| {
            if c.unit == "m" { format!("{:.3} µm", v * 1e6) } else { format!("{v:.3}") }
        });
        vec![
            c.position.clone(),
            c.serial_number.clone().unwrap_or_else(table::empty_cell),
            c.channel.to_owned(),
            c.column.clone(),
            value(c.min),
            value(c.max),
            if c.unit == "m" { "mm".into() } else { c.unit.to_owned() },
            step,
            c.rate_hz.map_or_else(table::empty_cell, |rate| format!("{rate:.1}")),
            share(c.missing_share),
            share(c.frozen_share),
            c.spikes.map_or_else(table::empty_cell, |n| n.to_string()),
            note_of(c),
        ]
    };
    table::layout(&columns, &channels.iter().map(cells).collect::<Vec<_>>())
}

/// Column types by log, to find columns whose type changes between logs.
#[derive(Default)]
struct ColumnTypes {
    logs: usize,
    /// Column → type → number of logs, and the first of them.
    columns: BTreeMap<String, BTreeMap<String, (usize, String)>>,
}

impl ColumnTypes {
    fn enter(&mut self, log: &str, columns: &[(String, String)]) {
        self.logs += 1;
        for (name, kind) in columns {
            let seen = self.columns.entry(name.clone()).or_default();
            seen.entry(kind.clone()).or_insert_with(|| (0, log.to_owned())).0 += 1;
        }
    }

    /// Lists columns that are missing or have another type in some logs; each log is read with its own types.
    fn drift(&self) -> String {
        const SHOWN: usize = 12;
        let differs = |kinds: &BTreeMap<String, (usize, String)>| {
            kinds.len() > 1 || kinds.values().any(|(count, _)| *count < self.logs)
        };
        let lines: Vec<String> = self
            .columns
            .iter()
            .filter(|(_, kinds)| differs(kinds))
            .map(|(name, kinds)| {
                let kinds: Vec<String> = kinds
                    .iter()
                    .map(|(kind, (count, first))| format!("{kind} in {count} (first {first})"))
                    .collect();
                format!("  {}\n", escape(&format!("`{name}`: {}", kinds.join(", "))))
            })
            .collect();
        if lines.is_empty() {
            return String::new();
        }
        let more = match lines.len().saturating_sub(SHOWN) {
            0 => String::new(),
            n => format!("  and {n} more columns\n"),
        };
        let shown: String = lines.into_iter().take(SHOWN).collect();
        format!(
            "columns that are missing or whose type differs between {} logs (each log is read with its own types):\n{shown}{more}",
            self.logs
        )
    }
}

/// Compares the parameters identified from the logs with the configured ones, by part number.
fn proposals(facts: &Facts, config: &Config) -> String {
    let columns = [text("key", 0), number("identified (± 90 %)", 0), number("configured", 0)];
    let mut page = String::new();
    for (number, all) in facts {
        let Some(part) = config.parts.get(number) else { continue };
        let proposals = job::part_identification::IdentifiedParams::medians(all).comparisons(part);
        let rows: Vec<Vec<String>> = proposals
            .iter()
            .map(|p| {
                let stated = p.configured.map_or_else(table::empty_cell, |v| format!("{v:.2e}"));
                let uncertainty =
                    p.uncertainty.map_or_else(String::new, |v| format!(" ± {:.1e}", NORMAL_95 * v));
                vec![p.key.to_owned(), format!("{:.2e}{uncertainty}", p.identified), stated]
            })
            .collect();
        let flights = table::count(all.len(), "actuator-flight");
        let number = escape(number.as_str());
        let _ = writeln!(page, "part {number}, identified from {flights} (prefer data-sheet values)");
        page.push_str(&table::layout(&columns, &rows));
        page.push('\n');
    }
    page
}

/// Whether the note of a channel is a warning; a ratio within tolerance is information.
fn is_warning(channel: &Channel) -> bool {
    channel.note.as_ref().is_some_and(|note| !note.starts_with(RATIO) || note.contains("expected"))
}

fn summary(logs: usize, channels: &[Channel], diagnostics: &[Diagnostic]) -> String {
    let mut files: Vec<&str> = diagnostics.iter().filter_map(|c| c.file.as_deref()).collect();
    files.sort_unstable();
    files.dedup();
    let warned: BTreeSet<&str> = channels.iter().filter(|c| is_warning(c)).map(|c| c.log.as_str()).collect();
    format!(
        "{} checked, {} failed, {} with warnings; nothing was computed or written\n",
        table::count(logs, "log"),
        files.len(),
        warned.len()
    )
}
