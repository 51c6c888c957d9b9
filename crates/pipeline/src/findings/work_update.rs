//! Events of work requests that follow from a run: findings, installations and the maintenance table.

use std::collections::BTreeMap;

use jiff::Timestamp;
use records::{Installation, Installations, WorkEvent, WorkEventKind, WorkRequest};
use trend::State;

use crate::findings::finding::Finding;
use crate::findings::work_requests::{event_of, next_number, requests};
use crate::fleet::bookkeeping::maintenance_log::MaintenanceLog;
use crate::fleet::flight_row::{DAY_US, is_day};
use crate::fleet::histories::{TailPosition, UnitKey};

/// What the tables of the operator hold about units.
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub struct Tables<'a> {
    pub installations: &'a Installations,
    pub maintenance: &'a MaintenanceLog,
    /// The date that counts: today, or that of the newest flight where it is later.
    pub at: Timestamp,
}

/// Events to add, in order.
pub fn update(
    events: &[WorkEvent],
    findings: &[Finding],
    tables: &Tables<'_>,
    run_id: &str,
    now: Timestamp,
) -> Vec<WorkEvent> {
    let requests = requests(events, now);
    let mut latest = BTreeMap::<(UnitKey, &str), &WorkRequest>::new();
    for request in &requests {
        latest.insert((request.unit(), &request.quantity), request);
    }
    let by_unit: BTreeMap<(UnitKey, &str), &Finding> =
        findings.iter().map(|finding| ((finding.unit.clone(), finding.quantity), finding)).collect();
    let mut found = Vec::new();
    for (key, request) in &latest {
        let finding = by_unit.get(key).copied();
        if request.is_open() {
            found.extend(of_open(request, finding, tables, now));
        } else if let Some(finding) = finding {
            found.extend(of_closed(request, finding, tables, now));
        }
    }
    let is_new = |finding: &&Finding| !latest.contains_key(&(finding.unit.clone(), finding.quantity));
    found.extend(findings.iter().filter(is_new).filter_map(|finding| open(finding, tables, now)));
    number(events, found, run_id)
}

/// Gives events their numbers, and new requests their identifiers.
fn number(events: &[WorkEvent], mut found: Vec<WorkEvent>, run_id: &str) -> Vec<WorkEvent> {
    let first = next_number(events);
    let used = events.iter().filter_map(|event| event.request_id.strip_prefix('W')?.parse::<u64>().ok());
    let mut last_id = used.max().unwrap_or(0);
    for (event, number) in found.iter_mut().zip(first..) {
        event.number = number;
        event.run_id = Some(run_id.to_owned());
        if event.request_id.is_empty() {
            last_id += 1;
            event.request_id = format!("W{last_id}");
        }
    }
    found
}

fn of_open(
    request: &WorkRequest,
    finding: Option<&Finding>,
    tables: &Tables<'_>,
    now: Timestamp,
) -> Vec<WorkEvent> {
    let name = request.unit();
    let event = |event: WorkEventKind| WorkEvent { event, ..event_of(request, now) };
    let state = finding.and_then(|finding| finding.state);
    let closed = |kind: WorkEventKind, reason: String, as_of_utc: Timestamp| {
        let state = state.map(str::to_owned).or_else(|| request.state.clone());
        vec![WorkEvent { state, reason: Some(reason), as_of_utc, ..event(kind) }]
    };
    if let Some(repaired) = tables.repair_after(&name, request.found_until()) {
        let reason = format!("repair of {} in the maintenance table", repaired.strftime("%Y-%m-%d"));
        return closed(WorkEventKind::Maintained, reason, repaired);
    }
    if let Some((last, removed)) = tables.removal(&name) {
        let date = removed.strftime("%Y-%m-%d");
        let reason = format!("removed from {} of {} on {date}", last.position, last.tail_number);
        return closed(WorkEventKind::Removed, reason, removed);
    }
    if finding.is_none() && tables.installations.of_unit(&name).next().is_none() {
        let reason = "the unit no longer has an installation or a record".to_owned();
        return closed(WorkEventKind::Removed, reason, now);
    }
    let known = TailPosition { tail_number: request.tail_number.clone(), position: request.position.clone() };
    let installed = tables.place(&name);
    let place = installed.map_or_else(|| known.clone(), TailPosition::of);
    let mut found = Vec::new();
    if let Some(installed) = installed.filter(|_| place != known) {
        found.push(WorkEvent { as_of_utc: installed.installed_utc, ..event(WorkEventKind::Moved) });
    }
    let is_worse = rank(state) > rank(request.state.as_deref());
    let is_due = request.status == "open" && request.until_utc.is_some();
    // What a person decided, they decided about a less urgent state.
    if is_due || (request.status != "open" && is_worse) {
        found.push(event(WorkEventKind::Returned));
    }
    found.extend(finding.and_then(|finding| state_change(request, finding, now)));
    // The place of a move is that of the events after it.
    for event in &mut found {
        (event.tail_number, event.position) = (place.tail_number.clone(), place.position.clone());
    }
    found
}

/// A closed request is opened again when the unit returns from stock as it was, or when its repair is no longer in the
/// maintenance table; it is followed by a new one when the unit is worse than when it was closed, or is found so by flights
/// after its repair.
fn of_closed(
    request: &WorkRequest,
    finding: &Finding,
    tables: &Tables<'_>,
    now: Timestamp,
) -> Option<WorkEvent> {
    let is_installed = tables.removal(&finding.unit).is_none();
    if !wants_work(finding.state) || !is_installed {
        return state_change(request, finding, now);
    }
    let is_after = |fact: Option<Timestamp>| fact > request.closed_utc;
    let is_withdrawn = || tables.repair_after(&finding.unit, request.found_until()).is_none();
    match request.closed_by.as_deref() {
        Some(by) if by == "removed" || (by == "maintained" && is_withdrawn()) => {
            let again = open(finding, tables, now)?;
            let id = request.request_id.clone();
            Some(WorkEvent { event: WorkEventKind::Reopened, request_id: id, ..again })
        }
        Some("maintained") if is_after(finding.latest_flight_utc) => open(finding, tables, now),
        _ if rank(finding.state) > rank(request.state.as_deref()) => open(finding, tables, now),
        _ => state_change(request, finding, now),
    }
}

fn state_change(request: &WorkRequest, finding: &Finding, now: Timestamp) -> Option<WorkEvent> {
    let state = finding.state.filter(|state| request.state.as_deref() != Some(state))?;
    Some(WorkEvent {
        event: WorkEventKind::StateChanged,
        state: Some(state.to_owned()),
        reason: finding.reason.clone(),
        as_of_utc: finding.as_of_utc,
        ..event_of(request, now)
    })
}

/// A new request, without its identifier.
fn open(finding: &Finding, tables: &Tables<'_>, now: Timestamp) -> Option<WorkEvent> {
    if !wants_work(finding.state) || tables.removal(&finding.unit).is_some() {
        return None;
    }
    let (tail_number, position) = (finding.tail_number.clone(), finding.position.clone());
    let installed = tables.place(&finding.unit).map(TailPosition::of);
    let TailPosition { tail_number, position } = installed.unwrap_or(TailPosition { tail_number, position });
    Some(WorkEvent {
        event: WorkEventKind::Opened,
        part_number: finding.unit.0.clone(),
        serial_number: finding.unit.1.clone(),
        tail_number,
        position,
        quantity: finding.quantity.to_owned(),
        state: finding.state.map(str::to_owned),
        reason: finding.reason.clone(),
        by: "freeplay".to_owned(),
        as_of_utc: finding.as_of_utc,
        latest_flight_utc: finding.latest_flight_utc,
        recorded_utc: now,
        ..WorkEvent::default()
    })
}

fn wants_work(state: Option<&str>) -> bool {
    rank(state) >= State::Plan
}

/// Order of states; a removed unit is as urgent as a normal one.
fn rank(state: Option<&str>) -> State {
    state.and_then(|word| word.parse().ok()).unwrap_or(State::Normal)
}

impl<'a> Tables<'a> {
    /// The last installation and the removal of a unit that is installed nowhere.
    fn removal(&self, name: &UnitKey) -> Option<(&'a Installation, Timestamp)> {
        let last = self.installations.removal(name, self.at)?;
        Some((last, last.removed_utc?))
    }

    fn place(&self, name: &UnitKey) -> Option<&'a Installation> {
        self.installations.installed(name, self.at)
    }

    /// The first repair after a date that makes the unit as good as new. A repair without a time counts for its whole
    /// day.
    fn repair_after(&self, name: &UnitKey, after: Timestamp) -> Option<Timestamp> {
        let whole_day = |us: i64| if is_day(us) { us + DAY_US - 1 } else { us };
        let repairs = self.maintenance.get(name)?.iter().filter(|event| event.renews);
        let mut ends = repairs.map(|event| whole_day(event.utc_us));
        let end = ends.find(|us| *us > after.as_microsecond() && *us - DAY_US < self.at.as_microsecond())?;
        Timestamp::from_microsecond(end).ok()
    }
}
