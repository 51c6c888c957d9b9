//! `check`: what logs offer, channel by channel, before anything is computed or written.

use std::fmt::Write as _;
use std::sync::Arc;

use arrow::datatypes::{DataType, Field, Schema, SchemaRef};
use fleet::{Complaint, Installations};
use ingest::{PositionColumns, Quality, quality};
use job::Config;
use job::flight::{Opened, caught};
use pipeline::Request;
use serde::Serialize;

use crate::args::{CheckArgs, Format, Global};
use crate::exit::{Code, Failure};
use crate::rows;
use crate::table::{self, number, text};
use crate::talk::Talk;

use super::{booked, shown};

/// How far the slope of screw on motor may be off 1 before it is called a mapping error.
const SLOPE_TOLERANCE: f64 = 0.02;

/// Looks at logs and says what was found.
///
/// # Errors
/// When configuration or tables are wrong. Logs in error make the code 1.
pub(crate) fn check(args: &CheckArgs, global: &Global, talk: &Talk) -> Result<Code, Failure> {
    let (config, installations) = booked(global)?;
    let logs = logs(args, &config, talk)?;
    let (mut channels, mut complaints, mut page) = (Vec::new(), Vec::new(), String::new());
    for (path, name) in &logs {
        let looked = caught(name, || {
            let opened = Opened::open(path, name, &config)?;
            one(&opened, name, &config, &installations, &mut channels, &mut complaints, &mut page);
            Ok(())
        });
        complaints.extend(looked.err());
    }
    let table = || format!("{page}{}", summary(logs.len(), &complaints));
    if args.output.format() == Format::Table && args.output.output.is_none() {
        talk.answer(&table())?;
    } else {
        rows::answer(&args.output, talk, || rows::batch(&schema(), &channels), table)?;
    }
    talk.complain_all(&complaints);
    Ok(if complaints.is_empty() { Code::Well } else { Code::LogsInError })
}

fn logs(
    args: &CheckArgs,
    config: &Config,
    talk: &Talk,
) -> Result<Vec<(std::path::PathBuf, String)>, Failure> {
    if !args.logs.is_empty() {
        return Ok(args.logs.iter().map(|path| (path.clone(), shown(path))).collect());
    }
    let request = Request { redo: true, ..Request::default() };
    let plan = pipeline::schedule::dry_run(config, &request)?;
    let mut logs: Vec<_> = plan.work.into_iter().map(|w| (w.path, w.shown)).collect();
    logs.sort();
    if logs.len() > args.limit {
        talk.note(&format!("looking at {} of {} logs; `--limit` looks at more", args.limit, logs.len()));
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
    frozen_share: Option<f64>,
    note: Option<String>,
}

fn one(
    opened: &Opened<'_>,
    name: &str,
    config: &Config,
    installations: &Installations,
    channels: &mut Vec<Channel>,
    complaints: &mut Vec<Complaint>,
    page: &mut String,
) {
    let id = &opened.identity;
    let line = opened.timeline();
    let _ = writeln!(
        page,
        "{name}\n  {} flight {} departed {}\n  {} rows, {:.3} Hz, {}{}",
        id.tail_number,
        id.flight_id,
        id.departure_utc,
        line.rows,
        line.step_s.recip(),
        match line.segments.len() {
            1 => "unbroken".to_owned(),
            n => format!("{n} unbroken stretches"),
        },
        repairs(line)
    );
    let first = channels.len();
    for at in opened.actuators(installations) {
        match actuator(opened, name, at, config, installations) {
            Ok(found) => channels.extend(found),
            Err(complaint) => complaints.push(complaint.in_file(name)),
        }
    }
    page.push_str(&layout(&channels[first..]));
    page.push('\n');
}

fn repairs(line: &ingest::Timeline) -> String {
    let r = line.repairs;
    if r.none() {
        return String::new();
    }
    format!(
        "; mended: {} out of order, {} repeated, {} without a stamp",
        r.out_of_order, r.repeated, r.unstamped
    )
}

fn actuator(
    opened: &Opened<'_>,
    name: &str,
    at: &PositionColumns,
    config: &Config,
    installations: &Installations,
) -> Result<Vec<Channel>, Complaint> {
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
        frozen_share: None,
        note: None,
    };
    let [motor, screw, load, _] = &at.columns;
    if !at.lacking.is_empty() {
        let note =
            Some(format!("would be refused, channel_unmapped: the log lacks {}", at.lacking.join(", ")));
        return Ok(vec![Channel { note, ..base("all", motor, "") }]);
    }
    let a = opened.channels(at, part)?;
    let screw_m: Vec<f64> = a.motor_m.iter().zip(&a.dx_m).map(|(m, d)| m + d).collect();
    let slope = quality::slope(&a.motor_m, &a.dx_m).map(slope_note);
    let mut found = vec![
        describe(base("motor_position", motor, "m"), &a.motor_m),
        describe(base("screw_position", screw, "m"), &screw_m),
        describe(base("screw − motor", screw, "m"), &a.dx_m),
        describe(base("load", load, "N"), &a.load_n),
    ];
    found[2].note = found[2].note.take().or(slope);
    Ok(found)
}

fn slope_note(slope: f64) -> String {
    if (slope - 1.0).abs() > SLOPE_TOLERANCE {
        format!("screw moves {slope:.4} for 1 of motor: a wrong sign, unit, lead or gear ratio?")
    } else {
        format!("screw moves {slope:.5} for 1 of motor")
    }
}

fn describe(base: Channel, values: &[f64]) -> Channel {
    let q = Quality::of(values);
    let note = q.is_constant().then(|| "never moves".to_owned());
    Channel {
        samples: q.samples as i64,
        missing_share: Some(q.missing_share),
        min: Some(q.min),
        max: Some(q.max),
        resolution: q.resolution,
        frozen_share: Some(q.frozen_share),
        note,
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
        text("unit", 0),
        number("smallest step", 4),
        number("missing %", 2),
        number("frozen %", 5),
        text("note", 0),
    ];
    let cells = |c: &Channel| {
        let scale = if c.unit == "m" { 1e3 } else { 1.0 };
        let value = |v: Option<f64>| v.map_or_else(table::dash, |v| format!("{:.3}", v * scale));
        let share = |v: Option<f64>| v.map_or_else(table::dash, |v| format!("{:.2}", v * 100.0));
        let step = c.resolution.map_or_else(table::dash, |v| {
            if c.unit == "m" { format!("{:.3} µm", v * 1e6) } else { format!("{v:.3}") }
        });
        vec![
            c.position.clone(),
            c.serial_number.clone().unwrap_or_else(table::dash),
            c.channel.to_owned(),
            c.column.clone(),
            value(c.min),
            value(c.max),
            if c.unit == "m" { "mm".into() } else { c.unit.to_owned() },
            step,
            share(c.missing_share),
            share(c.frozen_share),
            c.note.clone().unwrap_or_default(),
        ]
    };
    table::layout(&columns, &channels.iter().map(cells).collect::<Vec<_>>())
}

fn summary(logs: usize, complaints: &[Complaint]) -> String {
    let mut files: Vec<&str> = complaints.iter().filter_map(|c| c.file.as_deref()).collect();
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
        real("frozen_share"),
        text("note"),
    ]))
}
