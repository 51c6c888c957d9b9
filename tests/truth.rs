//! The sample fleet against its truth, and one worker against several.

use crate::bench::{Bench, Table, tell};

#[test]
fn the_sample_fleet_runs_well_and_its_median_error_is_below_one_per_cent() {
    let bench = Bench::sample();
    let account = bench.well(&["run"]);
    assert!(account.contains("120 records of 30 flights: 120 estimated, 0 refused"), "{account}");
    bench.well(&["store", "export", "--format", "parquet", "--output", "gaps.parquet"]);
    let found = Table::read(&bench.path("gaps.parquet")).by_flight("gap_m");
    let truth = Table::read(&bench.path("sample-data/truth.parquet")).by_flight("gap_m");
    assert_eq!(found.keys().collect::<Vec<_>>(), truth.keys().collect::<Vec<_>>());
    let mut errors: Vec<f64> =
        found.iter().map(|(key, gap)| 100.0 * (gap / truth[key] - 1.0).abs()).collect();
    errors.sort_by(f64::total_cmp);
    let (median, p95, worst) = (errors[60], errors[114], errors[119]);
    tell(&format!(
        "gap against truth, 120 flights: median {median:.2} %, 95 % {p95:.2} %, worst {worst:.2} %"
    ));
    assert!(median < 1.0, "median error {median} %");
}

#[test]
fn one_worker_and_two_store_the_same_bytes() {
    let (one, two) = (Bench::sample(), Bench::sample());
    one.well(&["run", "--jobs", "1"]);
    two.well(&["run", "--jobs", "2"]);
    assert_eq!(one.exported(), two.exported());
    assert_eq!(one.well(&["trend", "--json"]), two.well(&["trend", "--json"]));
}

/// The serial that changed tails keeps its history, and the logs say nothing of serials.
#[test]
fn a_swapped_serial_keeps_its_history_across_tails() {
    let bench = Bench::sample();
    bench.well(&["run"]);
    bench.well(&["query", "serial", "1060-0008", "--format", "parquet", "--output", "unit.parquet"]);
    let tails = Table::read(&bench.path("unit.parquet")).texts("tail_number");
    assert_eq!(tails, [["N412FP"; 5], ["N413FP"; 5]].concat());
}

#[test]
fn a_simulated_fleet_is_the_same_again_from_its_seed() {
    let bench = Bench::empty();
    let spec = "seed = 7\ntails = [\"N1\"]\nflights_per_tail = 2\n\n[profile]\nduration_s = 30.0\n\n[[parts]]\npart_number = \"EMA\"\n\n[[positions]]\nposition = \"aileron\"\npart_number = \"EMA\"\n";
    std::fs::write(bench.path("spec.toml"), spec).unwrap();
    for (folder, jobs) in [("a", "1"), ("b", "2")] {
        bench.well(&["simulate", "spec.toml", "--output", folder, "--jobs", jobs]);
    }
    let log = |folder: &str| {
        let pattern = bench.path(folder).join("logs/N1/*.parquet");
        let files: Vec<_> = glob::glob(pattern.to_str().unwrap()).unwrap().flatten().collect();
        files.iter().map(|f| std::fs::read(f).unwrap()).collect::<Vec<_>>()
    };
    assert_eq!(log("a").len(), 2);
    assert_eq!(log("a"), log("b"));
    let account = bench.well(&["run", "--config", "a/pipeline.toml"]);
    assert!(account.contains("2 records of 2 flights"), "{account}");
    assert_eq!(bench.freeplay(&["simulate", "spec.toml", "--output", "a"]).code, Some(2));
}
