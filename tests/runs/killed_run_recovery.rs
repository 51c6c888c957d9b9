//! The run after a killed run: the status of each log is known, and no log is skipped.

use serde_json::Value;

use crate::harness::{TestFleet, wait_until};

/// A run with one log in error, killed as soon as the store holds records of its first commit.
fn killed() -> TestFleet {
    let fleet = TestFleet::sample();
    std::fs::write(&fleet.logs()[0], b"broken").unwrap();
    let mut child = fleet.command(&["run", "--jobs", "1", "-q"]).spawn().unwrap();
    let entry = fleet.path("results/gaps/_delta_log/00000000000000000001.json");
    wait_until(|| entry.exists() || child.try_wait().unwrap().is_some());
    child.kill().unwrap();
    assert_eq!(child.wait().unwrap().code(), None, "the run ended before it could be killed");
    fleet
}

/// Number of records in the store, from the records alone.
fn records(fleet: &TestFleet) -> usize {
    fleet.run_ok(&["store", "export", "--format", "csv"]).lines().count() - 1
}

#[test]
fn a_killed_run_has_the_status_of_each_of_its_logs_and_the_next_run_does_the_rest() {
    let fleet = killed();
    let stored = records(&fleet);
    let killed = fleet.json(&["store", "runs"])[0].clone();
    let figure = |name: &str| killed[name].as_i64().unwrap();
    assert_eq!((killed["ended"].as_str(), &killed["exit_code"]), (Some("killed"), &Value::Null));
    assert_eq!((figure("found"), figure("done") + figure("not_reached")), (30, 30));
    assert_eq!(figure("estimated") + figure("refused"), stored as i64);
    assert!(figure("not_reached") > 0, "{killed}");
    let logs = fleet.rows(&["store", "runs", "--run", "last"]);
    let with = |class: &str| logs.iter().filter(|log| log["class"] == class).count() as i64;
    assert_eq!((logs.len(), with("not_reached")), (30, figure("not_reached")), "every log has a class");
    assert_eq!(with("done") + with("refused") + with("unaccounted") + with("error"), figure("done"));
    let output = fleet.run_ok(&["store", "info"]);
    let left = format!("{} not processed; `freeplay run` processes them", figure("not_reached"));
    assert!(output.contains("did not exit cleanly") && output.contains(&left), "{output}");

    let result = fleet.freeplay(&["run"]);
    assert_eq!(result.code, Some(1), "{result:?}");
    let line = format!("did not finish: {} log", killed["done"]);
    assert!(result.out.contains(&line), "{line} is not in {}", result.out);
    let runs = fleet.json(&["store", "runs"]);
    let same = ["run_id", "ended", "done", "estimated", "refused", "errors", "not_reached"];
    assert!(same.iter().all(|name| runs[0][name] == killed[name]), "{runs:#} was {killed:#}");
    assert_eq!(
        (runs[1]["ended"].as_str(), &runs[1]["not_reached"]),
        (Some("logs in error"), &Value::from(0))
    );
    let result = fleet.freeplay(&["run"]);
    assert!(!result.out.contains("did not finish"), "it is reported once: {}", result.out);
    assert_eq!(records(&fleet), 116, "29 sound logs of four actuators");
}

/// The list of files holds each row once, where the folder holds superseded files too.
#[test]
fn the_list_of_files_holds_every_row_once() {
    let fleet = TestFleet::sample();
    fleet.configure("sample-data/logs/**/*.parquet", "sample-data/logs/N412FP/*.parquet");
    fleet.run_ok(&["run", "--limit", "6"]);
    fleet.run_ok(&["run", "--redo", "--limit", "2"]);
    let rows = |table: &str| -> i64 {
        let listed = fleet.run_ok(&["store", "files", "--table", table]);
        let rows = |file: &str| {
            let file = std::fs::File::open(file).unwrap();
            let footer =
                parquet::file::metadata::ParquetMetaDataReader::new().parse_and_finish(&file).unwrap();
            footer.file_metadata().num_rows()
        };
        listed.lines().map(rows).sum()
    };
    assert_eq!(rows("gaps"), 24);
    // Two rows for each log that was to be done, and two for each run.
    assert_eq!((rows("logs"), rows("runs")), (16, 4));
}
