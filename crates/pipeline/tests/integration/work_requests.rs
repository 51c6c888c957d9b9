//! Work requests against the tables of an operator: what opens, moves, closes and reopens them.
//!
//! Each story of `work_requests.txt` is the desk of a planner, day by day: a line is what happens, and after `->` what comes
//! of it. A run has the latest flight at 08:00 of its day, or at the time after `@`.

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

/// A planner's desk: the events so far, and the tables.
#[derive(Default)]
struct Desk {
    events: Vec<WorkEvent>,
    installations: Vec<Installation>,
    maintenance: MaintenanceLog,
    runs: usize,
}

impl Desk {
    fn step(&mut self, line: &str) -> Vec<String> {
        let words: Vec<&str> = line.split_whitespace().collect();
        match words.as_slice() {
            ["unit", serial, tail, from, to @ ..] => {
                let is_other =
                    |row: &Installation| row.unit().1.as_str() != *serial || row.removed_utc.is_some();
                self.installations.retain(is_other);
                let names = [*tail, "aileron", "EMA", *serial];
                let to = to.first().map(|to| utc(to));
                self.installations.push(fleet::installation(names, utc(from), to));
                Vec::new()
            }
            ["run", day, states @ ..] => self.run(day, states),
            [kind @ ("repair" | "lubrication"), serial, at] => {
                let unit = (Some("EMA".to_owned()), (*serial).to_owned());
                let event = MaintenanceEvent { utc_us: utc(at).as_microsecond(), renews: *kind == "repair" };
                self.maintenance.entry(unit).or_default().push(event);
                Vec::new()
            }
            ["decide", day, id, kind, until @ ..] => self.decide(day, id, kind, until.first().copied()),
            ["status", day] => {
                let text = |r: WorkRequest| format!("{} {} {}", r.request_id, r.serial_number, r.status);
                self.requests(day).into_iter().map(text).collect()
            }
            ["request", day, id, fields @ ..] => {
                let requests = self.requests(day);
                let request = requests.iter().find(|request| request.request_id == *id).unwrap();
                let request = serde_json::to_value(request).unwrap();
                fields.iter().map(|field| request[field].as_str().unwrap().to_owned()).collect()
            }
            _ => panic!("{line} is no line of a story"),
        }
    }

    fn run(&mut self, day: &str, states: &[&str]) -> Vec<String> {
        let at = states.iter().find_map(|word| word.strip_prefix('@'));
        let flight = at.map_or_else(|| utc(&format!("{day}T08:00:00Z")), utc);
        let findings: Vec<Finding> = states
            .iter()
            .filter_map(|word| word.split_once('='))
            .map(|(serial, word)| Finding {
                unit: (Some("EMA".to_owned()), serial.to_owned()),
                tail_number: Some("T-OF-FLIGHT".to_owned()),
                position: Some("aileron".to_owned()),
                quantity: GAP,
                state: ["normal", "watch", "plan", "act"].into_iter().find(|state| *state == word),
                since_utc: None,
                as_of_utc: utc(&format!("{day}T20:00:00Z")),
                latest_flight_utc: Some(flight),
                ..Finding::default()
            })
            .collect();
        let installations = Installations::new(self.installations.clone()).unwrap();
        let now = utc(&format!("{day}T20:00:00Z"));
        let tables = Tables { installations: &installations, maintenance: &self.maintenance, at: now };
        self.runs += 1;
        let run_id = format!("R{}", self.runs);
        let found = work_update::update(&self.events, &findings, &tables, &run_id, now);
        let kinds = found.iter().map(|event| event.event.as_str().to_owned()).collect();
        self.events.extend(found);
        // A run that is repeated finds nothing to do.
        let again = work_update::update(&self.events, &findings, &tables, &run_id, now);
        assert_eq!(again, [], "{day}");
        kinds
    }

    /// A decision of a person, and the code of its error.
    fn decide(&mut self, day: &str, id: &str, kind: &str, until: Option<&str>) -> Vec<String> {
        let kinds = [WorkEventKind::Acknowledged, WorkEventKind::Deferred, WorkEventKind::Closed];
        let kind = kinds.into_iter().find(|known| known.as_str() == kind).unwrap();
        let (by, reason) = ("M. Kaya".to_owned(), Some("C-check".to_owned()));
        let decision = Decision { kind, by, reason, until_utc: until.map(utc) };
        let now = utc(&format!("{day}T21:00:00Z"));
        let decided = work_requests::decide(&self.events, id, decision, now);
        decided.map(|event| self.events.push(event)).err().map(|error| error.code).into_iter().collect()
    }

    fn requests(&self, day: &str) -> Vec<WorkRequest> {
        work_requests::requests(&self.events, utc(&format!("{day}T22:00:00Z")))
    }
}

#[test]
fn requests_open_move_close_and_reopen_as_the_stories_tell() {
    let mut stories = 0;
    for story in include_str!("../data/work_requests.txt").split("\n\n") {
        let title = story.lines().next().unwrap();
        let mut desk = Desk::default();
        for line in story.lines().filter(|line| !line.starts_with('#')) {
            let (happens, expected) = line.split_once(" ->").unwrap();
            assert_eq!(desk.step(happens).join(", "), expected.trim(), "{title}: {line}");
        }
        stories += 1;
    }
    assert_eq!(stories, 9);
}

/// Numbers never repeat, whatever is interleaved; a run between two commands sees their events.
#[test]
fn events_are_numbered_and_a_request_is_opened_once() {
    let mut desk = Desk::default();
    let mut states = ["plan", "act", "normal", "-"].into_iter().cycle();
    for day in 1..=28 {
        let today: Vec<String> = (0..20).map(|unit| format!("S{unit}={}", states.next().unwrap())).collect();
        states.next();
        desk.step(&format!("run 2026-03-{day:02} {}", today.join(" ")));
        desk.step(&format!("decide 2026-03-{day:02} W3 deferred 2026-03-15"));
    }
    let numbers: Vec<i64> = desk.events.iter().map(|event| event.number).collect();
    assert_eq!(numbers, (1..=numbers.len() as i64).collect::<Vec<_>>());
    let requests = desk.requests("2026-03-28");
    assert_eq!(requests.len(), 20, "one request for each unit");
    assert!(requests.iter().all(WorkRequest::is_open));
}
