//! Output of the program: exit codes, formats, pipes without noise, and help for new users.

use std::collections::BTreeSet;

use crate::harness::{Table, TestFleet, rewrite, write_log};

/// Each line of stderr is an object with a time, a level and an event; the answer stays what it is.
#[test]
fn logs_are_structured_when_that_is_asked_for() {
    let fleet = TestFleet::sample();
    fleet.configure("sample-data/logs/**/*.parquet", "sample-data/logs/N412FP/*.parquet");
    std::fs::write(&fleet.logs()[0], b"broken").unwrap();
    let result = fleet.freeplay(&["run", "--log-format", "json", "--json"]);
    assert_eq!(result.code, Some(1), "{result:?}");
    let lines: Vec<serde_json::Value> =
        result.err.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert!(
        lines.iter().all(|l| l["time_utc"].is_string() && l["level"].is_string() && l["event"].is_string())
    );
    let with = |event: &str| lines.iter().filter(|line| line["event"] == event).collect::<Vec<_>>();
    assert_eq!(with("planned")[0]["logs"], 10);
    assert_eq!(with("log_finished").len(), 10);
    assert_eq!(with("complaint")[0]["code"], "not_parquet");
    let stored: u64 = with("stored").iter().map(|line| line["logs"].as_u64().unwrap()).sum();
    assert_eq!(stored, 10);
    assert_eq!(result.json()["done"], 10);
    let wrong = fleet.freeplay(&["run", "--config", "none.toml", "--log-format", "json"]);
    assert!(wrong.err.lines().all(|line| line.starts_with('{')), "{}", wrong.err);
}

/// Proposes a configuration from the logs in `qar`, and accepts the values of its part; the proposal as it was written.
fn propose(fleet: &TestFleet) -> String {
    fleet.run_ok(&["init", "new-fleet", "--from", "qar"]);
    let proposed = fleet.read("new-fleet/pipeline.toml");
    fleet.edit("new-fleet/pipeline.toml", |text| text.replace("placeholder = true\n", ""));
    proposed
}

/// Rows of installations that a proposal holds.
fn proposed_stays(fleet: &TestFleet) -> usize {
    let table = fleet.read("new-fleet/installations.csv");
    table.lines().filter(|line| line.starts_with("TC-JR")).count()
}

/// Logs without metadata, identified by their path only: the mapping that `init` proposes passes `check` and `run`
/// unchanged.
#[test]
fn what_init_proposes_for_foreign_logs_runs_as_it_stands() {
    let fleet = TestFleet::sample();
    for (log, tail) in fleet.logs().iter().zip(["TC-JRA", "TC-JRB"]) {
        let named = fleet.path(&format!("qar/{tail}/FLT_2026-09-10_1307.parquet"));
        rewrite(log, &named, &Vec::new(), |_| true, |_| true);
    }
    fleet.run_ok(&["init", "unseen", "--from", "qar"]);
    let refused = fleet.freeplay(&["run", "--config", "unseen/pipeline.toml"]);
    assert!(refused.code == Some(2) && refused.err.contains("error[placeholder]"), "{refused:?}");
    let proposed = propose(&fleet);
    assert!(!proposed.lines().any(|line| line.starts_with("limit_m")), "{proposed}");
    assert_eq!(proposed_stays(&fleet), 8);
    let checked = fleet.run_ok(&["check", "--config", "new-fleet/pipeline.toml"]);
    assert!(checked.contains("2 logs checked, 0 failed"), "{checked}");
    let account = fleet.run_ok(&["run", "--config", "new-fleet/pipeline.toml"]);
    assert!(account.contains("8 records of 2 flights"), "{account}");
    let records = fleet.run_ok(&["query", "tail", "TC-JRB", "--config", "new-fleet/pipeline.toml"]);
    assert!(records.contains("2026-09-10 13:07"), "{records}");
}

/// Two tails name their columns as no one does in the first folder, one of them in other units and without a redundant
/// sensor; a part of the files cannot be read. All tails are mapped, and the patterns cover every folder.
#[test]
fn a_proposal_covers_every_tail_and_variant_of_the_columns() {
    let fleet = TestFleet::sample();
    let named = |name: &str, tail: &str| match tail {
        "TC-JRA" => name.replace("_motor_deg", "_MTR_RESOLVER_DEG").replace("_load_n", "_FORCE_N"),
        _ => name.replace("time_s", "GMT_SEC"),
    };
    for (log, tail) in fleet.logs().iter().step_by(11).zip(["TC-JRA", "TC-JRB", "TC-JRC"]) {
        let mut columns = Table::read(log).columns();
        columns.iter_mut().for_each(|(name, _)| *name = named(name, tail));
        for hour in ["0413", "1307"] {
            let file = fleet.path(&format!("qar/ac={tail}/FLT_2026-09-10_{hour}.parquet"));
            write_log(&file, columns.clone(), &[]);
        }
    }
    std::fs::write(fleet.path("qar/ac=TC-JRA/FLT_2026-09-09_0413.parquet"), "PAR1").unwrap();
    let proposed = propose(&fleet);
    assert!(proposed.contains("3 folders, 7 logs matched"), "{proposed}");
    assert_eq!(proposed_stays(&fleet), 12);
    let checked = fleet.freeplay(&["check", "--config", "new-fleet/pipeline.toml"]);
    assert!(checked.out.contains("7 logs checked, 1 failed"), "{checked:?}\n{proposed}");
}

/// Loads in a folder of their own, paths from the folder of the configuration, and no invented serial number.
#[test]
fn what_init_proposes_for_channel_groups_runs_as_it_stands() {
    let fleet = TestFleet::sample();
    for log in fleet.logs().iter().take(2) {
        let (name, own) = (log.file_name().unwrap(), crate::harness::facts(log));
        let is_load = |c: &str| c.ends_with("_load_n");
        rewrite(log, &fleet.path("qar/loads").join(name), &own, |c| is_load(c) || c == "time_s", |_| true);
        rewrite(log, &fleet.path("qar/positions").join(name), &own, |c| !is_load(c), |_| true);
    }
    let toml = propose(&fleet);
    assert!(toml.contains("files = [\"../qar/positions/**/*.parquet\"]"), "{toml}");
    let account = fleet.run_ok(&["run", "--config", "new-fleet/pipeline.toml"]);
    assert!(account.contains("8 records of 2 flights"), "{account}");
}

/// Hive folders name tail, departure and position; the table of installations has each pair of tail and position once.
#[test]
fn what_init_proposes_for_hive_folders_runs_as_it_stands() {
    let fleet = TestFleet::sample();
    let log = &fleet.logs()[0];
    for position in ["aileron_left", "aileron_right"] {
        let folder = format!("qar/tail=TC-JRA/off=2026-09-10T13%3A07%3A19Z/actuator={position}");
        let file = fleet.path(&folder).join("part-0.parquet");
        rewrite(log, &file, &Vec::new(), |c| c.starts_with(position) || c == "time_s", |_| true);
    }
    propose(&fleet);
    let account = fleet.run_ok(&["run", "--config", "new-fleet/pipeline.toml"]);
    assert!(
        account.contains("2 records of 2 flights") || account.contains("2 records of 1 flight"),
        "{account}"
    );
}

/// Where neither tail nor position is known, the table of installations has its header and no row.
#[test]
fn init_invents_no_serial_number() {
    let fleet = TestFleet::sample();
    let log = &fleet.logs()[0];
    rewrite(log, &fleet.path("qar/a.parquet"), &Vec::new(), |c| c == "time_s", |_| true);
    propose(&fleet);
    let table = fleet.read("new-fleet/installations.csv");
    let rows: Vec<&str> = table.lines().filter(|line| !line.starts_with('#')).collect();
    assert_eq!(rows, ["tail_number,position,part_number,serial_number,installed_utc,removed_utc"]);
}

#[test]
fn rows_come_as_table_json_csv_and_parquet() {
    let fleet = TestFleet::sample();
    fleet.run_ok(&["run", "--limit", "3"]);
    let json = fleet.rows(&["store", "export"]);
    assert_eq!(json.len(), 12);
    assert!(json[0]["temperature_c"].is_null(), "nulls are written");
    assert!(json[0]["departure_utc"].as_str().unwrap().ends_with('Z'));
    let csv = fleet.run_ok(&["store", "export", "--format", "csv"]);
    assert!(
        csv.starts_with("tail_number,position,part_number,serial_number,flight_id,departure_utc,"),
        "{csv}"
    );
    assert_eq!(csv.lines().count(), 13);
    let gap: f64 = csv.lines().nth(1).unwrap().split(',').nth(12).unwrap().parse().unwrap();
    assert_eq!(Some(gap), json[0]["gap_m"].as_f64(), "both formats hold bitwise identical values");
    let flags = csv.lines().next().unwrap().split(',').position(|name| name == "flags").unwrap();
    for (line, row) in csv.lines().skip(1).zip(&json) {
        let joined: Vec<_> =
            row["flags"].as_array().unwrap().iter().filter_map(|flag| flag.as_str()).collect();
        assert_eq!(line.split(',').nth(flags), Some(joined.join(";").as_str()));
    }
    fleet.run_ok(&["store", "export", "--format", "parquet", "--output", "all.parquet"]);
    assert_eq!(Table::read(&fleet.path("all.parquet")).rows(), 12);
    assert!(fleet.run_ok(&["trend"]).contains(" units as of "));
}

/// Rows 3000 to 3399 are missing: the next sample of the trace has the time of the log, not that of its number.
#[test]
fn a_trace_has_the_log_s_own_times_after_a_break() {
    let fleet = TestFleet::sample();
    let log = &fleet.logs()[0];
    let own_s = Table::read(log).numbers("time_s");
    let broken = fleet.path("broken.parquet");
    let keep = |row: usize| !(3000..3400).contains(&row);
    rewrite(log, &broken, &crate::harness::facts(log), |_| true, keep);
    let part = ["--part", "EMA-27-1040", "--trace", "trace.parquet"];
    fleet.run_ok(&[&["estimate", "broken.parquet"][..], &part].concat());
    let times_s = Table::read(&fleet.path("trace.parquet")).numbers("time_s");
    for (sample, row) in [(0, 0), (2999, 2999), (3000, 3400), (4000, 4400)] {
        let expected_s = own_s[row] - own_s[0];
        assert!(
            (times_s[sample] - expected_s).abs() < 1e-3,
            "{sample}: {} is not {expected_s}",
            times_s[sample]
        );
    }
}

#[test]
fn a_trace_holds_every_sample_the_filter_saw() {
    let fleet = TestFleet::of("flights");
    fleet.run_ok(&["estimate", "A_nominal.parquet", "--part", "A", "--trace", "trace.parquet"]);
    let trace = Table::read(&fleet.path("trace.parquet"));
    assert_eq!(trace.rows(), 37_495);
    assert!(trace.numbers("s_m").iter().all(|s| s.is_finite()));
    // The estimated position follows the measured one within its noise; the motor's speed adds up to its travel.
    let (dx_m, estimated_m) = (trace.numbers("dx_m"), trace.numbers("dx_estimated_m"));
    let squares = dx_m.iter().zip(&estimated_m).map(|(y, x)| (y - x).powi(2)).sum::<f64>();
    assert!((squares / 37_495.0).sqrt() < 5e-6, "{squares}");
    assert!(trace.numbers("dx_speed_estimated_m_per_s").iter().all(|v| v.abs() < 0.1));
    let (time_s, motor_m) = (trace.numbers("time_s"), trace.numbers("motor_m"));
    let speed = trace.numbers("motor_speed_m_per_s");
    let travel_m: f64 = (2..2000).map(|k| speed[k] * (time_s[k] - time_s[k - 1])).sum();
    assert!((travel_m - (motor_m[2000] - motor_m[1])).abs() < 2e-4, "{travel_m}");
    let flank = trace.numbers("flank");
    let pressed = |side: f64| flank.iter().filter(|f| **f * side > 0.0).count();
    assert!(pressed(1.0) > 10_000 && pressed(-1.0) > 10_000 && pressed(1.0) + pressed(-1.0) < flank.len());
}

#[test]
fn estimates_of_another_program_are_assessed_and_an_assessment_sees_nothing_later() {
    let fleet = TestFleet::sample();
    let row = |day: i32| {
        let gap_m = 50e-6 + f64::from(day) * 1e-6;
        format!("U1,2026-02-{day:02}T08:00:00Z,{gap_m:e},2.0,EMA-27-1040\n")
    };
    let header = "serial,departure_utc,gap_m,flight_hours,part_number\n".to_owned();
    let table: String = std::iter::once(header).chain((1..=28).map(row)).collect();
    std::fs::write(fleet.path("history.csv"), &table).unwrap();
    std::fs::write(
        fleet.path("dates.csv"),
        "serial,as_of_utc\nU1,2026-02-15T12:00:00Z\nU1,2026-02-28T12:00:00Z\n",
    )
    .unwrap();
    let args = ["trend", "--estimates", "history.csv", "--queries", "dates.csv"];
    let rows = fleet.rows(&args);
    assert_eq!(rows.iter().map(|r| r["flights"].as_i64().unwrap()).collect::<Vec<_>>(), [15, 28]);
    // One micrometre in two hours.
    for row in &rows {
        assert!((row["rate_m_per_hour"].as_f64().unwrap() / 0.5e-6 - 1.0).abs() < 0.3, "{row}");
    }
    let cut: Vec<&str> = table.lines().take(16).collect();
    std::fs::write(fleet.path("history.csv"), cut.join("\n")).unwrap();
    assert_eq!(fleet.rows(&args)[0], rows[0], "what came later changed what was known");
}

/// Twenty micrometres and half a micrometre more each day, in a folder without a configuration: 100 µm are met a
/// hundred and twenty days after the fortieth, at an hour a day.
#[test]
fn a_table_made_elsewhere_is_judged_without_a_configuration() {
    let fleet = TestFleet::empty();
    let row = |day: i64| {
        let departure = "2026-01-01T06:00:00Z".parse::<jiff::Timestamp>().unwrap();
        let departure = departure + jiff::SignedDuration::from_hours(24 * day);
        format!("U1,{departure},{:e},1.0\n", 20e-6 + 0.5e-6 * day as f64 + 1e-8 * f64::from(day % 3 == 0))
    };
    let header = "serial_number,departure_utc,gap_m,flight_hours\n".to_owned();
    let table: String = std::iter::once(header).chain((0..=40).map(row)).collect();
    std::fs::write(fleet.path("history.csv"), table).unwrap();
    let judged = |more: &[&str]| {
        let result = fleet.freeplay(&[&["trend", "--estimates", "history.csv", "--json"], more].concat());
        assert_eq!(result.code, Some(0), "{result:?}");
        (result.json()[0].clone(), result.err)
    };
    let (without, errors) = judged(&[]);
    assert!(
        without["state"] == "unassessed" && without["rate_m_per_hour"].as_f64().unwrap() > 0.4e-6,
        "{without}"
    );
    assert!(errors.contains("--limit-m"), "{errors}");
    let (with, errors) = judged(&["--limit-m", "100e-6", "--as-of", "2026-02-11T00:00:00Z"]);
    let hours = |name: &str| with[name].as_f64().unwrap();
    assert!((hours("crossing_hours_p05")..=hours("crossing_hours_p95")).contains(&120.0), "{with}");
    assert_eq!((with["state"].as_str(), errors.as_str()), (Some("plan"), ""));
    // A limit given in micrometres would never be reached.
    let result = fleet.freeplay(&["trend", "--estimates", "history.csv", "--limit-m", "100"]);
    assert_eq!(result.code, Some(2), "{result:?}");
    assert!(result.err.contains("150e-6"), "{}", result.err);
    // A configuration that is named must be there.
    let named = fleet.freeplay(&["trend", "--estimates", "history.csv", "--config", "fleet.toml"]);
    assert_eq!(named.code, Some(2), "{named:?}");
}

/// What a planner needs is there at 80 columns, no line is longer, and no word is cut: unit, state, date, reason and how
/// sure, with the normal units counted.
#[test]
fn tables_fit_80_columns_and_keep_what_matters() {
    let fleet = TestFleet::processed();
    let at_80 = |args: &[&str]| {
        let output = fleet.command(args).env("COLUMNS", "80").output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{args:?}");
        let text = String::from_utf8(output.stdout).unwrap();
        assert!(!text.contains('\u{1b}') && !text.contains('…'), "no colour in a pipe, no word cut: {text}");
        assert!(text.lines().all(|line| line.chars().count() <= 80), "{text}");
        text.split_whitespace().collect::<Vec<_>>().join(" ")
    };
    let shown = [
        "▲ plan 10 Dec N414FP aileron_left 1040-0013",
        "139.4 of 150.0 µm, +745.8 µm/1000 FH; 5 % by 10 Dec, 50 % by 25 Dec, 95 % by 12 Jan",
    ];
    let tables: [&[&str]; 4] = [
        &["trend"],
        &["work", "list"],
        &["run", "--no-progress"],
        &["query", "tail", "N414FP", "--last", "3"],
    ];
    for args in tables {
        let table = at_80(args);
        assert!(shown.iter().all(|text| table.contains(text)), "{table}");
        let (normal, first) = (table.find("normal"), table.find("1040-0009").unwrap_or(usize::MAX));
        assert!(args[0] == "work" || normal.is_some(), "normal units are counted: {table}");
        assert!(table.find("1040-0013") < Some(first), "the earlier date comes first: {table}");
        assert!(!table.contains("○ normal") && table.matches("| less -S").count() == 1, "{table}");
    }
    assert!(fleet.run_ok(&["trend", "--all"]).matches("○ normal").count() == 10);
    let records = at_80(&["query", "N414FP", "--last", "3"]);
    assert!(records.contains("3 records departure [UTC] tail position serial"), "{records}");
}

#[test]
fn json_lines_hold_the_objects_of_the_json_array() {
    let fleet = TestFleet::sample();
    fleet.run_ok(&["run", "--limit", "1"]);
    for args in [&["trend"][..], &["store", "export"], &["store", "runs"], &["check", "--limit", "1"]] {
        let array = fleet.rows(args);
        let lines = fleet.run_ok(&[args, &["--format", "jsonl"]].concat());
        let lines: Vec<serde_json::Value> =
            lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
        assert_eq!(lines, array, "{args:?}");
        assert!(!lines.is_empty(), "{args:?}");
    }
}

/// Neither a key without a meaning on the page, nor one that is not there any more.
#[test]
fn the_summary_of_a_run_has_the_keys_of_its_page() {
    let page = std::fs::read_to_string(crate::harness::top().join("docs/columns.md")).unwrap();
    let section = page.split("## Summary of a run").nth(1).unwrap().split("\n## ").next().unwrap();
    let named: BTreeSet<&str> = section
        .lines()
        .filter(|line| line.starts_with("| `"))
        .flat_map(|line| line[2..].split(" |").next().unwrap().split(", "))
        .map(|key| key.trim().trim_matches('`'))
        .collect();
    let fleet = TestFleet::sample();
    let log = &fleet.logs()[0];
    std::fs::write(log.with_file_name("torn.parquet"), &std::fs::read(log).unwrap()[..1000]).unwrap();
    let summary = fleet.freeplay(&["run", "--json"]).json();
    let keys: BTreeSet<&str> = summary.as_object().unwrap().keys().map(String::as_str).collect();
    assert_eq!(named, keys);
    let error = &summary["errors"][0];
    for key in ["log", "complaint"] {
        assert!(error[key].is_string() || error[key].is_object(), "{error}");
    }
    for key in error["complaint"].as_object().unwrap().keys() {
        assert!(section.contains(&format!("`{key}`")), "{key} is not on the page");
    }
}
