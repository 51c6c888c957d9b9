//! `explain`: traces one estimate to its inputs and settings, and recomputes it.

use std::fmt::Write as _;

use ingest::{ActuatorChannels, LogFiles};
use job::flight_log::{FlightLog, catch_panic};
use job::{Config, estimate};
use pipeline::run::discover;
use records::uncertainty::NORMAL_95;
use records::{Diagnostic, GapRecord};
use serde_json::{Value, json};
use store::{Query, Store};

use crate::args::{ExplainArgs, Global};
use crate::exit::{Code, Failure};
use crate::output::{Output, escape};
use crate::table::{self, number, text};

use crate::commands::context::{KnownNames, check_name, load_with_installations};

/// Explains one record.
///
/// # Errors
/// If configuration or store cannot be read, or there is no such record. A record that cannot be reproduced
/// makes the exit code 1.
pub(crate) fn explain(args: &ExplainArgs, global: &Global, output: &Output) -> Result<Code, Failure> {
    let (config, installations) = load_with_installations(global)?;
    let record = find(args, &Store::open(config.store())?, &config)?;
    let replayed = replay(&record, &config, &installations);
    let digest = config.digest(&record.flight.tail_number, &record.part_number);
    let verdict = ReplayVerdict::of(&record, &replayed, &digest);
    let settings = config.document.part.get(record.part_number.as_str());
    if args.json {
        let value = json!({
            "record": record,
            "remedy": super::query::remedy(&record.estimate),
            "settings": { "part": settings, "config_digest": &*digest, "is_current": *digest == *record.provenance.config_digest },
            "replay": { "verdict": verdict.code(), "says": verdict.to_string() },
        });
        output.write_exact(&format!("{value:#}\n"))?;
    } else {
        output.write_result(&page(&record, &config, &replayed, &verdict))?;
    }
    if let Err(diagnostic) = &replayed {
        output.diagnostic(diagnostic);
    }
    Ok(if matches!(verdict, ReplayVerdict::Same | ReplayVerdict::OtherSettings) {
        Code::Success
    } else {
        Code::LogsInError
    })
}

fn find(args: &ExplainArgs, store: &Store, config: &Config) -> Result<GapRecord, Failure> {
    let query = Query {
        tail_number: args.tail.clone(),
        flight_id: Some(args.flight.clone()),
        position: Some(args.position.clone()),
        ..Query::default()
    };
    let mut found = store.records(&query)?;
    match found.len() {
        1 => Ok(found.remove(0)),
        0 => {
            let known = KnownNames::read(config);
            check_name("flight", Some(&args.flight), known.flights())?;
            check_name("position", Some(&args.position), known.positions())?;
            check_name("tail", args.tail.as_deref(), known.tails())?;
            let what = format!(
                "no record of {} in flight {}{}",
                args.position,
                args.flight,
                args.tail.iter().map(|tail| format!(" of tail {tail}")).collect::<String>()
            );
            let hint = format!("list its records with `freeplay query flight {}`", args.flight);
            Err(Failure::usage("no_such_record", what, &hint))
        }
        _ => {
            let tails: Vec<String> = found.iter().map(|r| r.flight.tail_number.to_string()).collect();
            let what = format!("flight {} exists for several tails: {}", args.flight, tails.join(", "));
            Err(Failure::usage("no_such_record", what, "select one with `--tail`"))
        }
    }
}

/// Result of recomputing a record.
struct Recomputation {
    digest: String,
    channels: Option<ActuatorChannels>,
    estimate: records::GapEstimate,
}

fn replay(
    record: &GapRecord,
    config: &Config,
    installations: &records::Installations,
) -> Result<Recomputation, Diagnostic> {
    let log_path = &record.provenance.log_path;
    let path = config.path(log_path);
    let files = discover::log_containing(config, &path).unwrap_or_else(|_| LogFiles::one(path));
    catch_panic(log_path, || {
        let opened = FlightLog::open(&files, log_path, config, installations)?;
        let at = opened.positions.iter().find(|at| at.position == record.position).ok_or_else(|| {
            Diagnostic::new("no_position", format!("the log has no position {} any more", record.position))
                .in_file(log_path)
        })?;
        let (_, part) = opened.unit(at, config, installations)?;
        if !at.lacking.is_empty() {
            let estimate = opened.estimate(at, part, config)?;
            return Ok(Recomputation { digest: opened.digest.clone(), channels: None, estimate });
        }
        let channels = opened.channels(at, part)?;
        let estimate = estimate::estimate(&channels, part, &config.document.estimate)?;
        Ok(Recomputation { digest: opened.digest.clone(), channels: Some(channels), estimate })
    })
}

/// Whether a record is reproduced.
enum ReplayVerdict {
    Same,
    OtherSettings,
    OtherLog,
    OtherNumber,
    NotReplayed,
}

impl ReplayVerdict {
    fn of(record: &GapRecord, replayed: &Result<Recomputation, Diagnostic>, digest: &str) -> Self {
        let Ok(replayed) = replayed else { return Self::NotReplayed };
        if replayed.digest != record.provenance.log_digest {
            Self::OtherLog
        } else if digest != record.provenance.config_digest {
            Self::OtherSettings
        } else if in_bits(&replayed.estimate) == in_bits(&record.estimate) {
            Self::Same
        } else {
            Self::OtherNumber
        }
    }

    fn code(&self) -> &'static str {
        match self {
            Self::Same => "same",
            Self::OtherSettings => "other_settings",
            Self::OtherLog => "other_log",
            Self::OtherNumber => "other_number",
            Self::NotReplayed => "not_replayed",
        }
    }
}

impl std::fmt::Display for ReplayVerdict {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Same => "recomputed: bit-identical",
            Self::OtherSettings => "settings changed since; `freeplay run` will recompute it",
            Self::OtherLog => "the log changed since; `freeplay run` will recompute it",
            Self::OtherNumber => "recomputed value differs: please report this with the log",
            Self::NotReplayed => "the log can no longer be read",
        })
    }
}

/// JSON form of an estimate, for bitwise comparison: numbers are written so that they read back unchanged.
fn in_bits(estimate: &records::GapEstimate) -> Value {
    serde_json::to_value(estimate).unwrap_or_default()
}

fn page(
    record: &GapRecord,
    config: &Config,
    replayed: &Result<Recomputation, Diagnostic>,
    verdict: &ReplayVerdict,
) -> String {
    let (flight, p, e) = (&record.flight, &record.provenance, &record.estimate);
    let head = format!(
        "{} / {} in {} of {}, flight {}, departed {}",
        record.part_number,
        record.serial_number,
        record.position,
        flight.tail_number,
        flight.flight_id,
        flight.departure_utc
    );
    let mut page = escape(&head) + "\n";
    let mut line = |label: &str, text: &str| {
        let _ = writeln!(page, "  {label:<11} {}", escape(text));
    };
    line(
        "gap",
        &format!(
            "{} µm, standard error {} µm, 90 % interval {} to {}; mid-range {} µm",
            table::micrometres(e.gap_m),
            table::micrometres(e.gap_se_m),
            table::micrometres(e.gap_p05_m),
            table::micrometres(e.gap_p95_m),
            table::micrometres(e.gap_midrange_m)
        ),
    );
    let flags = super::query::flags_text(e);
    line("flags", if flags.is_empty() { "none" } else { &flags });
    if let Some(remedy) = super::query::remedy(e) {
        line("remedy", remedy);
    }
    let newtons = |v: Option<f64>| v.map_or_else(table::empty_cell, |v| format!("{v:.2e}"));
    line(
        "fitted",
        &format!(
            "stiffness {} ± {} N/m (90 %), skew {} ms, loop {} µm, lost motion {} µm",
            newtons(e.stiffness_n_per_m),
            newtons(e.stiffness_se_n_per_m.map(|se| NORMAL_95 * se)),
            e.skew_s.map_or_else(table::empty_cell, |s| format!("{:.2}", s * 1e3)),
            table::micrometres(e.loop_width_m),
            table::micrometres(e.lost_motion_m)
        ),
    );
    line(
        "data",
        &format!(
            "{} samples, {} load reversals, load {} N",
            e.samples,
            e.load_reversals,
            crate::commands::results::query::load(e)
        ),
    );
    line("log", &format!("{} ({})", p.log_path, short(&p.log_digest)));
    line(
        "settings",
        &format!(
            "{} ({}), method {}",
            config.file.display(),
            short(&p.config_digest),
            config.document.estimate.method.as_str()
        ),
    );
    line(
        "computed by",
        &format!(
            "Freeplay {} in run {} on {}",
            p.program_version,
            p.run_id,
            p.processed_utc.strftime("%Y-%m-%d %H:%M UTC")
        ),
    );
    line("replay", &verdict.to_string());
    line("reproduce", &format!("freeplay estimate {}", config.path(&p.log_path).display()));
    if let Some(part) = config.document.part.get(record.part_number.as_str()) {
        let settings = serde_json::to_value(part).unwrap_or_default();
        for (at, (key, value)) in flat("", &settings).into_iter().enumerate() {
            line(if at == 0 { "part" } else { "" }, &format!("{key} = {value}"));
        }
    }
    if let Ok(Recomputation { channels: Some(channels), .. }) = replayed {
        page.push('\n');
        page.push_str(&quality(channels));
    }
    page
}

fn short(digest: &str) -> &str {
    digest.get(..12).unwrap_or(digest)
}

/// Keys and values of nested tables, with their full names.
fn flat(above: &str, value: &Value) -> Vec<(String, String)> {
    let Value::Object(table) = value else { return vec![(above.to_owned(), value.to_string())] };
    let named = |key: &str| if above.is_empty() { key.to_owned() } else { format!("{above}.{key}") };
    table.iter().flat_map(|(key, value)| flat(&named(key), value)).collect()
}

fn quality(channels: &ActuatorChannels) -> String {
    let columns = [
        text("channel", 0),
        number("min", 0),
        number("max", 0),
        number("resolution", 3),
        number("rate [Hz]", 2),
        number("missing [%]", 1),
        number("spikes", 4),
    ];
    let rows: Vec<Vec<String>> = ["motor [m]", "screw [m]", "load [N]"]
        .iter()
        .zip(&channels.quality)
        .map(|(name, q)| {
            let value = |v: Option<f64>| v.map_or_else(table::empty_cell, |v| format!("{v:.6}"));
            vec![
                (*name).to_owned(),
                value(q.span().map(|span| span.0)),
                value(q.span().map(|span| span.1)),
                q.resolution.map_or_else(table::empty_cell, |r| format!("{r:.2e}")),
                format!("{:.1}", q.rate_hz),
                format!("{:.2}", q.missing_share * 100.0),
                q.spikes.to_string(),
            ]
        })
        .collect();
    table::layout(&columns, &rows)
}
