//! Work requests from their events, and the events of a person.

use std::collections::BTreeMap;

use jiff::Timestamp;
use records::{Diagnostic, WorkEvent, WorkEventKind, WorkRequest};

/// Every request, earliest first. A deferred request whose date is reached is open again.
pub fn requests(events: &[WorkEvent], now: Timestamp) -> Vec<WorkRequest> {
    let mut order = Vec::new();
    let mut by_id = BTreeMap::<&str, WorkRequest>::new();
    for event in events {
        let id = event.request_id.as_str();
        let request = by_id.entry(id).or_insert_with(|| {
            order.push(id);
            opened(event)
        });
        apply(request, event);
    }
    let mut requests: Vec<WorkRequest> = order.into_iter().filter_map(|id| by_id.remove(id)).collect();
    let is_due = |r: &&mut WorkRequest| r.status == "deferred" && r.until_utc.is_some_and(|at| at <= now);
    requests.iter_mut().filter(is_due).for_each(|request| request.status = "open");
    requests
}

fn opened(event: &WorkEvent) -> WorkRequest {
    WorkRequest {
        request_id: event.request_id.clone(),
        status: "open",
        state: event.state.clone(),
        part_number: event.part_number.clone(),
        serial_number: event.serial_number.clone(),
        tail_number: event.tail_number.clone(),
        position: event.position.clone(),
        quantity: event.quantity.clone(),
        finding: event.reason.clone(),
        opened_utc: event.as_of_utc,
        latest_flight_utc: event.latest_flight_utc,
        changed_utc: event.recorded_utc,
        ..WorkRequest::default()
    }
}

fn apply(request: &mut WorkRequest, event: &WorkEvent) {
    request.changed_utc = event.recorded_utc;
    match event.event {
        WorkEventKind::Opened | WorkEventKind::Reopened => {
            let WorkRequest { opened_utc, latest_flight_utc, .. } = *request;
            *request = WorkRequest { opened_utc, latest_flight_utc, ..opened(event) };
        }
        WorkEventKind::StateChanged => {
            (request.state, request.finding) = (event.state.clone(), event.reason.clone());
        }
        WorkEventKind::Moved => {
            (request.tail_number, request.position) = (event.tail_number.clone(), event.position.clone());
        }
        WorkEventKind::Returned => (request.status, request.until_utc) = ("open", None),
        kind => {
            request.by = Some(event.by.clone());
            request.reason.clone_from(&event.reason);
            request.until_utc = event.until_utc;
            request.status = match kind {
                WorkEventKind::Acknowledged => "acknowledged",
                WorkEventKind::Deferred => "deferred",
                _ => "closed",
            };
            if kind.closes() {
                request.state.clone_from(&event.state);
                request.closed_by = Some(kind.as_str().to_owned());
                request.closed_utc = Some(event.as_of_utc);
            }
        }
    }
}

/// What a person decides about a request.
#[derive(Debug, Clone, PartialEq, Eq)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub struct Decision {
    /// Acknowledged, deferred or closed.
    pub kind: WorkEventKind,
    pub by: String,
    pub reason: Option<String>,
    pub until_utc: Option<Timestamp>,
}

/// The event of a person's decision.
///
/// # Errors
/// A diagnostic when there is no such request, or it is closed.
pub fn decide(
    events: &[WorkEvent],
    id: &str,
    decision: Decision,
    now: Timestamp,
) -> Result<WorkEvent, Diagnostic> {
    let requests = requests(events, now);
    let is_named = |request: &&WorkRequest| request.request_id.eq_ignore_ascii_case(id);
    let Some(request) = requests.iter().find(is_named) else {
        return Err(Diagnostic::new("no_such_request", format!("no work request `{id}` in the store"))
            .hint("`freeplay work list --status all` lists them"));
    };
    if !request.is_open() {
        let how = request.closed_by.as_deref().unwrap_or("closed");
        let on = request.closed_utc.map(|at| format!(" on {}", at.strftime("%Y-%m-%d"))).unwrap_or_default();
        let what = format!("work request {} was {how}{on}", request.request_id);
        return Err(Diagnostic::new("request_closed", what).hint("`freeplay work list` lists the open ones"));
    }
    Ok(WorkEvent {
        number: next_number(events),
        event: decision.kind,
        by: decision.by,
        reason: decision.reason,
        until_utc: decision.until_utc,
        ..event_of(request, now)
    })
}

pub(crate) fn next_number(events: &[WorkEvent]) -> i64 {
    events.iter().map(|event| event.number).max().unwrap_or(0) + 1
}

/// An event of a request, with all that it does not change.
pub(crate) fn event_of(request: &WorkRequest, now: Timestamp) -> WorkEvent {
    WorkEvent {
        request_id: request.request_id.clone(),
        event: WorkEventKind::StateChanged,
        part_number: request.part_number.clone(),
        serial_number: request.serial_number.clone(),
        tail_number: request.tail_number.clone(),
        position: request.position.clone(),
        quantity: request.quantity.clone(),
        state: request.state.clone(),
        by: "freeplay".to_owned(),
        as_of_utc: now,
        recorded_utc: now,
        ..WorkEvent::default()
    }
}
