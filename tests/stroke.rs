//! A screw worn in the middle of its stroke, through `freeplay`: the gap by place, and a limit on the largest gap.

use serde_json::Value;

use crate::harness::TestFleet;

/// 40 µm, and 80 µm more at the most worn place: 120 µm there. The limit lies between the mean and the largest.
const SPEC: &str = r#"
flights_per_tail = 4
tails = ["N1FP"]
[[parts]]
part_number = "W-1"
gap_m = [40e-6, 40e-6]
limit_m = 112e-6
[parts.plant.contact]
worn_m = 80e-6
worn_at_m = [4e-3, 8e-3]
[[positions]]
position = "aileron"
part_number = "W-1"
[profile]
duration_s = 90
sample_rate_hz = 100
"#;

#[test]
fn a_limit_applies_to_the_largest_gap_where_the_part_says_so() {
    let fleet = TestFleet::empty();
    std::fs::write(fleet.path("spec.toml"), SPEC).unwrap();
    fleet.run_ok(&["simulate", "spec.toml", "--output", "worn"]);
    let with = |args: &[&str]| fleet.run_ok(&[args, &["--config", "worn/pipeline.toml"]].concat());
    let first = |args: &[&str]| fleet.json(&[args, &["--config", "worn/pipeline.toml"]].concat())[0].clone();
    let gap_m = |row: &Value| row["gap_m"].as_f64().unwrap();
    with(&["run", "--quiet"]);
    let by_mean = first(&["trend"]);
    let by = "limit_applies_to = \"largest\"\nlimit_m =";
    fleet.edit("worn/pipeline.toml", |text| text.replacen("limit_m =", by, 1));
    let by_largest = first(&["trend"]);
    assert!(by_mean["limit_applies_to"] == "mean" && by_mean["state"] != "act", "{by_mean}");
    assert!((80e-6..112e-6).contains(&gap_m(&by_mean)), "{by_mean}");
    // Between two places the gap is a line, which the peak of the bell curve exceeds or not.
    assert!((gap_m(&by_largest) - 120e-6).abs() < 6e-6, "{by_largest}");
    assert!(by_largest["limit_applies_to"] == "largest" && by_largest["state"] == "act", "{by_largest}");
    with(&["report", "--output", "worn/page"]);
    let html = fleet.read(fleet.glob("worn/page/serial/*")[0].to_str().unwrap());
    assert!(
        html.contains("id=\"profile\"") && html.contains("largest along the stroke, over since"),
        "{html}"
    );
    // The stored record keeps the mean, and has the gap by place.
    let stored = first(&["query", "tail", "N1FP"]);
    assert!((gap_m(&stored) - gap_m(&by_mean)).abs() < 3e-6, "{stored}");
    assert!(stored["gap_profile_m"].as_array().is_some_and(|places| places.len() > 3), "{stored}");
}
