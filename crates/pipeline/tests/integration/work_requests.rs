//! Work requests against the tables of an operator: what opens, moves, closes and reopens them.

use jiff::Timestamp;
use pipeline::findings::finding::{Finding, GAP};
use pipeline::findings::work_requests::{self, Decision};
use pipeline::findings::work_update::{self, Tables};
use pipeline::fleet::bookkeeping::maintenance_log::MaintenanceLog;
use records::{Installation, Installations, WorkEvent, WorkEventKind, WorkRequest};
use trend::MaintenanceEvent;

use crate::fleet;

fn utc(text: &str) -> Timestamp {
    let text = if text.contains('T') { text.to_owned() } else { format!("{text}T00:00:00Z") };
    text.parse().unwrap()
}

fn installation(serial: &str, tail: &str, from: &str, to: Option<&str>) -> Installation {
    fleet::installation([tail, "aileron", "EMA", serial], utc(from), to.map(utc))
}

/// A planner's desk: the events so far, and the tables.
#[derive(Default)]
struct Desk {
    events: Vec<WorkEvent>,
    installations: Vec<Installation>,
    maintenance: MaintenanceLog,
    runs: usize,
}

impl Desk {
    fn with(installations: &[Installation]) -> Self {
        Self { installations: installations.to_vec(), ..Self::default() }
    }

    /// A run on a day, with the latest flight at 08:00 of that day.
    fn run(&mut self, day: &str, states: &[(&str, Option<&'static str>)]) -> Vec<&'static str> {
        let flight = utc(&format!("{day}T08:00:00Z"));
        self.run_after(day, flight, states)
    }

    fn run_after(
        &mut self,
        day: &str,
        flight: Timestamp,
        states: &[(&str, Option<&'static str>)],
    ) -> Vec<&'static str> {
        let findings: Vec<Finding> = states
            .iter()
            .map(|(serial, state)| Finding {
                unit: (Some("EMA".to_owned()), (*serial).to_owned()),
                tail_number: Some("T-OF-FLIGHT".to_owned()),
                position: Some("aileron".to_owned()),
                quantity: GAP,
                state: *state,
                since_utc: None,
                as_of_utc: flight,
                latest_flight_utc: Some(flight),
                ..Finding::default()
            })
            .collect();
        let installations = Installations::new(self.installations.clone()).unwrap();
        let now = utc(&format!("{day}T20:00:00Z"));
        let tables = Tables::new(&installations, &self.maintenance, now);
        self.runs += 1;
        let run_id = format!("R{}", self.runs);
        let found = work_update::update(&self.events, &findings, &tables, &run_id, now);
        let kinds = found.iter().map(|event| event.event.as_str()).collect();
        self.events.extend(found);
        // A run that is repeated finds nothing to do.
        let again = work_update::update(&self.events, &findings, &tables, &run_id, now);
        assert_eq!(again, [], "{day}");
        kinds
    }

    fn repair(&mut self, serial: &str, at: &str, renews: bool) {
        let unit = ("EMA".to_owned(), serial.to_owned());
        let event = MaintenanceEvent { utc_us: utc(at).as_microsecond(), renews };
        self.maintenance.entry(unit).or_default().push(event);
    }

    fn decide(
        &mut self,
        day: &str,
        id: &str,
        kind: WorkEventKind,
        until: Option<&str>,
    ) -> Result<(), String> {
        let (by, reason) = ("M. Kaya".to_owned(), Some("C-check".to_owned()));
        let decision = Decision { kind, by, reason, until_utc: until.map(utc) };
        let now = utc(&format!("{day}T21:00:00Z"));
        let event = work_requests::decide(&self.events, id, decision, now).map_err(|d| d.code)?;
        self.events.push(event);
        Ok(())
    }

    fn requests(&self, day: &str) -> Vec<WorkRequest> {
        work_requests::requests(&self.events, utc(&format!("{day}T22:00:00Z")))
    }

    fn statuses(&self, day: &str) -> Vec<String> {
        let text = |r: WorkRequest| format!("{} {} {}", r.request_id, r.serial_number, r.status);
        self.requests(day).into_iter().map(text).collect()
    }
}

#[test]
fn a_request_opens_on_plan_and_stays_one_until_a_repair_is_entered() {
    let mut desk = Desk::with(&[installation("7", "N1", "2026-01-01", None)]);
    assert_eq!(desk.run("2026-03-01", &[("7", Some("watch")), ("8", Some("normal"))]), [""; 0]);
    assert_eq!(desk.run("2026-03-02", &[("7", Some("plan")), ("8", Some("normal"))]), ["opened"]);
    let request = &desk.requests("2026-03-02")[0];
    assert_eq!((request.request_id.as_str(), request.status), ("W1", "open"));
    assert_eq!(request.tail_number.as_deref(), Some("N1"), "the place is that of the installations table");
    assert_eq!(
        desk.run("2026-03-03", &[("7", Some("act")), ("8", Some("act"))]),
        ["state_changed", "opened"]
    );
    // Back to normal without a repair: the finding still waits for its reason.
    assert_eq!(desk.run("2026-03-04", &[("7", Some("normal")), ("8", Some("act"))]), ["state_changed"]);
    assert_eq!(desk.statuses("2026-03-04"), ["W1 7 open", "W2 8 open"]);
    desk.repair("8", "2026-03-04T10:00:00Z", false);
    assert_eq!(desk.run("2026-03-05", &[("8", Some("act"))]), [""; 0], "lubrication is no repair");
    desk.repair("8", "2026-03-05T10:00:00Z", true);
    assert_eq!(desk.run("2026-03-06", &[("8", Some("normal"))]), ["maintained"]);
    assert_eq!(desk.statuses("2026-03-06"), ["W1 7 open", "W2 8 closed"]);
    let closed = &desk.requests("2026-03-06")[1];
    assert_eq!(closed.closed_by.as_deref(), Some("maintained"));
    assert_eq!(closed.closed_utc, Some(utc("2026-03-05T10:00:00Z")));
    // A year later the next one.
    assert_eq!(desk.run("2027-03-06", &[("8", Some("plan"))]), ["opened"]);
    assert_eq!(desk.statuses("2027-03-06"), ["W1 7 open", "W2 8 closed", "W3 8 open"]);
}

#[test]
fn a_repair_that_did_not_help_opens_the_next_request_with_its_first_flight() {
    let mut desk = Desk::with(&[installation("7", "N1", "2026-01-01", None)]);
    let flight = utc("2026-03-01T08:00:00Z");
    desk.run_after("2026-03-01", flight, &[("7", Some("act"))]);
    // Entered without a time, on the day of the last flight.
    desk.repair("7", "2026-03-01", true);
    assert_eq!(desk.run_after("2026-03-02", flight, &[("7", Some("act"))]), ["maintained"]);
    assert_eq!(desk.run_after("2026-03-03", flight, &[("7", Some("act"))]), [""; 0], "no flight since");
    assert_eq!(desk.run("2026-03-04", &[("7", Some("act"))]), ["opened"]);
}

/// A repair before the finding, and one that is only planned, close nothing.
#[test]
fn only_a_repair_after_the_finding_and_before_today_closes() {
    let mut desk = Desk::with(&[installation("7", "N1", "2026-01-01", None)]);
    desk.repair("7", "2026-02-01", true);
    desk.repair("7", "2026-04-01", true);
    assert_eq!(desk.run("2026-03-01", &[("7", Some("act"))]), ["opened"]);
    assert_eq!(desk.run("2026-03-31", &[("7", Some("act"))]), [""; 0]);
    assert_eq!(desk.run("2026-04-01", &[("7", Some("act"))]), ["maintained"]);
}

#[test]
fn a_removal_closes_and_the_request_returns_with_the_serial_number() {
    let mut desk = Desk::with(&[installation("7", "N1", "2026-01-01", None)]);
    desk.run("2026-03-01", &[("7", Some("act"))]);
    desk.installations = vec![installation("7", "N1", "2026-01-01", Some("2026-03-02T12:00:00Z"))];
    assert_eq!(desk.run("2026-03-02", &[("7", None)]), ["removed"]);
    // The newest flight of the fleet may be older than the removal: the state is still that of the flights.
    assert_eq!(desk.run_after("2026-03-03", utc("2026-03-01T08:00:00Z"), &[("7", Some("act"))]), [""; 0]);
    assert_eq!(desk.run("2026-03-20", &[("7", None)]), [""; 0], "a part in stock wants no work");
    desk.installations.push(installation("7", "N2", "2026-03-21", None));
    assert_eq!(desk.run("2026-03-22", &[("7", Some("act"))]), ["reopened"]);
    let requests = desk.requests("2026-03-22");
    assert_eq!(requests.len(), 1, "the same request");
    assert_eq!((requests[0].status, requests[0].tail_number.as_deref()), ("open", Some("N2")));
    assert_eq!(requests[0].opened_utc, utc("2026-03-01T08:00:00Z"));
}

#[test]
fn a_unit_that_changes_its_place_takes_its_request_with_it() {
    let mut desk = Desk::with(&[installation("7", "N1", "2026-01-01", None)]);
    desk.run("2026-03-01", &[("7", Some("plan"))]);
    desk.decide("2026-03-01", "W1", WorkEventKind::Acknowledged, None).unwrap();
    desk.installations = vec![
        installation("7", "N1", "2026-01-01", Some("2026-03-02")),
        installation("7", "N2", "2026-03-02", None),
    ];
    assert_eq!(desk.run("2026-03-03", &[("7", Some("act"))]), ["moved", "state_changed"]);
    let request = &desk.requests("2026-03-03")[0];
    assert_eq!((request.status, request.tail_number.as_deref()), ("acknowledged", Some("N2")));
    assert_eq!(request.by.as_deref(), Some("M. Kaya"));
}

#[test]
fn a_deferred_request_comes_back_on_its_date_or_when_it_becomes_worse() {
    let mut desk = Desk::with(&[
        installation("7", "N1", "2026-01-01", None),
        installation("8", "N2", "2026-01-01", None),
    ]);
    let both = |state| [("7", Some("plan")), ("8", Some(state))];
    desk.run("2026-03-01", &both("plan"));
    for id in ["W1", "w2"] {
        desk.decide("2026-03-01", id, WorkEventKind::Deferred, Some("2026-03-10")).unwrap();
    }
    assert_eq!(desk.run("2026-03-02", &both("plan")), [""; 0]);
    assert_eq!(desk.statuses("2026-03-02"), ["W1 7 deferred", "W2 8 deferred"]);
    assert_eq!(desk.run("2026-03-03", &both("act")), ["returned", "state_changed"]);
    assert_eq!(desk.statuses("2026-03-03"), ["W1 7 deferred", "W2 8 open"]);
    // On its date, also before the next run.
    assert_eq!(desk.statuses("2026-03-10"), ["W1 7 open", "W2 8 open"]);
    assert_eq!(desk.run("2026-03-11", &both("act")), ["returned"]);
    assert_eq!(desk.requests("2026-03-11")[0].reason.as_deref(), Some("C-check"));
}

#[test]
fn a_request_closed_by_a_person_is_followed_by_one_only_when_the_unit_is_worse() {
    let mut desk = Desk::with(&[installation("7", "N1", "2026-01-01", None)]);
    desk.run("2026-03-01", &[("7", Some("plan"))]);
    desk.decide("2026-03-01", "W1", WorkEventKind::Closed, None).unwrap();
    let again = desk.decide("2026-03-01", "W1", WorkEventKind::Acknowledged, None);
    assert_eq!(again, Err("request_closed".to_owned()));
    assert_eq!(
        desk.decide("2026-03-01", "W9", WorkEventKind::Closed, None),
        Err("no_such_request".to_owned())
    );
    assert_eq!(desk.run("2026-03-02", &[("7", Some("plan"))]), [""; 0]);
    assert_eq!(desk.run("2026-03-03", &[("7", None)]), [""; 0], "a pause of the data is no recovery");
    assert_eq!(desk.run("2026-03-04", &[("7", Some("plan"))]), [""; 0]);
    assert_eq!(desk.run("2026-03-05", &[("7", Some("act"))]), ["opened"]);
    desk.decide("2026-03-05", "W2", WorkEventKind::Closed, None).unwrap();
    assert_eq!(desk.run("2026-03-06", &[("7", Some("normal"))]), ["state_changed"]);
    assert_eq!(desk.run("2026-03-07", &[("7", Some("plan"))]), ["opened"]);
    assert_eq!(desk.statuses("2026-03-07"), ["W1 7 closed", "W2 7 closed", "W3 7 open"]);
}

/// Numbers never repeat, whatever is interleaved; a run between two commands sees their events.
#[test]
fn events_are_numbered_and_a_request_is_opened_once() {
    let mut desk = Desk::default();
    let units: Vec<String> = (0..20).map(|n| format!("S{n}")).collect();
    let mut states = [Some("plan"), Some("act"), Some("normal"), None].into_iter().cycle();
    for day in 1..=28 {
        let today: Vec<(&str, Option<&'static str>)> =
            units.iter().map(|unit| (unit.as_str(), states.next().unwrap())).collect();
        states.next();
        let day = format!("2026-03-{day:02}");
        desk.run(&day, &today);
        let _ = desk.decide(&day, "W3", WorkEventKind::Deferred, Some("2026-03-15"));
    }
    let numbers: Vec<i64> = desk.events.iter().map(|event| event.number).collect();
    assert_eq!(numbers, (1..=numbers.len() as i64).collect::<Vec<_>>());
    let requests = desk.requests("2026-03-28");
    assert_eq!(requests.len(), 20, "one request for each unit");
    assert!(requests.iter().all(WorkRequest::is_open));
}
