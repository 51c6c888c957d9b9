//! Answers a fleet's queries from a CSV of its estimates, for a scorer to judge.
//!
//! `score OBSERVATIONS QUERIES PREDICTIONS CHANGES`: observations hold `serial, part_number, installation,
//! departure_us, flight_hours, tail_hours_end, load_reversals, gap_m, gap_se_m, flight_id`, queries
//! `serial, as_of_us, as_of_flight_id`, each with a header line.
#![allow(clippy::print_stderr, clippy::unwrap_used, reason = "a developer's tool, which may fail loudly")]

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::time::{Duration, Instant};

use trend::{ChangePointKind, FleetPrior, Observation, Series, Settings, UsageDefaults, WearStatus, assess};

const LIMIT_M: f64 = 1e-4;
const MONTH_US: i64 = 30 * 86_400_000_000;

struct Unit {
    series: Series,
    flight_ids: BTreeMap<i64, String>,
}

fn units(path: &str) -> BTreeMap<String, Unit> {
    let text = std::fs::read_to_string(path).unwrap();
    let mut rows: BTreeMap<String, (Vec<Observation>, BTreeMap<i64, String>)> = BTreeMap::new();
    for line in text.lines().skip(1) {
        let f: Vec<&str> = line.split(',').collect();
        let unit = rows.entry(f[0].into()).or_default();
        let departure_us = f[3].parse().unwrap();
        unit.1.insert(departure_us, f[9].into());
        unit.0.push(Observation {
            departure_us,
            installation: f[2].parse().unwrap(),
            flight_hours: f[4].parse().ok(),
            tail_hours_end: f[5].parse().ok(),
            load_reversals: f[6].parse().ok(),
            gap_m: f[7].parse().ok(),
            gap_se_m: f[8].parse().ok(),
        });
    }
    let unit = |(rows, flight_ids)| Unit {
        series: Series::new(rows, &UsageDefaults::default()).unwrap(),
        flight_ids,
    };
    rows.into_iter().map(|(serial, of)| (serial, unit(of))).collect()
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let units = units(&arguments[1]);
    let settings = Settings::for_limit(LIMIT_M);
    let mut priors: BTreeMap<i64, FleetPrior> = BTreeMap::new();
    let mut prior = |as_of_us: i64| {
        let month = as_of_us.div_euclid(MONTH_US);
        let learn = || FleetPrior::learn(units.values().map(|u| &u.series), month * MONTH_US, LIMIT_M, None);
        priors.entry(month).or_insert_with(learn).clone()
    };
    let mut predictions = String::from(
        "serial,as_of_flight_id,rul_median_fh,rul_p05_fh,rul_p95_fh,trend_detected,gap_m,gap_se_m,growth_probability\n",
    );
    let mut spent = Duration::ZERO;
    let queries = std::fs::read_to_string(&arguments[2]).unwrap();
    for line in queries.lines().skip(1) {
        let f: Vec<&str> = line.split(',').collect();
        let as_of_us: i64 = f[1].parse().unwrap();
        let unit = &units[f[0]];
        let prior = prior(as_of_us);
        let began = Instant::now();
        let assessment = assess(&unit.series, as_of_us, &settings, Some(&prior), None).unwrap();
        spent += began.elapsed();
        let hours = |h: Option<f64>| h.map_or(String::new(), |h| h.to_string());
        let (low, likely, high) =
            assessment.crossing.map_or((None, None, None), |c| (c.p05_hours, c.p50_hours, c.p95_hours));
        let (low, likely, high) = (hours(low), hours(likely), hours(high));
        let (gap_m, se_m) = assessment.level.map_or((f64::NAN, f64::NAN), |l| (l.gap_m, l.se_m));
        writeln!(
            predictions,
            "{},{},{likely},{low},{high},{},{gap_m:e},{se_m:e},{}",
            f[0],
            f[2],
            assessment.wear == WearStatus::Wearing,
            assessment.growth_probability.unwrap_or(0.0)
        )
        .unwrap();
    }
    eprintln!(
        "{} queries, {:.0} µs each",
        queries.lines().count() - 1,
        spent.as_micros() as f64 / (queries.lines().count() - 1) as f64
    );
    std::fs::write(&arguments[3], predictions).unwrap();
    let mut changes = String::from("serial,flight_id,kind,delta_m\n");
    let last_us =
        units.values().filter_map(|u| u.series.flights().last()).map(|f| f.departure_us).max().unwrap();
    for (serial, unit) in &units {
        let assessment = assess(&unit.series, last_us, &settings, Some(&prior(last_us)), None).unwrap();
        for change in assessment.changes {
            let kind = match change.kind {
                ChangePointKind::Step | ChangePointKind::Reset => "step",
                ChangePointKind::Onset => "onset",
                ChangePointKind::Recorded => continue,
            };
            writeln!(
                changes,
                "{serial},{},{kind},{:e}",
                unit.flight_ids[&change.departure_us], change.step_m
            )
            .unwrap();
        }
    }
    std::fs::write(&arguments[4], changes).unwrap();
}
