//! Alerts under kills: every change is sent exactly once, or is marked as unconfirmed.

use std::collections::{BTreeMap, BTreeSet};

use jiff::Timestamp;
use job::config::AlertChannel;
use pipeline::findings::alert_changes::{self, Channels};
use pipeline::findings::delivery::{self, Attempt, Courier};
use pipeline::findings::finding::{Finding, GAP};
use pipeline::findings::summary::AlertSummary;
use records::{AlertRecord, AlertStatus};
use serde_json::Value;

const STATES: [Option<&str>; 5] = [None, Some("normal"), Some("watch"), Some("plan"), Some("act")];

/// Names that break shells, JSON, paths and terminals.
const SERIALS: [&str; 6] =
    ["1040-0009", "../../etc/x", "$(reboot)", "\"},{\"id\":\"", "S\n\u{202e}1", "Ünït 7"];

fn finding(serial: &str, state: Option<&'static str>, day: i64) -> Finding {
    let as_of_utc = Timestamp::from_second(1_780_000_000 + 86_400 * day).unwrap();
    Finding {
        unit: (Some("EMA".to_owned()), serial.to_owned()),
        tail_number: Some("N412FP".to_owned()),
        position: Some("aileron".to_owned()),
        quantity: GAP,
        state,
        reason: Some("of a test".to_owned()),
        as_of_utc,
        latest_flight_utc: Some(as_of_utc),
        ..Finding::default()
    }
}

/// A folder, a command, and an address whose receiver drops doubles; all of them get every change.
fn channels() -> Channels {
    let states: Vec<String> = STATES.iter().map(|state| state.unwrap_or("not_assessed").to_owned()).collect();
    let channel = AlertChannel { states, ..AlertChannel::default() };
    let folder = AlertChannel { folder: Some("alerts".to_owned()), ..channel.clone() };
    let command = AlertChannel { command: Some(vec!["notify".to_owned()]), ..channel.clone() };
    let url = AlertChannel { url: Some("http://localhost/".to_owned()), resend_unconfirmed: true, ..channel };
    [("command", command), ("folder", folder), ("url", url)].map(|(name, of)| (name.to_owned(), of)).into()
}

#[derive(Debug, PartialEq)]
struct Killed;

/// A table in memory, receivers, and a kill before or after the n-th write.
#[derive(Default)]
struct World {
    table: BTreeMap<(String, String), AlertRecord>,
    received: Vec<(String, String)>,
    random: fastrand::Rng,
    /// Writes until the kill, and whether the last of them is durable.
    kill_in: Option<(u64, bool)>,
    is_calm: bool,
    /// Serial numbers whose messages the receivers refuse.
    refused: BTreeSet<String>,
    attempts: usize,
}

impl World {
    fn write_all(&mut self, rows: &[AlertRecord]) -> Result<(), Killed> {
        let (is_last, is_durable) = match &mut self.kill_in {
            Some((0, is_durable)) => (true, *is_durable),
            Some((left, _)) => {
                *left -= 1;
                (false, true)
            }
            None => (false, true),
        };
        if is_durable {
            let key = |row: &AlertRecord| (row.alert_id.clone(), row.channel.clone());
            self.table.extend(rows.iter().map(|row| (key(row), row.clone())));
        }
        if is_last { Err(Killed) } else { Ok(()) }
    }

    /// What a run does after its assessments; returns the changes it has written.
    fn run(&mut self, findings: &[Finding], number: u64) -> (usize, Result<(), Killed>) {
        let channels = channels();
        let mut rows: Vec<AlertRecord> = self.table.values().cloned().collect();
        let known = rows.len();
        let now = Timestamp::UNIX_EPOCH;
        let run_id = format!("run {number}");
        let found = alert_changes::detect(&rows, findings, &channels, &run_id, now);
        let is_new = |row: &&AlertRecord| row.channel.is_empty() && row.kind == "change";
        let changes = found.iter().filter(is_new).count();
        if !found.is_empty()
            && let Err(killed) = self.write_all(&found)
        {
            let written = if self.table.len() > known { changes } else { 0 };
            return (written, Err(killed));
        }
        rows.extend(found);
        let summary = &mut AlertSummary::default();
        (changes, delivery::deliver(rows, &channels, &run_id, self, summary).map(drop))
    }
}

impl Courier for World {
    type Error = Killed;

    fn write(&mut self, rows: &[AlertRecord]) -> Result<(), Killed> {
        self.write_all(rows)
    }

    fn send(&mut self, _: &AlertChannel, row: &AlertRecord) -> Attempt {
        let why = "a fault".to_owned();
        self.attempts += 1;
        let (attempt, is_received) = match self.random.u64(..10) {
            _ if row.serial_number.as_ref().is_some_and(|serial| self.refused.contains(serial)) => {
                (Attempt::NotSent(why), false)
            }
            0..=1 if !self.is_calm => (Attempt::NotSent(why), false),
            2 if !self.is_calm => (Attempt::Unknown(why), true),
            3 if !self.is_calm => (Attempt::Unknown(why), false),
            _ => (Attempt::Sent, true),
        };
        if is_received {
            let message: Value = serde_json::from_str(row.message.as_ref().unwrap()).unwrap();
            assert_eq!(message["id"], row.alert_id.as_str());
            for (key, state) in [("from", &row.from_state), ("to", &row.to_state)] {
                let word = state.as_deref().unwrap_or("not_assessed");
                assert!(row.kind == "baseline" || message[key] == word, "{key} is not {word}: {message}");
            }
            self.received.push((row.channel.clone(), row.alert_id.clone()));
        }
        attempt
    }

    fn is_stopped(&self) -> bool {
        false
    }
}

/// 1,000 runs; every third is killed at a random write, most are repeated, some leave and return within one run.
#[test]
fn a_thousand_runs_with_kills_send_every_change_once_or_mark_it() {
    let mut world = World { random: fastrand::Rng::with_seed(25), ..World::default() };
    let mut truth: BTreeMap<&str, Option<&'static str>> =
        SERIALS.into_iter().map(|serial| (serial, Some("normal"))).collect();
    let (mut expected, mut kills) = (0, 0);
    let mut known = truth.clone();
    for number in 0..1000 {
        if world.random.u64(..3) > 0 {
            let serial = SERIALS[world.random.u64(..6) as usize];
            truth.insert(serial, STATES[world.random.u64(..5) as usize]);
        }
        let is_killed = world.random.u64(..3) == 0;
        let step = world.random.u64(..5);
        world.kill_in = is_killed.then_some((step, world.random.u64(..2) == 0));
        // A back-fill on the same date changes states as well.
        let day = number as i64 / 4;
        let findings: Vec<Finding> =
            truth.iter().map(|(serial, state)| finding(serial, *state, day)).collect();
        let differ = truth.iter().filter(|(serial, state)| known[*serial] != **state).count();
        let (written, ended) = world.run(&findings, number);
        kills += usize::from(ended.is_err());
        // Without rows there is no baseline yet, and the first states written are it.
        if ended.is_ok() || written > 0 {
            assert_eq!(written, if number == 0 { 0 } else { differ }, "run {number}");
        }
        if written > 0 || ended.is_ok() || world.table.values().all(|row| row.kind == "baseline") {
            expected += written;
            known.clone_from(&truth);
        }
    }
    (world.kill_in, world.is_calm) = (None, true);
    let last: Vec<Finding> = truth.iter().map(|(serial, state)| finding(serial, *state, 999)).collect();
    for number in 1000..1003 {
        let (written, ended) = world.run(&last, number);
        assert_eq!(ended, Ok(()));
        expected += written;
    }
    assert!(kills > 150 && expected > 400, "{kills} kills, {expected} changes");

    let changes: BTreeSet<&str> = world
        .table
        .values()
        .filter(|row| row.kind == "change" && row.channel.is_empty())
        .map(|row| row.alert_id.as_str())
        .collect();
    assert_eq!(changes.len(), expected, "a change is written twice or lost");
    // The changes of a unit are a chain: each begins where the one before ended.
    for serial in SERIALS {
        let is_of_unit =
            |row: &&AlertRecord| row.channel.is_empty() && row.serial_number.as_deref() == Some(serial);
        let mut changes: Vec<&AlertRecord> = world.table.values().filter(is_of_unit).collect();
        changes.sort_by_key(|row| row.change_number);
        assert!(changes.windows(2).all(|pair| pair[0].to_state == pair[1].from_state), "{changes:?}");
    }
    // The last message about a unit says its present state.
    for (serial, channel) in
        SERIALS.iter().flat_map(|serial| ["command", "folder", "url"].map(|of| (serial, of)))
    {
        let of_unit = |(to, id): &(String, String)| {
            let row = world.table.get(&(id.clone(), to.clone()))?;
            (to == channel && row.serial_number.as_deref() == Some(serial)).then_some(row.change_number)
        };
        let received: Vec<i64> = world.received.iter().filter_map(of_unit).collect();
        assert_eq!(received.last(), received.iter().max(), "{serial} {channel}");
    }
    let mut counts = BTreeMap::<&str, usize>::new();
    for row in world.table.values().filter(|row| !row.channel.is_empty() && row.kind == "change") {
        let name = (row.channel.clone(), row.alert_id.clone());
        let times = world.received.iter().filter(|received| **received == name).count();
        *counts.entry(row.status.as_str()).or_default() += 1;
        match (row.channel.as_str(), row.status) {
            // At most once: exactly once where it is marked as sent.
            ("command", AlertStatus::Sent) => assert_eq!(times, 1, "{row:?}"),
            ("command", AlertStatus::Unconfirmed) => assert!(times <= 1, "{row:?}"),
            // At least once, and doubles have one identifier, as the file of a folder has one name.
            ("folder" | "url", AlertStatus::Sent) => assert!(times >= 1, "{row:?}"),
            _ => panic!("left as it is: {row:?}"),
        }
    }
    assert_eq!(counts.values().sum::<usize>(), 3 * expected);
    assert!(counts["unconfirmed"] > 20 && counts["sent"] > 2 * expected, "{counts:?}");
}

#[test]
fn filters_select_by_new_state_part_and_tail() {
    let channel = AlertChannel {
        states: vec!["act".to_owned()],
        parts: vec!["EMA-27-*".to_owned()],
        tails: vec!["N41?FP".to_owned()],
        ..AlertChannel::default()
    };
    for (state, part, tail, expected) in [
        ("act", Some("EMA-27-1040"), "N412FP", true),
        ("plan", Some("EMA-27-1040"), "N412FP", false),
        ("act", Some("EMA-32-1040"), "N412FP", false),
        ("act", Some("EMA-27-1040"), "N4122FP", false),
        ("act", None, "N412FP", false),
    ] {
        assert_eq!(channel.selects(Some(state), part, Some(tail)), expected, "{state} {part:?} {tail}");
    }
    let all = AlertChannel::default();
    assert!(all.selects(Some("watch"), None, None) && !all.selects(None, None, None));
}

/// A message that always fails must not keep the others back, and a dead receiver costs three attempts a run.
#[test]
fn a_dead_receiver_costs_three_attempts_and_a_bad_message_does_not_block_others() {
    let mut channels = channels();
    channels.retain(|name, _| name == "command");
    let serials: Vec<String> = (0..8).map(|n| format!("S{n}")).collect();
    let findings = |state| serials.iter().map(|s| finding(s, Some(state), 1)).collect::<Vec<_>>();
    let now = Timestamp::UNIX_EPOCH;
    let baseline = alert_changes::detect(&[], &findings("normal"), &channels, "0", now);
    let known: Vec<AlertRecord> = baseline.into_iter().filter(|row| row.channel.is_empty()).collect();
    let mut due = alert_changes::detect(&known, &findings("act"), &channels, "1", now);
    due.retain(|row| !row.channel.is_empty());
    let refused = serials.iter().cloned().collect();
    let mut world = World { is_calm: true, refused, ..World::default() };
    world.write_all(&due).unwrap();
    let run = |world: &mut World, run_id: &str| {
        let rows = world.table.values().cloned().collect();
        let mut summary = AlertSummary::default();
        let failed = delivery::deliver(rows, &channels, run_id, world, &mut summary).unwrap();
        assert_eq!(failed.len(), summary.failed);
        (summary.sent, summary.failed, summary.waiting, std::mem::take(&mut world.attempts))
    };
    assert_eq!(run(&mut world, "2"), (0, 3, 5, 3));
    assert_eq!(run(&mut world, "3"), (0, 3, 5, 3));
    assert_eq!(run(&mut world, "4"), (0, 3, 5, 3), "others are tried first");
    world.refused = ["S3".to_owned()].into();
    assert_eq!(run(&mut world, "5"), (7, 1, 0, 8));
    assert_eq!(run(&mut world, "6"), (0, 1, 0, 1));
}

#[test]
fn a_unit_that_lost_its_flights_is_one_alert() {
    let channels = channels();
    let [one, other] = ["1040-0009", "7"].map(|serial| finding(serial, Some("act"), 0));
    let detect = |known: &[AlertRecord], findings: &[Finding]| {
        alert_changes::detect(known, findings, &channels, "run", one.as_of_utc)
    };
    let mut known = detect(&[], &[one.clone(), other.clone()]);
    let found = detect(&known, std::slice::from_ref(&other));
    assert_eq!(found.len(), 1 + channels.len());
    assert!(
        found.iter().all(|row| row.serial_number.as_deref() == Some("1040-0009") && row.to_state.is_none())
    );
    known.extend(found);
    assert_eq!(detect(&known, std::slice::from_ref(&other)), []);
}

/// The forecast scatters from flight to flight: `plan` near the horizon does not come and go, and `act` is never kept back.
#[test]
fn a_plan_that_was_sent_stands_while_its_crossing_is_near_the_horizon() {
    let channels = channels();
    let known =
        alert_changes::detect(&[], &[finding("S1", Some("plan"), 0)], &channels, "0", Timestamp::UNIX_EPOCH);
    let changes = |state, is_near_plan| {
        let next = Finding { is_near_plan, ..finding("S1", Some(state), 1) };
        let found = alert_changes::detect(&known, &[next], &channels, "1", Timestamp::UNIX_EPOCH);
        found.iter().filter(|row| row.channel.is_empty()).count()
    };
    assert_eq!((changes("watch", true), changes("normal", true)), (0, 0));
    assert_eq!((changes("watch", false), changes("act", true), changes("unassessed", true)), (1, 1, 1));
}

/// A change that a tail made, first seen on a day.
fn tail_change(day: i64, as_of_day: i64) -> Finding {
    let at = |day: i64| Timestamp::from_second(1_780_000_000 + 86_400 * day).unwrap();
    Finding {
        unit: (None, String::new()),
        tail_number: Some("N412FP".to_owned()),
        position: None,
        quantity: "skew_s",
        state: Some("recorder_moved"),
        since_utc: Some(at(day)),
        ..finding("", None, as_of_day)
    }
}

#[test]
fn a_change_of_a_tail_is_one_alert_though_its_date_moves_and_a_later_change_is_another() {
    let folder = AlertChannel { folder: Some("alerts".to_owned()), ..AlertChannel::default() };
    let channels = Channels::from([("folder".to_owned(), folder)]);
    let unit = finding("1040-0009", Some("normal"), 0);
    let detect = |known: &[AlertRecord], findings: &[Finding]| {
        alert_changes::detect(known, findings, &channels, "run", unit.as_of_utc)
    };
    let mut known = detect(&[], std::slice::from_ref(&unit));
    let first = detect(&known, &[unit.clone(), tail_change(100, 103)]);
    assert_eq!(first.len(), 1 + channels.len());
    let message: Value =
        serde_json::from_str(first.iter().find_map(|row| row.message.as_deref()).unwrap()).unwrap();
    assert_eq!(message["text"], "all of N412FP: skew_s normal → recorder_moved (of a test)");
    assert_eq!(message["serial_number"], Value::Null);
    known.extend(first);
    assert_eq!(detect(&known, &[unit.clone(), tail_change(97, 110)]), []);
    let second = detect(&known, &[unit.clone(), tail_change(97, 160), tail_change(150, 160)]);
    assert_eq!(second.len(), 1 + channels.len());
    assert_eq!(second.iter().map(|row| row.change_number).max(), Some(2));
    known.extend(second);
    // Another tail has changes of its own.
    let other = Finding { tail_number: Some("N413FP".to_owned()), ..tail_change(150, 160) };
    assert_eq!(detect(&known, &[unit.clone(), other]).len(), 1 + channels.len());
}
