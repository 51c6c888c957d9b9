//! The dashboard of Grafana and the alert rules of Prometheus ask for metrics that a run writes.

use std::collections::BTreeSet;

use regex::Regex;
use serde_json::Value;

use crate::harness::{TestFleet, top};

fn page(name: &str) -> String {
    std::fs::read_to_string(top().join("docs/dashboards").join(name)).unwrap()
}

/// Names of metrics in a text.
fn metrics(text: &str) -> BTreeSet<String> {
    let name = Regex::new(r"freeplay_[a-z_]+").unwrap();
    name.find_iter(text).map(|found| found.as_str().to_owned()).collect()
}

/// Metrics that a run with alerts writes: the samples, without their comments.
fn written() -> BTreeSet<String> {
    let fleet = TestFleet::sample();
    let file = fleet.path("pipeline.toml");
    let text = std::fs::read_to_string(&file).unwrap() + "\n[alerts.files]\nfolder = \"alerts\"\n";
    std::fs::write(file, text).unwrap();
    fleet.run_ok(&["run", "--quiet", "--metrics", "freeplay.prom"]);
    let text = std::fs::read_to_string(fleet.path("freeplay.prom")).unwrap();
    for (metric, value) in
        [("units_plan", 2), ("work_requests_open", 2), ("alerts_sent", 1), ("units_normal", 10)]
    {
        assert!(text.contains(&format!("\nfreeplay_{metric} {value}\n")), "{metric}: {text}");
    }
    let samples: Vec<&str> = text.lines().filter(|line| !line.starts_with('#')).collect();
    metrics(&samples.join("\n"))
}

#[test]
fn every_metric_of_dashboard_and_rules_is_written_and_every_written_one_is_shown() {
    let written = written();
    let (dashboard, rules) = (metrics(&page("grafana.json")), metrics(&page("prometheus-rules.yml")));
    assert_eq!(dashboard, written, "the dashboard shows all metrics and no other");
    assert!(rules.is_subset(&written), "{:?}", rules.difference(&written));
}

/// Grafana's dashboard model: identifiers are unique, the grid is 24 wide, panels do not overlap, and each target has
/// an expression and a data source of the variable.
#[test]
fn the_dashboard_fits_the_model_of_grafana() {
    let dashboard: Value = serde_json::from_str(&page("grafana.json")).unwrap();
    assert!(dashboard["uid"].as_str().is_some_and(|uid| uid.len() <= 40) && dashboard["title"].is_string());
    assert!(dashboard["schemaVersion"].as_u64().is_some_and(|version| version >= 36));
    let variables: Vec<&str> = dashboard["templating"]["list"]
        .as_array()
        .unwrap()
        .iter()
        .map(|variable| variable["name"].as_str().unwrap())
        .collect();
    assert_eq!(variables, ["datasource", "instance"]);
    let (mut ids, mut cells) = (BTreeSet::new(), BTreeSet::new());
    for panel in dashboard["panels"].as_array().unwrap() {
        let title = panel["title"].as_str().unwrap();
        assert!(ids.insert(panel["id"].as_u64().unwrap()), "{title}");
        assert!(["stat", "timeseries"].contains(&panel["type"].as_str().unwrap()), "{title}");
        let [x, y, w, h] = ["x", "y", "w", "h"].map(|key| panel["gridPos"][key].as_u64().unwrap());
        assert!(w > 0 && h > 0 && x + w <= 24, "{title}");
        for cell in (x..x + w).flat_map(|x| (y..y + h).map(move |y| (x, y))) {
            assert!(cells.insert(cell), "{title} overlaps another panel");
        }
        let mut references = BTreeSet::new();
        for target in panel["targets"].as_array().unwrap() {
            assert!(references.insert(target["refId"].as_str().unwrap()), "{title}");
            assert_eq!(target["datasource"]["uid"], "${datasource}", "{title}");
            let expression = target["expr"].as_str().unwrap();
            assert_eq!(metrics(expression).len(), 1, "{title}: {expression}");
            assert!(expression.contains("{instance=~\"$instance\"}"), "{title}: {expression}");
        }
    }
}

/// Rules as `promtool check rules` reads them: a name, an expression, a severity, a summary and a remedy each.
#[test]
fn every_rule_has_its_parts() {
    let text = page("prometheus-rules.yml");
    let (_, rules) = text.split_once("    rules:\n").unwrap();
    let rules: Vec<&str> = rules.split("      - alert: ").filter(|rule| !rule.is_empty()).collect();
    let mut names = BTreeSet::new();
    for rule in &rules {
        let (name, _) = rule.split_once('\n').unwrap();
        assert!(name.starts_with("Freeplay") && names.insert(name), "{name}");
        for part in ["        expr: ", "          severity: ", "          summary: ", "          remedy: "] {
            assert_eq!(rule.matches(part).count(), 1, "{name}: {part}");
        }
    }
    assert_eq!(rules.len(), text.matches("alert:").count());
}
