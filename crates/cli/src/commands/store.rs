//! `store`: care of the results.

use std::path::Path;
use std::time::Duration;

use jiff::Timestamp;
use records::Diagnostic;
use serde_json::json;
use store::{Holder, Info, Query, RunRecord, Store};

use crate::args::{Format, Global, Output, StoreArgs, StoreCommand, Table};
use crate::exit::{Code, Failure};
use crate::progress::{Progress, span};
use crate::rows;
use crate::table::count;
use crate::talk::Talk;

use super::{config, query, runs};

/// Cares for the store that the configuration names.
///
/// # Errors
/// When configuration or store cannot be read, or written.
pub(crate) fn store(args: &StoreArgs, global: &Global, talk: &Talk) -> Result<Code, Failure> {
    let store = Store::open(config(global)?.store())?;
    match &args.command {
        StoreCommand::Info { max_age, json } => info(&store, *max_age, *json, talk),
        StoreCommand::Runs { run, last, output } => runs::runs(&store, run.as_deref(), *last, output, talk),
        StoreCommand::Files { table } => files(&store, *table, talk),
        StoreCommand::Verify => verify(&store, talk),
        StoreCommand::Compact => compact(&store, talk),
        StoreCommand::Adopt { trial } => adopt(&store, trial, talk),
        StoreCommand::Export { output } => export(&store, output, talk),
    }
}

fn files(store: &Store, table: Table, talk: &Talk) -> Result<Code, Failure> {
    let files = match table {
        Table::Gaps => store.files()?,
        Table::Logs => store.log_files()?,
        Table::Runs => store.run_files()?,
    };
    let lines: Vec<String> = files.iter().map(|file| file.display().to_string() + "\n").collect();
    talk.answer(&lines.concat())?;
    Ok(Code::Well)
}

fn info(store: &Store, max_age: Option<Duration>, as_json: bool, talk: &Talk) -> Result<Code, Failure> {
    let found = store.info()?;
    let age = found.last_completed.as_ref().and_then(age);
    if as_json {
        talk.answer(&format!("{:#}\n", in_json(store, &found, age)?))?;
    } else {
        talk.answer(&(in_words(store, &found, age) + &unfinished(store, &found)?))?;
    }
    let late = max_age.filter(|allowed| age.is_none_or(|age| age > *allowed));
    let Some(allowed) = late else { return Ok(Code::Well) };
    let what = match age {
        Some(age) => {
            format!("the last completed run ended {} ago, and {} are allowed", span(age), span(allowed))
        }
        None => "no run was ever completed".to_owned(),
    };
    talk.complain(
        &Diagnostic::new("run_overdue", what)
            .hint("did the timer start `freeplay run`, and did it end with code 0 or 1?"),
    );
    Ok(Code::LogsInError)
}

/// Time since a run ended.
fn age(run: &RunRecord) -> Option<Duration> {
    Timestamp::now().duration_since(run.finished_utc?).try_into().ok()
}

fn in_words(store: &Store, found: &Info, age: Option<Duration>) -> String {
    let day = |t: Option<Timestamp>| {
        t.map_or_else(crate::table::dash, |t| t.strftime("%Y-%m-%d %H:%M UTC").to_string())
    };
    let last = match (&found.last_completed, age) {
        (Some(run), Some(age)) => {
            format!("{}, {} ago, exit code {}", run.run_id, span(age), run.exit_code.unwrap_or_default())
        }
        _ => "none was ever completed".to_owned(),
    };
    format!(
        "{}\n  records     {} of {}, {}, {}\n  departures  {} to {}\n  logs        {} accounted for\n  data        {}, {:.1} MB, Delta version {}\n  last run    {last}\n",
        store.dir().display(),
        found.records,
        count(found.flights, "flight"),
        count(found.serials, "unit"),
        count(found.tails, "tail"),
        day(found.first_departure_utc),
        day(found.last_departure_utc),
        found.logs,
        count(found.files, "file"),
        found.bytes as f64 / 1e6,
        found.version,
    )
}

/// A line about the newest run where that is not the one that completed: it still goes, or was killed.
fn unfinished(store: &Store, found: &Info) -> Result<String, Failure> {
    let Some(run) = found.last.as_ref().filter(|run| run.exit_code.is_none()) else {
        return Ok(String::new());
    };
    let began = run.started_utc.strftime("%Y-%m-%d %H:%M UTC");
    let how = match runs::ended(run, store.is_held()?) {
        "killed" => "ended without an exit: it was killed, or its disk failed",
        other => other,
    };
    let left = if run.not_reached > 0 { "; `freeplay run` does those" } else { "" };
    let (id, done, not_reached) = (&run.run_id, count(run.done as usize, "log"), run.not_reached);
    let (estimated, refused, errors) = (run.estimated, run.refused, run.errors);
    Ok(format!(
        "  unfinished  {id}, begun {began}, {how}\n              {done} done ({estimated} estimated, {refused} refused, {errors} in error), {not_reached} not reached{left}\n",
    ))
}

fn in_json(store: &Store, found: &Info, age: Option<Duration>) -> Result<serde_json::Value, Failure> {
    let run = found.last_completed.as_ref();
    let is_held = store.is_held()?;
    let last = found.last.as_ref().map(|run| {
        json!({
            "run_id": run.run_id,
            "started_utc": run.started_utc,
            "ended": runs::ended(run, is_held),
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

fn verify(store: &Store, talk: &Talk) -> Result<Code, Failure> {
    let findings = store.verify();
    if findings.is_empty() {
        talk.answer(&format!("{} is whole\n", store.dir().display()))?;
        return Ok(Code::Well);
    }
    talk.complain_all(&findings);
    talk.answer(&format!("{} in {}\n", count(findings.len(), "finding"), store.dir().display()))?;
    Ok(Code::LogsInError)
}

fn adopt(store: &Store, trial: &Path, talk: &Talk) -> Result<Code, Failure> {
    let trial = Store::open(trial)?;
    let mut writer = store.lock(&Holder::this_process(), None)?;
    let progress = Progress::new("adopt", talk);
    let mut begun = false;
    let done = writer.promote(&trial, |tail, total| {
        if !std::mem::replace(&mut begun, true) {
            progress.total(total);
        }
        progress.finished(tail, 0, 0);
    });
    progress.end();
    let done = done?;
    talk.answer(&format!(
        "{} of {} taken over from {}{}\n  next  give pipeline.toml the settings of the trial; `freeplay run --dry-run` then finds nothing to do\n",
        count(done.records, "record"),
        count(done.logs, "log"),
        trial.dir().display(),
        match done.retired {
            0 => String::new(),
            retired => format!(", {} gone that it did not make", count(retired, "record")),
        },
    ))?;
    Ok(Code::Well)
}

fn compact(store: &Store, talk: &Talk) -> Result<Code, Failure> {
    let done = store.lock(&Holder::this_process(), None)?.compact()?;
    let deleted = count(done.deleted, "superseded file");
    talk.answer(&format!("merged {} into {}; {deleted} deleted\n", count(done.before, "file"), done.after))?;
    Ok(Code::Well)
}

fn export(store: &Store, output: &Output, talk: &Talk) -> Result<Code, Failure> {
    if output.format() == Format::Table {
        let records = store.records(&Query::default())?;
        rows::answer(output, talk, || Ok(store::columns::to_batch(&records)?), || query::page(&records))?;
    } else {
        let batch = store.scan(&Query::default())?;
        rows::answer(output, talk, || Ok(batch), String::new)?;
    }
    Ok(Code::Well)
}
