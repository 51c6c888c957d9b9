//! Work requests of the command, as a planner and a mechanic use them on the small fleet.

use serde_json::Value;

use super::{LONG_HORIZON, SHORT_HORIZON, processed_fleet};
use crate::harness::TestFleet;

/// The small fleet with two open requests.
fn fleet() -> TestFleet {
    let fleet = processed_fleet();
    fleet.configure(SHORT_HORIZON, LONG_HORIZON);
    fleet.run_ok(&["run", "--quiet"]);
    fleet
}

fn requests(fleet: &TestFleet, status: &str) -> Value {
    fleet.json(&["work", "list", "--status", status])
}

fn summary(fleet: &TestFleet) -> Value {
    fleet.json(&["run"])["work_requests"].clone()
}

fn ids(rows: &Value) -> Vec<&str> {
    rows.as_array().unwrap().iter().map(|row| row["request_id"].as_str().unwrap()).collect()
}

#[test]
fn a_request_lives_from_the_run_that_finds_it_to_the_maintenance_table() {
    let fleet = processed_fleet();
    fleet.configure(SHORT_HORIZON, LONG_HORIZON);
    fleet.configure("[logs]\n", "[logs]\nmaintenance = \"maintenance.csv\"\n");
    let header = "part_number,serial_number,utc,kind\n";
    std::fs::write(fleet.path("maintenance.csv"), header).unwrap();
    assert_eq!(ids(&summary(&fleet)["new"]), ["W1", "W2"]);
    assert_eq!(summary(&fleet)["new"], Value::Array(Vec::new()), "no second request while one is open");

    // The planner.
    let text = fleet.run_ok(&["work", "acknowledge", "W1", "--by", "M. Kaya", "--reason", "order a kit"]);
    assert_eq!(text, "W1: EMA-27-1040 / 1040-0009; acknowledged by M. Kaya\n");
    let until = ["--until", "2099-01-31", "--reason", "C-check", "--by", "M. Kaya"];
    let text = fleet.run_ok(&[&["work", "defer", "w2"], &until[..]].concat());
    assert_eq!(text, "W2: EMA-27-1040 / 1040-0013; deferred to 2099-01-31 by M. Kaya\n");
    let list = fleet.run_ok(&["work", "list"]);
    assert!(list.starts_with("2 work requests: 1 acknowledged, 1 deferred\n"), "{list}");
    for part in ["order a kit", "deferred to 2099-01-31  M. Kaya", "N414FP", "▲ plan"] {
        assert!(list.contains(part), "{part}: {list}");
    }
    assert_eq!(requests(&fleet, "deferred")[0]["serial_number"], "1040-0013");
    let on_tail = fleet.run_ok(&["work", "list", "--tail", "N413FP", "--format", "csv"]);
    assert!(on_tail.lines().count() == 2 && on_tail.contains("\nW1,acknowledged,plan,"), "{on_tail}");

    // The report shows both.
    fleet.run_ok(&["report", "--output", "report", "--quiet"]);
    let index = fleet.read("report/index.html");
    assert!(
        index.contains("W1 acknowledged")
            && index.contains("W2 deferred to <span class=\"d\">2099-01-31</span>"),
        "{index}"
    );
    let report = fleet.read_json("report/report.json");
    let units = report["units"].as_array().unwrap();
    let with: Vec<&Value> = units.iter().filter(|unit| unit["work_requests"][0].is_object()).collect();
    assert_eq!(with.len(), 2);

    // The mechanic enters a repair of one, and the store takes the other out of the aircraft.
    let repair = format!("{header}EMA-27-1040,1040-0009,2026-11-15T10:00:00Z,reshim\n");
    std::fs::write(fleet.path("maintenance.csv"), repair).unwrap();
    let table = "sample-data/installations.csv";
    let (open, removed) = (",2026-09-07T00:00:00Z,,", ",2026-09-07T00:00:00Z,2026-11-16T00:00:00Z,");
    fleet.edit(table, |text| text.replace(&format!("1040-0013{open}"), &format!("1040-0013{removed}")));
    let after = summary(&fleet);
    assert_eq!((ids(&after["closed"]), &after["open"]), (vec!["W1", "W2"], &0.into()), "{after}");
    let closed = requests(&fleet, "closed");
    assert_eq!(closed[0]["reason"], "repair of 2026-11-15 in the maintenance table");
    assert_eq!(closed[1]["reason"], "removed from aileron_left of N414FP on 2026-11-16");
    assert_eq!(fleet.run_ok(&["work", "list"]), "no work request\n");

    // Installed on another aircraft, as it was.
    let again = "N415FP,aileron_left,EMA-27-1040,1040-0013,2026-11-17T00:00:00Z,,,\n";
    fleet.edit(table, |text| text.to_owned() + again);
    let after = summary(&fleet);
    assert_eq!(after["new"][0]["request_id"], "W2", "{after}");
    assert_eq!(after["new"][0]["tail_number"], "N415FP");
}

/// A name cannot move the cursor of the terminal, nor become a formula of a spreadsheet.
#[test]
fn hostile_names_and_remarks_stay_text() {
    let fleet = fleet();
    let remark = "=cmd|'/c calc'!A1\u{1b}[2J\u{202e}";
    fleet.run_ok(&["work", "acknowledge", "W1", "--by", "\u{1b}[31mme", "--reason", remark]);
    let list = fleet.run_ok(&["work", "list"]);
    assert!(!list.contains('\u{1b}') && !list.contains('\u{202e}') && list.contains("[U+001B]"), "{list}");
    let csv = fleet.run_ok(&["work", "list", "--format", "csv"]);
    assert!(csv.contains("'=cmd|"), "{csv}");
    assert_eq!(requests(&fleet, "acknowledged")[0]["reason"], remark);
}

/// A command waits for a run that holds the store, and a run for a command.
#[test]
fn decisions_during_a_run_are_all_kept() {
    let fleet = fleet();
    let decisions: Vec<_> = (0..4)
        .map(|n| {
            let by = format!("person {n}");
            fleet.command(&["work", "acknowledge", "W1", "--by", &by]).spawn().unwrap()
        })
        .collect();
    let run = fleet.command(&["run", "--quiet", "--redo", "--wait", "60s"]).output().unwrap();
    assert_eq!(run.status.code(), Some(0), "{run:?}");
    for mut decision in decisions {
        assert_eq!(decision.wait().unwrap().code(), Some(0));
    }
    let events = std::fs::read_dir(fleet.path("results/work")).unwrap().count();
    assert!(events >= 6, "one file for the run, and one for each decision: {events}");
    assert!(fleet.run_ok(&["store", "verify"]).contains("OK"));
}
