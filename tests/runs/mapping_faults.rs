//! A wrong mapping is reported by every command: with its scope, its remedy and exit code 1.

use serde_json::Value;

use crate::harness::TestFleet;

/// Units and their states by `freeplay trend`.
fn states(fleet: &TestFleet) -> Vec<(String, Value)> {
    let trends = fleet.rows(&["trend"]);
    trends
        .iter()
        .map(|row| (row["serial_number"].as_str().unwrap().to_owned(), row["state"].clone()))
        .collect()
}

#[test]
fn a_reversed_load_sign_is_an_error_of_the_parts_and_names_the_units_that_lose_their_state() {
    const REMEDY: &str = "reverse the sign of the load";
    let fleet = TestFleet::processed();
    let before = states(&fleet);
    fleet.configure("[channel.load]\n", "[channel.load]\nsign = -1\n");

    let checked = fleet.freeplay(&["check"]);
    assert_eq!(checked.code, Some(1), "{checked:?}");
    assert!(checked.out.contains("would be refused, load_sign_flipped"), "{}", checked.out);
    assert!(
        checked.err.contains("error[load_sign_flipped]") && checked.err.contains(REMEDY),
        "{}",
        checked.err
    );
    let channels = fleet.freeplay(&["check", "--json"]).json();
    let channels = channels.as_array().unwrap();
    let refused = channels.iter().filter(|row| row["remedy"].as_str().is_some_and(|r| r.contains(REMEDY)));
    assert!(
        refused.clone().count() > 0 && refused.clone().all(|row| row["channel"] == "load"),
        "{channels:?}"
    );

    let result = fleet.freeplay(&["run", "--json"]);
    assert_eq!(result.code, Some(1), "{result:?}");
    let summary = result.json();
    let faults = summary["mapping_faults"].as_array().unwrap();
    let parts: Vec<&str> = faults.iter().filter_map(|fault| fault["part_number"].as_str()).collect();
    assert_eq!(parts, ["EMA-27-1040", "EMA-27-1060"], "{faults:?}");
    assert!(
        faults
            .iter()
            .all(|f| f["reason"] == "load_sign_flipped" && f["remedy"].as_str().unwrap().contains(REMEDY))
    );
    let refusals = summary["refusals"].as_array().unwrap();
    assert!(refusals.iter().all(|r| r["remedy"].is_string()), "{refusals:?}");
    let changed = summary["changed"].as_array().unwrap();
    for (serial, state) in before.iter().filter(|(_, state)| state.is_string()) {
        let change = changed.iter().find(|change| change["serial_number"] == **serial).unwrap();
        assert_eq!((&change["from"], &change["to"]), (state, &"unassessed".into()), "{change}");
    }
    assert!(before.iter().any(|(_, state)| state.is_string()), "the fleet has no state to lose");

    // Nothing is new: the fault is shown all the same, and is no error of this run.
    let again = fleet.run_ok(&["run"]);
    assert!(again.contains("mapping") && again.contains(REMEDY), "{again}");

    let stored = fleet.rows(&["query", "tail", "N412FP"]);
    let refused = stored.iter().find(|row| row["reason"] == "load_sign_flipped").unwrap();
    assert!(refused["remedy"].as_str().unwrap().contains(REMEDY), "{refused}");
    assert!(fleet.run_ok(&["query", "tail", "N412FP"]).contains(REMEDY));
    let (flight, position) = (refused["flight_id"].as_str().unwrap(), refused["position"].as_str().unwrap());
    assert!(fleet.run_ok(&["explain", flight, position]).contains(REMEDY));
    fleet.run_ok(&["report", "--output", "pages"]);
    let report = fleet.read_json("pages/report.json");
    // One computation: run, trend and report name the same faults.
    let trend = fleet.run_ok(&["trend"]);
    for fault in report["mapping_faults"].as_array().unwrap() {
        let fault = fault.as_str().unwrap();
        assert!(fault.contains(REMEDY) && fault.contains("load_sign_flipped on"), "{fault}");
        assert!(trend.contains(fault) && again.contains(fault), "{fault}: {trend}\n{again}");
    }
    assert_eq!(report["mapping_faults"].as_array().unwrap().len(), faults.len());
    let reasons = fleet.rows(&["trend"]);
    let named = |row: &&Value| row["reason"].as_str().unwrap().contains("load_sign_flipped on");
    assert!(reasons.iter().filter(|row| row["removed_utc"].is_null()).all(|row| named(&row)), "{reasons:?}");
    assert!(fleet.read("pages/index.html").contains("Wrong mapping or setting."));
}
