//! States of units with invented records, through `freeplay trend --estimates`.

use serde_json::Value;

use crate::harness::TestFleet;

/// Gaps of a unit, µm, one flight of 2 h a day, with a scatter of 0.3 µm.
fn rows(serial: &str, gaps_um: &[f64]) -> String {
    let row = |(day, um): (usize, &f64)| {
        let wiggle = 0.3e-6 * (1.7 * day as f64).sin();
        let date = jiff::civil::date(2026, 1, 1).saturating_add(jiff::Span::new().days(day as i64));
        format!("{serial},{date}T06:00:00Z,{:e},0.3e-6,2.0\n", um * 1e-6 + wiggle)
    };
    gaps_um.iter().enumerate().map(row).collect()
}

/// The trend of each unit at a date, with a limit of 150 µm.
fn trend(units: &[(&str, Vec<f64>)], as_of: &[&str]) -> Vec<Value> {
    let fleet = TestFleet::empty();
    let header = "serial_number,departure_utc,gap_m,gap_se_m,flight_hours\n".to_owned();
    let table: String = std::iter::once(header).chain(units.iter().map(|(s, gaps)| rows(s, gaps))).collect();
    std::fs::write(fleet.path("history.csv"), table).unwrap();
    assess(&fleet, as_of)
}

/// The trend of the table in a folder, with a limit of 150 µm.
fn assess(fleet: &TestFleet, as_of: &[&str]) -> Vec<Value> {
    fleet.rows(&[&["trend", "--estimates", "history.csv", "--limit-m", "150e-6"], as_of].concat())
}

#[test]
fn a_unit_measured_above_its_limit_says_so() {
    let rise =
        |from: i32| (0..30_i32).map(|k| 70.0 + 20.0 * f64::from(k - from).max(0.0)).collect::<Vec<_>>();
    let units = [
        ("1-one-above", [vec![70.0; 20], vec![190.0]].concat()),
        ("2-three-above", [vec![70.0; 12], vec![250.0; 3]].concat()),
        ("3-two-in-all", vec![180.0; 2]),
        ("4-rise", rise(23)),
        ("5-hours-from-it", rise(26)),
        ("6-calm", vec![70.0; 30]),
    ];
    let expected = [
        ("plan", Some("inspect")),
        ("act", Some("replace")),
        ("act", Some("replace")),
        ("act", Some("replace")),
        ("plan", Some("inspect")),
        ("normal", None),
    ];
    for ((serial, gaps), expected) in units.into_iter().zip(expected) {
        let day = format!("2026-01-{:02}T12:00:00Z", gaps.len());
        let row = trend(&[(serial, gaps.clone())], &["--as-of", &day]).swap_remove(0);
        let gap_um = row["gap_m"].as_f64().unwrap() * 1e6;
        assert!((gap_um - gaps[gaps.len() - 1]).abs() < 2.0, "{serial}: {gap_um}");
        assert_eq!((row["state"].as_str().unwrap(), row["action"].as_str()), expected, "{serial}");
        assert_eq!(row["latest_utc"].as_str().unwrap()[..10], day[..10], "{row}");
    }
}

#[test]
fn a_silent_unit_is_unassessed_and_one_above_its_limit_stays_so() {
    let units = [("calm", vec![70.0; 20]), ("above", [vec![70.0; 18], vec![190.0; 2]].concat())];
    let rows = trend(&units, &["--as-of", "2026-03-20T00:00:00Z"]);
    let state =
        |serial: &str| rows.iter().find(|row| row["serial_number"] == serial).unwrap()["state"].clone();
    assert_eq!((state("calm"), state("above")), ("unassessed".into(), "act".into()));
    // Without `--as-of`, units are assessed now, long after these flights.
    assert!(trend(&units, &[]).iter().all(|row| row["state"] != "normal"), "{rows:?}");
}

#[test]
fn records_dated_ahead_and_negative_usage_are_named_and_decide_nothing() {
    let fleet = TestFleet::empty();
    let ahead = "U,2199-01-01T06:00:00Z,400e-6,0.3e-6,2.0\nU,2026-01-31T06:00:00Z,70e-6,0.3e-6,-5\n";
    let table =
        format!("serial_number,departure_utc,gap_m,gap_se_m,flight_hours\n{}{ahead}", rows("U", &[70.0; 30]));
    std::fs::write(fleet.path("history.csv"), table).unwrap();
    let found = assess(&fleet, &["--as-of", "2026-02-01T00:00:00Z"]);
    let reason = found[0]["reason"].as_str().unwrap();
    assert_eq!(found[0]["state"], "normal", "{reason}");
    assert!(
        reason.contains("1 rows with negative usage") && reason.contains("1 records dated ahead"),
        "{reason}"
    );
    for limit in ["0", "-1e-6"] {
        let args = ["trend", "--estimates", "history.csv", "--limit-m", limit];
        assert_eq!(fleet.freeplay(&args).code, Some(2), "a limit of {limit}");
    }
}

/// Four actuators of a tail step by 90 µm to above their limit in one flight, as with a fault of the tail's sensors; a
/// fifth on another tail has one record above its limit, and that record is flagged.
#[test]
fn neither_a_flag_nor_a_step_of_the_whole_tail_hides_records_above_the_limit() {
    let fleet = TestFleet::empty();
    let mut table = "serial_number,departure_utc,gap_m,gap_se_m,flight_hours,tail_number,flags\n".to_owned();
    let mut add = |serial: &str, gaps_um: &[f64], ending: &dyn Fn(usize) -> &'static str| {
        let rows = rows(serial, gaps_um);
        table.extend(rows.lines().enumerate().map(|(day, row)| format!("{row}{}\n", ending(day))));
    };
    let step: Vec<f64> = (0..28).map(|day| if day < 24 { 70.0 } else { 160.0 }).collect();
    for serial in ["A", "B", "C", "D"] {
        add(serial, &step, &|_| ",T77,");
    }
    let last_above: Vec<f64> = (0..28).map(|day| if day < 27 { 70.0 } else { 190.0 }).collect();
    add("E", &last_above, &|day| if day < 27 { ",T88," } else { ",T88,estimators_disagree" });
    std::fs::write(fleet.path("history.csv"), table).unwrap();
    let found = assess(&fleet, &["--as-of", "2026-01-28T12:00:00Z"]);
    for row in &found {
        let (serial, reason) = (row["serial_number"].as_str().unwrap(), row["reason"].as_str().unwrap());
        let is_doubted = serial == "E";
        let expected = if is_doubted { ("plan", "inspect") } else { ("act", "replace") };
        assert_eq!((row["state"].as_str().unwrap(), row["action"].as_str().unwrap()), expected, "{row}");
        assert_eq!(reason.contains("the actuators of T77 changed together"), !is_doubted, "{reason}");
    }
    assert_eq!(found.len(), 5);
}

/// All gaps exceed the lowered limits: the run finds every unit due, and ends with the exit code of `--fail-on`.
#[test]
fn a_lowered_limit_makes_every_unit_of_the_logs_due() {
    let fleet = TestFleet::sample();
    for (limit, watch) in [("150e-6", "110e-6"), ("180e-6", "135e-6")] {
        fleet.configure(&format!("limit_m = {limit}\nwatch_m = {watch}"), "limit_m = 20e-6\nwatch_m = 10e-6");
    }
    let run = fleet.freeplay(&["run", "--quiet", "--fail-on", "act"]);
    let found = fleet.rows(&["trend"]);
    let states: Vec<&str> = found.iter().map(|row| row["state"].as_str().unwrap()).collect();
    assert_eq!((states.len(), run.code), (12, Some(4)), "{run:?}");
    assert!(states.iter().all(|state| *state == "act"), "{states:?}");
}
