//! `work`: lists work requests, and records what people decide about them.

use std::collections::BTreeMap;
use std::time::Duration;

use jiff::Timestamp;
use job::Config;
use pipeline::findings::work_list::{self, WorkSelection};
use pipeline::findings::work_requests::{self, Decision};
use pipeline::fleet::histories::UnitKey;
use records::{TrendRow, WorkEventKind, WorkRequest};
use store::Store;

use crate::args::{Global, WorkArgs, WorkCommand, WorkDecisionArgs, WorkListArgs};
use crate::commands::context::{KnownNames, load_config};
use crate::output::escape;
use crate::table::{self, count, or_dash, state_mark, text, unit_name};
use crate::{Code, Failure, Output, row_output};

/// Longest wait for a run that writes into the store.
const WAIT: Duration = Duration::from_mins(1);

/// Lists requests, or records a decision.
///
/// # Errors
/// If configuration or store cannot be read or written, or there is no such open request.
pub(crate) fn work(args: &WorkArgs, global: &Global, output: &Output) -> Result<Code, Failure> {
    let config = load_config(global)?;
    let store = Store::open(config.store())?;
    let (who, kind, reason, until_utc) = match &args.command {
        WorkCommand::List(args) => return list(&config, args, output),
        WorkCommand::Acknowledge { who, reason } => (who, WorkEventKind::Acknowledged, reason.clone(), None),
        WorkCommand::Defer { who, until, reason } => {
            (who, WorkEventKind::Deferred, Some(reason.clone()), Some(*until))
        }
        WorkCommand::Close { who, reason } => (who, WorkEventKind::Closed, Some(reason.clone()), None),
    };
    if until_utc.is_some_and(|until| until <= Timestamp::now()) {
        let what = "the date of `--until` has passed";
        return Err(Failure::usage("date_passed", what, "give a later date, e.g. `--until 2031-01-31`"));
    }
    decide(&store, who, Decision { kind, by: who.by.clone(), reason, until_utc }, output)
}

fn decide(
    store: &Store,
    who: &WorkDecisionArgs,
    decision: Decision,
    output: &Output,
) -> Result<Code, Failure> {
    let blank =
        [Some(&decision.by), decision.reason.as_ref()].into_iter().flatten().any(|t| t.trim().is_empty());
    if blank {
        let what = "the name or the reason is empty";
        return Err(Failure::usage("empty_name", what, "give `--by NAME` and `--reason TEXT`"));
    }
    let mut writer = store.lock(Some(WAIT))?;
    // Read under the lock: a run may have closed the request in the meantime.
    let mut events = store.work_events()?;
    let now = Timestamp::now();
    let event = work_requests::decide(&events, &who.request, decision, now)
        .map_err(|diagnostic| Failure::Refused(vec![diagnostic]))?;
    writer.add_work_events(std::slice::from_ref(&event))?;
    let id = event.request_id.clone();
    events.push(event);
    let requests = work_requests::requests(&events, now);
    let Some(request) = requests.iter().find(|request| request.request_id == id) else {
        return Ok(Code::Success);
    };
    let by = escape(&who.by);
    output.write_result(&format!(
        "{id}: {}; {} by {by}\n",
        escape(&unit_name(request.part_number.as_deref(), &request.serial_number)),
        request.status_text()
    ))?;
    Ok(Code::Success)
}

fn list(config: &Config, args: &WorkListArgs, output: &Output) -> Result<Code, Failure> {
    let selection = WorkSelection { status: args.status.clone(), units: args.units.selection(None) };
    let (found, units) = work_list::work_list(config, &selection)?;
    if found.is_empty() {
        KnownNames::of(config).check_units(&args.units)?;
    }
    row_output::write_rows(&args.rows, output, || row_output::batch(&found), || page(&found, &units))?;
    Ok(Code::Success)
}

fn page(found: &[WorkRequest], units: &BTreeMap<UnitKey, TrendRow>) -> String {
    if found.is_empty() {
        return "no work request\n".to_owned();
    }
    // A closed request shows the state and the reason that it had when it was closed.
    let present = |r: &WorkRequest| {
        units.get(&(r.part_number.clone(), r.serial_number.clone())).filter(|_| r.is_open())
    };
    let columns: &table::Columns<'_, WorkRequest> = &[
        (text("request", 0), &|r| r.request_id.clone()),
        (text("state", 0), &|r| state_mark(r.state.as_deref())),
        (text("due", 0), &|r| or_dash(present(r).and_then(TrendRow::due_text).as_deref())),
        (text("tail", 0), &|r| or_dash(r.tail_number.as_deref())),
        (text("position", 0), &|r| or_dash(r.position.as_deref())),
        (text("serial", 0), &|r| r.serial_number.clone()),
        (text("status", 1), &WorkRequest::status_text),
        (text("by", 2), &|r| or_dash(r.by.as_deref())),
        (text("part", 3), &|r| or_dash(r.part_number.as_deref())),
        (text("opened", 4), &|r| day(r.opened_utc)),
        (text("remark", 5), &|r| or_dash(r.reason.as_deref())),
        (text("why, and how sure", 0), &|r| {
            present(r).map_or_else(|| or_dash(r.finding.as_deref()), TrendRow::statement_text)
        }),
    ];
    let with = |status: &str| found.iter().filter(|request| request.status == status).count();
    let counts = ["open", "acknowledged", "deferred", "closed"].map(|status| (with(status), status));
    let counts = counts.into_iter().filter(|(n, _)| *n > 0).map(|(n, status)| format!("{n} {status}"));
    let head = format!("{}: {}\n", count(found.len(), "work request"), counts.collect::<Vec<_>>().join(", "));
    let next = found.iter().find(|request| request.status == "open").map_or_else(String::new, |request| {
        let id = &request.request_id;
        format!(
            "next: `freeplay work acknowledge {id}`, `defer {id} --until DATE --reason TEXT`, or\n      \
             `close {id} --reason TEXT`\n"
        )
    });
    head + &table::of(found, columns) + &next
}

fn day(at: Timestamp) -> String {
    at.strftime("%Y-%m-%d").to_string()
}
