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

/// The trend of the table in a folder, with a limit of 150 µm.
fn assess(fleet: &TestFleet, as_of: &[&str]) -> Vec<Value> {
    fleet.rows(&[&["trend", "--estimates", "history.csv", "--limit-m", "150e-6"], as_of].concat())
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
