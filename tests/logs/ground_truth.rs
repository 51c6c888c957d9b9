//! The sample fleet against its truth, and one worker against several.

use crate::harness::{Table, TestFleet, print_line};

#[test]
fn the_sample_fleet_runs_well_and_its_median_error_is_below_one_per_cent() {
    let fleet = TestFleet::sample();
    let account = fleet.run_ok(&["run"]);
    assert!(account.contains("120 records of 30 flights: 120 estimated, 0 refused"), "{account}");
    fleet.run_ok(&["store", "export", "--format", "parquet", "--output", "gaps.parquet"]);
    let found = Table::read(&fleet.path("gaps.parquet")).by_flight("gap_m");
    let truth = Table::read(&fleet.path("sample-data/truth.parquet")).by_flight("gap_m");
    assert_eq!(found.keys().collect::<Vec<_>>(), truth.keys().collect::<Vec<_>>());
    let mut errors: Vec<f64> =
        found.iter().map(|(key, gap)| 100.0 * (gap / truth[key] - 1.0).abs()).collect();
    errors.sort_by(f64::total_cmp);
    let (median, p95, worst) = (errors[60], errors[114], errors[119]);
    print_line(&format!(
        "gap against truth, 120 flights: median {median:.2} %, 95 % {p95:.2} %, worst {worst:.2} %"
    ));
    assert!(median < 1.0, "median error {median} %");
}

#[test]
fn one_worker_and_two_store_the_same_bytes() {
    let (one, two) = (TestFleet::sample(), TestFleet::sample());
    one.run_ok(&["run", "--jobs", "1"]);
    two.run_ok(&["run", "--jobs", "2"]);
    assert_eq!(one.exported(), two.exported());
    assert_eq!(one.run_ok(&["trend", "--json"]), two.run_ok(&["trend", "--json"]));
}

/// The serial that changed tails keeps its history, although the logs hold no serial numbers.
#[test]
fn a_swapped_serial_keeps_its_history_across_tails() {
    let fleet = TestFleet::sample();
    fleet.run_ok(&["run"]);
    fleet.run_ok(&["query", "serial", "1060-0008", "--format", "parquet", "--output", "unit.parquet"]);
    let tails = Table::read(&fleet.path("unit.parquet")).texts("tail_number");
    assert_eq!(tails, [["N412FP"; 5], ["N413FP"; 5]].concat());
}

#[test]
fn a_simulated_fleet_is_the_same_again_from_its_seed() {
    let fleet = TestFleet::empty();
    let spec = "seed = 7\ntails = [\"N1\"]\nflights_per_tail = 2\n\n[profile]\nduration_s = 30.0\n\n[[parts]]\npart_number = \"EMA\"\n\n[[positions]]\nposition = \"aileron\"\npart_number = \"EMA\"\n";
    std::fs::write(fleet.path("spec.toml"), spec).unwrap();
    for (folder, jobs) in [("a", "1"), ("b", "2")] {
        fleet.run_ok(&["simulate", "spec.toml", "--output", folder, "--jobs", jobs]);
    }
    let log = |folder: &str| {
        let pattern = fleet.path(folder).join("logs/N1/*.parquet");
        let files: Vec<_> = glob::glob(pattern.to_str().unwrap()).unwrap().flatten().collect();
        files.iter().map(|f| std::fs::read(f).unwrap()).collect::<Vec<_>>()
    };
    assert_eq!(log("a").len(), 2);
    assert_eq!(log("a"), log("b"));
    let account = fleet.run_ok(&["run", "--config", "a/pipeline.toml"]);
    assert!(account.contains("2 records of 2 flights"), "{account}");
    assert_eq!(fleet.freeplay(&["simulate", "spec.toml", "--output", "a"]).code, Some(2));
}
