//! `store`: inspects and maintains the results store.

mod alerts;
mod runs;

use std::collections::BTreeSet;
use std::time::Duration;

use jiff::Timestamp;
use job::Config;
use records::Diagnostic;
use records::row_schema::to_batch;
use serde_json::json;
use store::{Info, Query, RunRecord, Store, Withdrawal};

use crate::args::{ForgetArgs, Format, Global, RowFormatArgs, StoreArgs, StoreCommand};
use crate::commands::context::load_config;
use crate::commands::results::query;
use crate::progress::span;
use crate::table::count;
use crate::{Code, Failure, Output, row_output};

pub(crate) fn store(args: &StoreArgs, global: &Global, output: &Output) -> Result<Code, Failure> {
    let config = load_config(global)?;
    let store = Store::open(config.store())?;
    match &args.command {
        StoreCommand::Info { max_age, json } => info(&store, *max_age, *json, output),
        StoreCommand::Runs { run, last, rows } => runs::runs(&store, run.as_deref(), *last, rows, output),
        StoreCommand::Alerts { resend: Some(id), .. } => alerts::resend(&store, id, output),
        StoreCommand::Alerts { drop: Some(channel), to, .. } => {
            alerts::drop_unsent(&store, &config, channel, to.as_deref(), output)
        }
        StoreCommand::Alerts { unsent, rows, .. } => alerts::alerts(&store, *unsent, rows, output),
        StoreCommand::Files { table } => files(&store, table, output),
        StoreCommand::Verify { accept_foreign } => verify(&store, *accept_foreign, output),
        StoreCommand::Compact => compact(&store, output),
        StoreCommand::Forget(args) => forget(&store, args, output),
        StoreCommand::Export { rows } => export(&config, rows, output),
    }
}

fn files(store: &Store, table: &str, output: &Output) -> Result<Code, Failure> {
    let files = store.table_files(table)?;
    let lines: Vec<String> = files.iter().map(|file| file.display().to_string() + "\n").collect();
    output.write_result(&lines.concat())?;
    Ok(Code::Success)
}

fn info(store: &Store, max_age: Option<Duration>, as_json: bool, output: &Output) -> Result<Code, Failure> {
    let found = store.info()?;
    let age = found.last_completed.as_ref().and_then(age);
    if as_json {
        output.write_exact(&format!("{:#}\n", in_json(store, &found, age)?))?;
    } else {
        output.write_result(&(in_words(store, &found, age) + &unfinished(store, &found)?))?;
    }
    let late = max_age.filter(|allowed| age.is_none_or(|age| age > *allowed));
    let Some(allowed) = late else { return Ok(Code::Success) };
    let what = match age {
        Some(age) => {
            format!("the last completed run ended {} ago, more than {}", span(age), span(allowed))
        }
        None => match found.last_completed.as_ref().and_then(|run| run.finished_utc) {
            Some(ended) => {
                let now = Timestamp::now();
                format!("the last completed run ended at {ended:.0}, after this machine's clock, {now:.0}")
            }
            None => "no completed run".to_owned(),
        },
    };
    output.diagnostic(&Diagnostic::new("run_overdue", what).hint(
        "check the clock, that the timer starts `freeplay run`, and that no run ends with code 2 or 3",
    ));
    Ok(Code::LogsInError)
}

fn age(run: &RunRecord) -> Option<Duration> {
    Timestamp::now().duration_since(run.finished_utc?).try_into().ok()
}

fn in_words(store: &Store, found: &Info, age: Option<Duration>) -> String {
    let day = |t: Option<Timestamp>| {
        t.map_or_else(crate::table::empty_cell, |t| t.strftime("%Y-%m-%d %H:%M UTC").to_string())
    };
    let last = match (&found.last_completed, age) {
        (Some(run), Some(age)) => {
            format!("{}, {} ago, {}", run.run_id, span(age), runs::status_text(runs::run_status(run, false)))
        }
        _ => "no completed run".to_owned(),
    };
    format!(
        "{}\n  records     {} of {}, {}, {}\n  departures  {} to {}\n  logs        {} processed ({} failed)\n  data        {}, {:.1} MB, Delta version {}\n  last run    {last}\n",
        store.dir().display(),
        found.records,
        count(found.flights, "flight"),
        count(found.serials, "unit"),
        count(found.tails, "tail"),
        day(found.first_departure_utc),
        day(found.last_departure_utc),
        found.logs,
        found.failed_logs,
        count(found.files, "file"),
        found.bytes as f64 / 1e6,
        found.version,
    )
}

/// Line about the newest run if it has not completed: it is running or was killed.
fn unfinished(store: &Store, found: &Info) -> Result<String, Failure> {
    let Some(run) = found.last.as_ref().filter(|run| run.exit_code.is_none()) else {
        return Ok(String::new());
    };
    let began = run.started_utc.strftime("%Y-%m-%d %H:%M UTC");
    let how = match runs::run_status(run, store.is_held()?) {
        "killed" => "did not exit cleanly (killed, or disk failure)",
        other => runs::status_text(other),
    };
    let left = if run.not_reached > 0 { "; `freeplay run` processes them" } else { "" };
    let (id, done, not_reached) = (&run.run_id, count(run.done as usize, "log"), run.not_reached);
    let (estimated, refused, errors) = (run.estimated, run.refused, run.errors);
    Ok(format!(
        "  unfinished  {id}, started {began}, {how}\n              {done} processed ({estimated} estimated, {refused} refused, {errors} failed), {not_reached} not processed{left}\n",
    ))
}

fn in_json(store: &Store, found: &Info, age: Option<Duration>) -> Result<serde_json::Value, Failure> {
    let run = found.last_completed.as_ref();
    let is_held = store.is_held()?;
    let last = found.last.as_ref().map(|run| {
        json!({
            "run_id": run.run_id,
            "started_utc": run.started_utc,
            "ended": runs::run_status(run, is_held),
            "exit_code": run.exit_code,
            "done": run.done,
            "estimated": run.estimated,
            "refused": run.refused,
            "errors": run.errors,
            "not_reached": run.not_reached,
        })
    });
    Ok(json!({
        "path": store.dir().display().to_string(),
        "records": found.records,
        "flights": found.flights,
        "serials": found.serials,
        "tails": found.tails,
        "first_departure_utc": found.first_departure_utc,
        "last_departure_utc": found.last_departure_utc,
        "logs": found.logs,
        "logs_in_error": found.failed_logs,
        "files": found.files,
        "bytes": found.bytes,
        "version": found.version,
        "last_completed_run_id": run.map(|r| r.run_id.clone()),
        "last_completed_utc": run.and_then(|r| r.finished_utc),
        "last_completed_exit_code": run.and_then(|r| r.exit_code),
        "age_s": age.map(|a| a.as_secs_f64()),
        "last_run": last,
    }))
}

fn verify(store: &Store, accepts_foreign: bool, output: &Output) -> Result<Code, Failure> {
    if accepts_foreign {
        let accepted = store.lock(None)?.accept_foreign()?;
        output.write_result(&format!("accepted {} of other programs\n", count(accepted, "commit")))?;
    }
    let findings = store.verify();
    if findings.is_empty() {
        output.write_result(&format!(
            "{}: OK: all data files present and unchanged\n",
            store.dir().display()
        ))?;
        return Ok(Code::Success);
    }
    output.diagnostics(&findings);
    output.write_result(&format!("{} in {}\n", count(findings.len(), "finding"), store.dir().display()))?;
    Ok(Code::LogsInError)
}

fn forget(store: &Store, args: &ForgetArgs, output: &Output) -> Result<Code, Failure> {
    let query = Query {
        tail_number: args.tail.clone(),
        flight_id: args.flight.clone(),
        position: args.position.clone(),
        since_utc: args.departures.since,
        until_utc: args.departures.until,
        ..Query::default()
    };
    let selects = query != Query::default() || args.log.is_some();
    if !selects {
        let hint = "give `--flight`, `--log`, `--tail`, `--position`, `--since` or `--until`";
        return Err(Failure::usage("nothing_selected", "no record is selected", hint));
    }
    let mut writer = store.lock(None)?;
    let Withdrawal { records: changed, flights } = writer.withdraw(&query, args.log.as_deref(), args.undo)?;
    // A flight number may fly every day, on several tails.
    let tails: BTreeSet<&String> = flights.iter().map(|(tail, _)| tail).collect();
    let scope = format!("{} of {}", count(flights.len(), "flight"), count(tails.len(), "tail"));
    let records = count(changed, "record");
    output.write_result(&match (changed, args.undo) {
        (0, _) => "no stored record matches\n".to_owned(),
        (_, true) => format!("brought back {records}\n  next  `freeplay run` assesses the fleet with them\n"),
        (_, false) => format!(
            "took out {records} ({scope}); nothing is deleted, the same command with `--undo` brings them back\n  \
             next  `freeplay run` assesses the fleet without them; with `--retry` it also stores another log of these flights\n"
        ),
    })?;
    Ok(if changed == 0 { Code::LogsInError } else { Code::Success })
}

fn compact(store: &Store, output: &Output) -> Result<Code, Failure> {
    let done = store.lock(None)?.compact()?;
    let deleted = count(done.deleted, "superseded file");
    output.write_result(&format!(
        "merged {} into {}; {deleted} deleted\n",
        count(done.before, "file"),
        done.after
    ))?;
    Ok(Code::Success)
}

fn export(config: &Config, format: &RowFormatArgs, output: &Output) -> Result<Code, Failure> {
    let installations = pipeline::run::scheduler::installations(config)?;
    let store = pipeline::open_store(config, &installations)?;
    if format.format() == Format::Table {
        let records = store.records(&Query::default())?;
        row_output::write_rows(
            format,
            output,
            || Ok(to_batch(&records).map_err(store::Error::from)?),
            || query::page(&records),
        )?;
    } else {
        let batch = store.scan(&Query::default())?;
        row_output::write_rows(format, output, || Ok(batch), String::new)?;
    }
    Ok(Code::Success)
}
