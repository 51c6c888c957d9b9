//! One story: trend, work list, alerts, metrics and report have the same states, dates, gaps and counts.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use arrow::array::{Array, ArrayRef, AsArray, Float64Array};
use arrow::compute::cast;
use arrow::datatypes::{DataType, Float64Type, TimestampMicrosecondType};
use jiff::{SignedDuration, Timestamp};
use serde_json::Value;
use store::Store;

use crate::harness::TestFleet;

/// State, date, gap and limit of a unit.
type Shown = (String, Option<Timestamp>, Option<f64>, Option<f64>);

fn date(value: &Value) -> Option<Timestamp> {
    value.as_str().map(|text| text.parse().unwrap())
}

fn shown(unit: &Value) -> Option<Shown> {
    let state = unit["state"].as_str().filter(|state| *state != "not_assessed")?.to_owned();
    Some((state, date(&unit["due_utc"]), unit["gap_m"].as_f64(), unit["limit_m"].as_f64()))
}

fn by_serial<'v>(units: impl IntoIterator<Item = (&'v Value, &'v Value)>) -> BTreeMap<String, Shown> {
    let named = units
        .into_iter()
        .filter_map(|(name, unit)| Some((name["serial_number"].as_str().unwrap().to_owned(), shown(unit)?)));
    named.collect()
}

/// The sample fleet, and three whose gaps are drawn: each unit begins and wears as its serial number and the seed say.
fn fleets() -> Vec<TestFleet> {
    let processed = TestFleet::sample();
    processed.run_ok(&["run", "--quiet"]);
    let drawn = (1..=3).map(|seed: u64| {
        let fleet = processed.copied();
        let store = Store::open(fleet.path("results")).unwrap();
        let mut writer = store.lock(None).unwrap();
        let columns = ["gap_m", "departure_utc", "serial_number"];
        let draw = |batch: &arrow::array::RecordBatch| {
            let texts = cast(batch.column(2), &DataType::Utf8)?;
            let days = batch.column(1).as_primitive::<TimestampMicrosecondType>().values();
            let gaps = batch.column(0).as_primitive::<Float64Type>();
            // 1 September 2026.
            let first = 1_788_220_800_000_000;
            let drawn = |(row, serial): (usize, Option<&str>)| {
                let hash =
                    serial.unwrap_or_default().bytes().fold(seed, |h, b| h * 31 % 1_009 + u64::from(b));
                let (begin, growth) = (20.0 + (hash % 70) as f64, (hash % 11) as f64 / 5.0);
                let day = (days[row] - first) as f64 / 86.4e9;
                let scatter = 0.3 * (1.7 * row as f64).sin();
                gaps.is_valid(row).then_some(1e-6 * (begin + growth * day + scatter))
            };
            let drawn: Float64Array = texts.as_string::<i32>().iter().enumerate().map(drawn).collect();
            let mut arrays: Vec<ArrayRef> = batch.columns().to_vec();
            arrays[0] = Arc::new(drawn);
            arrow::array::RecordBatch::try_new(batch.schema(), arrays)
        };
        assert_eq!(writer.rewrite(&columns, &draw).unwrap(), 120);
        fleet
    });
    [TestFleet::sample_data()].into_iter().chain(drawn).collect()
}

#[test]
fn every_surface_has_the_same_states_dates_and_counts() {
    let mut seen = BTreeMap::<String, usize>::new();
    for fleet in fleets() {
        fleet.configure_also("[alerts.files]\nfolder = \"alerts\"\n");
        fleet.run_ok(&["run", "--quiet", "--metrics", "freeplay.prom"]);
        let units = fleet.rows(&["trend"]);
        let trend = by_serial(units.iter().map(|unit| (unit, unit)));
        let counts = trend.values().fold(BTreeMap::<&str, u64>::new(), |mut counts, shown| {
            *counts.entry(&shown.0).or_default() += 1;
            counts
        });
        counts.iter().for_each(|(state, n)| *seen.entry((*state).to_owned()).or_default() += *n as usize);

        let requests = fleet.rows(&["work", "list"]);
        let due: Vec<Option<Timestamp>> = requests.iter().map(|request| date(&request["due_utc"])).collect();
        assert!(due.is_sorted(), "by date: {due:?}");
        let dates =
            requests.iter().map(|r| (r["serial_number"].as_str(), r["state"].as_str(), date(&r["due_utc"])));
        let wanted = trend.iter().filter(|(_, shown)| matches!(shown.0.as_str(), "plan" | "act"));
        let wanted = wanted.map(|(serial, shown)| (Some(serial.as_str()), Some(shown.0.as_str()), shown.1));
        assert_eq!(dates.collect::<BTreeSet<_>>(), wanted.collect());

        let message = fleet.read_json(fleet.glob("alerts/*")[0].to_str().unwrap());
        let metrics = fleet.read("freeplay.prom");
        for state in ["normal", "watch", "unassessed", "plan", "act"] {
            let n = counts.get(state).copied().unwrap_or_default();
            assert_eq!(message["states"][state].as_u64().unwrap_or_default(), n, "{state}: {message}");
            assert!(metrics.contains(&format!("\nfreeplay_units_{state} {n}\n")), "{state} {n}: {metrics}");
        }
        let (text, list) = (fleet.run_ok(&["trend"]), fleet.run_ok(&["work", "list"]));
        let alerted = message["units"].as_array().unwrap();
        assert!(!alerted.is_empty());
        for unit in alerted.iter().filter(|unit| unit["quantity"] == "gap") {
            let serial = unit["serial_number"].as_str().unwrap();
            assert_eq!(shown(unit).as_ref(), trend.get(serial), "{unit}");
            let statement = unit["statement"].as_str().unwrap();
            let is_request = matches!(unit["state"].as_str(), Some("plan" | "act"));
            assert!(
                text.contains(statement) && (!is_request || list.contains(statement)),
                "{statement}: {text}"
            );
        }

        fleet.run_ok(&["report", "--quiet", "--output", "report"]);
        let report = fleet.read_json("report/report.json");
        let units = report["units"].as_array().unwrap();
        assert_eq!(by_serial(units.iter().map(|unit| (unit, &unit["statement"]))), trend);
        dates_stay(&fleet, &trend, date(&report["newest_departure_utc"]).unwrap());
    }
    assert!(["normal", "plan", "act"].iter().all(|state| seen.contains_key(*state)), "{seen:?}");
}

/// Without new flights, a due date moves by two days at most, or the state says why: the unit is now over its limit,
/// or its data are too old.
fn dates_stay(fleet: &TestFleet, trend: &BTreeMap<String, Shown>, newest: Timestamp) {
    let plans = trend.iter().filter(|(_, shown)| shown.0 == "plan");
    let before: BTreeMap<&String, Timestamp> =
        plans.filter_map(|(serial, shown)| Some((serial, shown.1?))).collect();
    for days in [12, 28, 60, 90] {
        let as_of = (newest + SignedDuration::from_hours(24 * days)).to_string();
        let units = fleet.rows(&["trend", "--as-of", &as_of]);
        let now = by_serial(units.iter().map(|unit| (unit, unit)));
        for (serial, before) in &before {
            let (state, due, ..) = &now[*serial];
            let has_reason = matches!(state.as_str(), "act" | "unassessed");
            let moved = due.map(|due| due.duration_since(*before).abs());
            assert!(
                has_reason || moved <= Some(SignedDuration::from_hours(48)) && moved.is_some(),
                "{serial} {days}: {now:?}"
            );
        }
        let text = fleet.run_ok(&["trend", "--as-of", &as_of]);
        assert!(text.contains(&format!(", {days} days old; ")), "{text}");
    }
}
