//! `estimate`: logs ad hoc; nothing is stored.

use std::path::{Path, PathBuf};

use arrow::datatypes::{Field, Schema};
use fleet::{Complaint, Estimate, Installations, PartNumber, Position, SerialNumber};
use ingest::Files;
use job::Config;
use job::flight::{Opened, anonymous, caught, part_of};
use serde::Serialize;

use crate::args::{EstimateArgs, Global};
use crate::exit::{Code, Failure};
use crate::rows;
use crate::table::{self, count, number, text};
use crate::talk::Talk;

use super::query::{doubts, load};
use super::{booked, config, shown};

/// Estimates the given logs.
///
/// # Errors
/// When configuration or tables are wrong. Logs in error make the code 1.
pub(crate) fn estimate(args: &EstimateArgs, global: &Global, talk: &Talk) -> Result<Code, Failure> {
    let (config, installations) = match &args.part {
        Some(_) => (config(global)?, Installations::default()),
        None => booked(global)?,
    };
    let part = args.part.as_ref().map(|number| configured(&config, number)).transpose()?;
    let (mut found, mut complaints) = (Vec::new(), Vec::new());
    for path in &args.logs {
        let read = match &part {
            Some(number) => caught(&shown(path), || as_part(path, &config, number)),
            None => {
                let files = pipeline::bundle::around(&config, path)?;
                caught(&shown(path), || booked_log(path, &files, &config, &installations, &mut complaints))
            }
        };
        match read {
            Ok(rows) => found.extend(rows),
            Err(complaint) => complaints.push(complaint),
        }
    }
    if let Some(file) = &args.trace {
        trace(file, &args.logs, &config, &installations, part.as_ref(), talk)?;
    }
    if let Some(file) = &args.plot {
        super::plot::plot(file, &args.logs, &config, &installations, part.as_ref(), talk)?;
    }
    rows::answer(&args.output, talk, || batch(&found), || page(&found))?;
    talk.complain_all(&complaints);
    Ok(if complaints.is_empty() { Code::Well } else { Code::LogsInError })
}

/// A record without provenance of a run; what is not known of an unbooked log is null.
#[derive(Debug, Serialize)]
struct Row {
    tail_number: Option<String>,
    position: Option<String>,
    part_number: Option<String>,
    serial_number: Option<String>,
    flight_id: Option<String>,
    departure_utc: Option<jiff::Timestamp>,
    flight_hours: Option<f64>,
    tail_hours_end: Option<f64>,
    #[serde(flatten)]
    estimate: Estimate,
    log_path: String,
    log_digest: Option<String>,
    config_digest: String,
    program_version: &'static str,
}

fn configured(config: &Config, number: &str) -> Result<PartNumber, Failure> {
    let name = PartNumber::new(number)
        .map_err(|e| Failure::usage("empty_name", e, "name one that the configuration has"))?;
    match part_of(config, &name) {
        Ok(_) => Ok(name),
        Err(complaint) => Err(Failure::Refused(vec![complaint])),
    }
}

fn as_part(path: &Path, config: &Config, number: &PartNumber) -> Result<Vec<Row>, Complaint> {
    let name = shown(path);
    let found = anonymous(&Files::one(path), &name, config, part_of(config, number)?)?;
    let row = |(position, estimate): (Position, Estimate)| Row {
        tail_number: None,
        position: Some(position.to_string()),
        part_number: Some(number.to_string()),
        serial_number: None,
        flight_id: None,
        departure_utc: None,
        flight_hours: None,
        tail_hours_end: None,
        estimate,
        log_path: name.clone(),
        log_digest: None,
        config_digest: config.digest_of_part(number),
        program_version: super::VERSION,
    };
    Ok(found.into_iter().map(row).collect())
}

fn booked_log(
    path: &Path,
    files: &Files,
    config: &Config,
    installations: &Installations,
    complaints: &mut Vec<Complaint>,
) -> Result<Vec<Row>, Complaint> {
    let name = shown(path);
    let opened = Opened::open(files, &name, config, installations)?;
    let flight = opened.flight();
    let mut rows = Vec::new();
    for at in opened.actuators(installations) {
        match opened
            .unit(at, config, installations)
            .and_then(|(stay, part)| Ok((stay, opened.estimate(at, part, config)?)))
        {
            Ok((stay, estimate)) => rows.push(Row {
                tail_number: Some(flight.tail_number.to_string()),
                position: Some(at.position.to_string()),
                part_number: Some(stay.part_number.to_string()),
                serial_number: Some(SerialNumber::to_string(&stay.serial_number)),
                flight_id: Some(flight.flight_id.to_string()),
                departure_utc: Some(flight.departure_utc),
                flight_hours: flight.flight_hours,
                tail_hours_end: flight.tail_hours_end,
                estimate,
                log_path: name.clone(),
                log_digest: Some(opened.digest.clone()),
                config_digest: config.digest(&flight.tail_number, &stay.part_number),
                program_version: super::VERSION,
            }),
            Err(complaint) => complaints.push(complaint.in_file(&name)),
        }
    }
    Ok(rows)
}

/// The store's columns without those of a run, every one nullable.
fn batch(found: &[Row]) -> Result<arrow::array::RecordBatch, Failure> {
    let of_a_run = ["unit_hours", "run_id", "processed_utc"];
    let all = store::columns::schema();
    let fields = all.fields().iter().filter(|f| !of_a_run.contains(&f.name().as_str()));
    let nullable: Vec<Field> = fields.map(|f| f.as_ref().clone().with_nullable(true)).collect();
    rows::batch(&std::sync::Arc::new(Schema::new(nullable)), found)
}

fn page(found: &[Row]) -> String {
    let columns = [
        text("log", 3),
        text("position", 0),
        text("part / serial", 2),
        number("gap µm", 0),
        number("± µm", 3),
        number("mid-range µm", 4),
        number("reversals", 6),
        number("load N", 5),
        number("nis", 7),
        text("doubts", 1),
    ];
    let cells = |r: &Row| {
        let e = &r.estimate;
        let known = |t: &Option<String>| t.clone().unwrap_or_else(table::dash);
        vec![
            r.log_path.clone(),
            known(&r.position),
            format!("{} / {}", known(&r.part_number), known(&r.serial_number)),
            table::micrometres(e.gap_m),
            table::micrometres(e.gap_se_m),
            table::micrometres(e.gap_midrange_m),
            e.load_reversals.to_string(),
            load(e),
            e.nis.map_or_else(table::dash, |n| format!("{n:.2}")),
            doubts(e),
        ]
    };
    let head = format!("{}; nothing was stored\n", count(found.len(), "estimate"));
    if found.is_empty() {
        head
    } else {
        head + &table::layout(&columns, &found.iter().map(cells).collect::<Vec<_>>())
    }
}

/// Writes what the filter saw, per sample, of every actuator of the logs.
fn trace(
    file: &Path,
    logs: &[PathBuf],
    config: &Config,
    installations: &Installations,
    part: Option<&PartNumber>,
    talk: &Talk,
) -> Result<(), Failure> {
    let mut all = job::trace::Trace::default();
    for path in logs {
        // A log in error was told of already; its trace is simply not there.
        let Ok(opened) = job::trace::of_log(
            &pipeline::bundle::around(config, path)?,
            &shown(path),
            config,
            installations,
            part,
        ) else {
            continue;
        };
        all.extend(opened);
    }
    let columns = all.columns();
    ingest::write::write_parquet(file, &columns, &[]).map_err(|e| Failure::failed(e.complaint()))?;
    talk.note(&format!("wrote {} samples to {}", all.len(), shown(file)));
    Ok(())
}
