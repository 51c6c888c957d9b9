//! `check`: what logs offer, channel by channel, before anything is computed or written.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::sync::Arc;

use arrow::datatypes::{DataType, Field, Schema, SchemaRef};
use ingest::channel::quality;
use ingest::{ActuatorChannels, ActuatorColumns, LogFiles, Quality};
use job::Config;
use job::config::limits::MAX_PLAUSIBLE_LIMIT_M;
use job::flight_log::{FlightLog, catch_panic};
use pipeline::run::discover;
use records::{Diagnostic, Installations, PartNumber};
use serde::Serialize;

use crate::args::{CheckArgs, Format, Global};
use crate::exit::{Code, Failure};
use crate::output::Output;
use crate::row_output;
use crate::table::{self, number, text};

use crate::commands::context::{display_path, load_with_installations};

/// How far the slope of screw on motor may be off 1 before it is called a mapping error.
const SLOPE_TOLERANCE: f64 = 0.02;

/// Rates at which actuators are logged; one beyond is more often a wrong unit of time.
const USUAL_RATES_HZ: std::ops::RangeInclusive<f64> = 1.0..=20e3;

/// What stands for the table of channels where no actuator could be looked at.
const NOTHING: &str = "  no actuator could be looked at: see the errors\n";

/// Looks at logs and says what was found.
///
/// # Errors
/// When configuration or tables are wrong. Logs in error make the code 1.
pub(crate) fn check(args: &CheckArgs, global: &Global, output: &Output) -> Result<Code, Failure> {
    let (config, installations) = load_with_installations(global)?;
    doubt_limits(&config, output);
    let logs = logs(args, &config, output)?;
    let (mut channels, mut diagnostics, mut page) = (Vec::new(), Vec::new(), String::new());
    let mut schemas = ColumnTypes::default();
    let mut facts = Facts::new();
    for (files, name) in &logs {
        let looked = catch_panic(name, || {
            let opened = FlightLog::open(files, name, &config, &installations)?;
            schemas.enter(name, &opened.column_types());
            one(
                &opened,
                name,
                &config,
                &installations,
                &mut CheckSummary {
                    channels: &mut channels,
                    facts: &mut facts,
                    diagnostics: &mut diagnostics,
                },
                &mut page,
            );
            Ok(())
        });
        diagnostics.extend(looked.err());
    }
    let table = || {
        format!(
            "{page}{}{}{}",
            schemas.drift(),
            proposals(&facts, &config),
            summary(logs.len(), &diagnostics)
        )
    };
    if args.rows.format() == Format::Table && args.rows.output.is_none() {
        output.write_result(&table())?;
    } else {
        row_output::write_rows(&args.rows, output, || row_output::batch(&schema(), &channels), table)?;
    }
    output.diagnostics(&diagnostics);
    Ok(if diagnostics.is_empty() { Code::Success } else { Code::LogsInError })
}

/// Asks after limits that were given in another unit.
fn doubt_limits(config: &Config, output: &Output) {
    let of_part = |(number, part): (&String, &job::config::part::PartSettings)| {
        [("limit_m", part.limit_m), ("watch_m", part.watch_m)]
            .map(|(key, m)| (format!("part {number}"), key, m))
    };
    let of_all = ("trend".to_owned(), "limit_m", config.document.trend.limit_m);
    for (whose, key, limit_m) in config.document.part.iter().flat_map(of_part).chain([of_all]) {
        if let Some(limit_m) = limit_m.filter(|limit_m| *limit_m > MAX_PLAUSIBLE_LIMIT_M) {
            let meant = "keys are in metres: 150 µm is 150e-6";
            output.note(&format!("{whose}: is `{key}` = {limit_m} meant in another unit? {meant}"));
        }
    }
}

fn logs(args: &CheckArgs, config: &Config, output: &Output) -> Result<Vec<(LogFiles, String)>, Failure> {
    if !args.logs.is_empty() {
        let whole =
            |path: &std::path::PathBuf| Ok((discover::log_containing(config, path)?, display_path(path)));
        return args.logs.iter().map(whole).collect();
    }
    let found = discover::discover(config)?;
    for stray in &found.strays {
        output.note(&format!("{stray}: no main log is of its flight, so it is not used"));
    }
    let faulty = found.faulty.into_iter().map(|(name, (path, _))| (LogFiles::one(path), name));
    let mut logs: Vec<_> = found.logs.into_iter().map(|(name, files)| (files, name)).chain(faulty).collect();
    if logs.len() > args.limit {
        output.note(&format!("looking at {} of {} logs; `--limit` looks at more", args.limit, logs.len()));
        logs.truncate(args.limit);
    }
    Ok(logs)
}

/// One channel of one actuator of one log.
#[derive(Debug, Serialize)]
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
}

/// What all logs said, so far.
struct CheckSummary<'s> {
    channels: &'s mut Vec<Channel>,
    facts: &'s mut Facts,
    diagnostics: &'s mut Vec<Diagnostic>,
}

/// What actuators say of their part numbers.
type Facts = BTreeMap<PartNumber, Vec<job::part_identification::IdentifiedParams>>;

/// What one actuator said.
struct ActuatorCheck {
    found: Vec<Channel>,
    clock: Option<String>,
    says: Option<(PartNumber, job::part_identification::IdentifiedParams)>,
}

fn one(
    opened: &FlightLog,
    name: &str,
    config: &Config,
    installations: &Installations,
    seen: &mut CheckSummary<'_>,
    page: &mut String,
) {
    let id = &opened.identity;
    let CheckSummary { channels, facts, diagnostics } = seen;
    let (first, mut clocks) = (channels.len(), Vec::new());
    for at in opened.actuators(installations) {
        match actuator(opened, name, at, config, installations) {
            Ok(ActuatorCheck { found, clock, says }) => {
                channels.extend(found);
                clocks.extend(clock);
                if let Some((part, says)) = says {
                    facts.entry(part).or_default().push(says);
                }
            }
            // What is wrong with the log as a whole is wrong with each of its actuators.
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
        Ok(true) => "every page carries a checksum",
        Ok(false) => {
            "no page checksums: a flipped byte may go unseen (`write_page_checksum=True` in pyarrow)"
        }
        Err(_) => "page headers cannot be read",
    };
    let clocks = if clocks.is_empty() { String::new() } else { format!(", {}", clocks.join("; ")) };
    let _ = writeln!(
        page,
        "{name}\n  {} flight {} departed {}\n  {} rows{clocks}\n  {checksums}",
        id.tail_number,
        id.flight_id,
        id.departure_utc,
        opened.rows(),
    );
    page.push_str(&if channels.len() > first { layout(&channels[first..]) } else { NOTHING.to_owned() });
    page.push('\n');
}

/// The clock of an actuator in words.
fn clock(a: &ActuatorChannels) -> String {
    let stretches = match a.segments.len() {
        1 => "unbroken".to_owned(),
        n => format!("{n} unbroken stretches"),
    };
    let r = a.repairs;
    let mended = [
        (r.out_of_order, "out of order"),
        (r.repeated, "repeated"),
        (r.unstamped, "without a stamp"),
        (r.filled, "given a stamp by the rate"),
    ];
    let mended: Vec<String> = mended
        .iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, what)| format!("{count} {what}"))
        .collect();
    let mended = if mended.is_empty() { String::new() } else { format!("; mended: {}", mended.join(", ")) };
    let rate_hz = a.step_s.recip();
    let doubt = if USUAL_RATES_HZ.contains(&rate_hz) { "" } else { " (is `clock.unit` right?)" };
    let kept = 1.0 - a.apart as f64 / a.dx_m.len().max(1) as f64;
    let selected =
        if a.apart > 0 { format!(", {:.1} % of the rows selected", 100.0 * kept) } else { String::new() };
    format!("{rate_hz:.3} Hz{doubt}, {stretches}{selected}{mended}")
}

fn actuator(
    opened: &FlightLog,
    name: &str,
    at: &ActuatorColumns,
    config: &Config,
    installations: &Installations,
) -> Result<ActuatorCheck, Diagnostic> {
    let id = &opened.identity;
    let (stay, part) = opened.unit(at, config, installations)?;
    let base = |channel: &'static str, column: &Option<String>, unit: &'static str| Channel {
        log: name.to_owned(),
        tail_number: id.tail_number.to_string(),
        flight_id: id.flight_id.to_string(),
        position: at.position.to_string(),
        serial_number: Some(stay.serial_number.to_string()),
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
    };
    let [motor, screw, load, _] = &at.columns;
    if !at.lacking.is_empty() {
        let note =
            Some(format!("would be refused, channel_unmapped: the log lacks {}", at.lacking.join(", ")));
        return Ok(ActuatorCheck {
            found: vec![Channel { note, ..base("all", motor, "") }],
            clock: None,
            says: None,
        });
    }
    let a = opened.channels(at, part)?;
    let slope = quality::regression_slope(&a.motor_m, &a.dx_m).map(slope_note);
    let [motor_seen, screw_seen, load_seen] = a.quality;
    let mut found = vec![
        describe(base("motor_position", motor, "m"), motor_seen, &said(&a, "motor")),
        describe(base("screw_position", screw, "m"), screw_seen, &said(&a, "screw")),
        describe(base("screw − motor", screw, "m"), a.dx_quality(), &[]),
        describe(base("load", load, "N"), load_seen, &said(&a, "load")),
    ];
    found[2].note = found[2].note.take().or(slope);
    let says = Some((stay.part_number.clone(), job::part_identification::IdentifiedParams::of(&a, part)));
    Ok(ActuatorCheck { found, clock: Some(clock(&a)), says })
}

/// The doubts about one channel.
fn said<'a>(a: &'a ActuatorChannels, channel: &str) -> Vec<&'a str> {
    a.flags.iter().map(String::as_str).filter(|flag| flag.starts_with(channel)).collect()
}

fn slope_note(slope: f64) -> String {
    if (slope - 1.0).abs() > SLOPE_TOLERANCE {
        format!("screw moves {slope:.4} for 1 of motor: a wrong sign, unit, lead or gear ratio?")
    } else {
        format!("screw moves {slope:.5} for 1 of motor")
    }
}

fn describe(base: Channel, q: Quality, doubts: &[&str]) -> Channel {
    let still = if q.samples == 0 {
        Some("no sample is selected: nothing_selected".to_owned())
    } else if q.span().is_none() {
        Some("holds no value that counts: channel_constant".to_owned())
    } else if q.is_zero() {
        Some("is always zero: channel_zero".to_owned())
    } else {
        q.is_constant().then(|| "never moves: channel_constant".to_owned())
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
        note: still.or_else(|| (!doubts.is_empty()).then(|| doubts.join(", "))),
        ..base
    }
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
        number("smallest step", 4),
        number("rate Hz", 6),
        number("missing %", 2),
        number("frozen %", 5),
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
            c.note.clone().unwrap_or_default(),
        ]
    };
    table::layout(&columns, &channels.iter().map(cells).collect::<Vec<_>>())
}

/// Which columns the logs have, and of which types: they change over the years.
#[derive(Default)]
struct ColumnTypes {
    logs: usize,
    /// Column → type → logs that have it so, and the first of them.
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

    /// What is not alike in all logs; each is read as it is.
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
                format!("  `{name}`: {}\n", kinds.join(", "))
            })
            .collect();
        if lines.is_empty() {
            return String::new();
        }
        let more = match lines.len().saturating_sub(SHOWN) {
            0 => String::new(),
            n => format!("  and {n} columns more\n"),
        };
        let shown: String = lines.into_iter().take(SHOWN).collect();
        format!(
            "columns that are not alike in all {} logs (each log is read as it is):\n{shown}{more}",
            self.logs
        )
    }
}

/// What the logs say of each part, beside what the configuration says.
fn proposals(facts: &Facts, config: &Config) -> String {
    let columns = [text("key", 0), number("found", 0), number("stated", 0)];
    let mut page = String::new();
    for (number, all) in facts {
        let Some(part) = config.parts.get(number) else { continue };
        let proposals = job::part_identification::IdentifiedParams::medians(all).comparisons(part);
        let rows: Vec<Vec<String>> = proposals
            .iter()
            .map(|p| {
                let stated = p.configured.map_or_else(table::empty_cell, |v| format!("{v:.2e}"));
                vec![p.key.to_owned(), format!("{:.2e}", p.identified), stated]
            })
            .collect();
        let actuators = table::count(all.len(), "actuator");
        let _ = writeln!(
            page,
            "part {number} as {actuators} of these logs would have it; data sheets know better"
        );
        page.push_str(&table::layout(&columns, &rows));
        page.push('\n');
    }
    page
}

fn summary(logs: usize, diagnostics: &[Diagnostic]) -> String {
    let mut files: Vec<&str> = diagnostics.iter().filter_map(|c| c.file.as_deref()).collect();
    files.sort_unstable();
    files.dedup();
    format!("{}: {} in error; nothing was computed or written\n", table::count(logs, "log"), files.len())
}

fn schema() -> SchemaRef {
    let text = |name: &str| Field::new(name, DataType::Utf8, true);
    let real = |name: &str| Field::new(name, DataType::Float64, true);
    Arc::new(Schema::new(vec![
        text("log"),
        text("tail_number"),
        text("flight_id"),
        text("position"),
        text("serial_number"),
        text("channel"),
        text("column"),
        text("unit"),
        Field::new("samples", DataType::Int64, true),
        real("missing_share"),
        real("min"),
        real("max"),
        real("resolution"),
        real("rate_hz"),
        real("frozen_share"),
        real("saturated_share"),
        Field::new("spikes", DataType::Int64, true),
        text("note"),
    ]))
}
