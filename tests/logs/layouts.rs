//! Logs in shapes that are made row by row give the numbers of the plain ones. The other shapes are in
//! `tests/data/logs.md`.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use crate::harness::{Table, TestFleet, facts, rewrite, without, write_log};

/// Every number of every record, without what names the log and the settings it was read by.
fn numbers(fleet: &TestFleet) -> Vec<String> {
    let rows = without(&fleet.exported(), &["log_digest", "config_digest"]);
    let mut lines: Vec<String> = rows.lines().map(str::to_owned).collect();
    lines.sort();
    lines
}

/// One tail of the small fleet, so that each case costs a third.
fn one_tail() -> TestFleet {
    let fleet = TestFleet::sample();
    fleet.configure("sample-data/logs/**/*.parquet", "sample-data/logs/N412FP/*.parquet");
    fleet
}

fn logs(fleet: &TestFleet) -> Vec<PathBuf> {
    fleet.logs_of("N412FP")
}

/// A table of many flights, one file a day: rows of different flights alternate, and one flight goes on in the next file.
#[test]
fn flights_in_the_rows_of_a_few_files_give_the_numbers_of_their_own_files() {
    use ingest::parquet::writer::{Column, write_parquet};
    let fleet = one_tail();
    let tables: Vec<_> = logs(&fleet).iter().map(|log| (Table::read(log), facts(log))).collect();
    let mut days: [Vec<(usize, usize)>; 3] = Default::default();
    let longest = tables.iter().map(|(table, _)| table.rows()).max().unwrap();
    for (row, flight) in (0..longest).flat_map(|row| (0..tables.len()).map(move |flight| (row, flight))) {
        let day = if flight == 3 && row >= 4321 { 1 } else { flight / 4 };
        if row < tables[flight].0.rows() {
            days[day].push((flight, row));
        }
    }
    for (day, rows) in days.iter().enumerate() {
        let fact =
            |flight: usize, key: &str| tables[flight].1.iter().find(|(k, _)| k == key).unwrap().1.clone();
        let text = |key: &str| Column::Text(rows.iter().map(|row| fact(row.0, key)).collect());
        let keys = ["tail_number", "flight_id", "departure_utc", "flight_hours", "tail_hours_end"];
        let mut columns: Vec<(String, Column)> = keys.map(|key| (key.to_owned(), text(key))).into();
        for name in tables[0].0.names() {
            let all: Vec<Vec<f64>> = tables.iter().map(|(table, _)| table.numbers(&name)).collect();
            let values = rows.iter().map(|&(flight, row)| all[flight][row]).collect();
            columns.push((name, Column::Real(values)));
        }
        write_parquet(&fleet.path(&format!("days/{day}.parquet")), &columns, &[]).unwrap();
    }
    fleet.configure("sample-data/logs/N412FP/*.parquet", "days/*.parquet");
    fleet.configure("metadata = {", "by_row = true\ncolumns = {");
    fleet.configure("[store]", "pieces = true\n\n[store]");
    let account = fleet.run_ok(&["run"]);
    assert!(account.contains("10 logs: 10 new or changed"), "{account}");
    let plain = one_tail();
    plain.run_ok(&["run"]);
    assert_eq!(numbers(&fleet), numbers(&plain));
    assert!(fleet.run_ok(&["run"]).contains("10 logs: 0 new or changed, 10 already processed"));
    let checked = fleet.run_ok(&["check", "days/2.parquet"]);
    assert!(
        checked.contains("2 logs checked, 0 failed") && checked.contains("2.parquet#N412FP/"),
        "{checked}"
    );
}

/// The log of a Delta table, by the format's own specification: a version adds files, a later one removes one.
pub(crate) fn delta_log(table: &Path, added: &[&str], removed: &[&str]) {
    let log = table.join("_delta_log");
    std::fs::create_dir_all(&log).unwrap();
    let schema = r#"{\"type\":\"struct\",\"fields\":[{\"name\":\"time_s\",\"type\":\"double\",\"nullable\":true,\"metadata\":{}}]}"#;
    let mut first = format!(
        "{{\"protocol\":{{\"minReaderVersion\":1,\"minWriterVersion\":2}}}}\n{{\"metaData\":{{\"id\":\"af23c9d7-fff1-4a5a-a2c8-55c59bd782aa\",\"format\":{{\"provider\":\"parquet\",\"options\":{{}}}},\"schemaString\":\"{schema}\",\"partitionColumns\":[],\"configuration\":{{}}}}}}\n"
    );
    for name in added {
        let size = std::fs::metadata(table.join(name)).unwrap().len();
        writeln!(
            first,
            "{{\"add\":{{\"path\":\"{name}\",\"partitionValues\":{{}},\"size\":{size},\"modificationTime\":0,\"dataChange\":true}}}}"
        )
        .unwrap();
    }
    std::fs::write(log.join("00000000000000000000.json"), first).unwrap();
    let remove = |name: &&str| {
        format!("{{\"remove\":{{\"path\":\"{name}\",\"deletionTimestamp\":0,\"dataChange\":true}}}}\n")
    };
    std::fs::write(log.join("00000000000000000001.json"), removed.iter().map(remove).collect::<String>())
        .unwrap();
}

/// After a run over logs with missing rows: no flag is raised, and the gaps are those of the whole logs to 1 µm.
fn run_raises_no_flag(fleet: &TestFleet, kind: &str) {
    static WHOLE: LazyLock<Vec<serde_json::Value>> = LazyLock::new(|| {
        let fleet = one_tail();
        fleet.run_ok(&["run"]);
        fleet.rows(&["store", "export"])
    });
    fleet.run_ok(&["run"]);
    let found = fleet.rows(&["store", "export"]);
    assert_eq!(found.len(), WHOLE.len());
    for (row, whole) in found.iter().zip(WHOLE.iter()) {
        let [gap_m, whole_m] = [row, whole].map(|row| row["gap_m"].as_f64().unwrap());
        assert!((gap_m - whole_m).abs() < 1e-6, "{kind}: {gap_m} m, not {whole_m} m");
        let flags = row["flags"].to_string();
        assert!(!flags.contains("_spikes") && !flags.contains("_missing"), "{kind}: {flags}");
    }
}

/// Rows of one channel that are missing from a log: three in a row, or one in five hundred.
fn misses(kind: &str, channel: usize, row: usize) -> bool {
    match kind {
        "three" => (5_000 + 17 * channel..5_003 + 17 * channel).contains(&row),
        _ => row % 499 == 100 + 7 * channel,
    }
}

const CHANNELS: [&str; 3] = ["motor_deg", "screw_mm", "load_n"];

/// A file for each channel, each with rows of its own missing: no flag is raised, and the gaps stay.
#[test]
fn missing_rows_of_one_channel_in_its_own_file_raise_no_flag() {
    for kind in ["three", "few"] {
        let fleet = one_tail();
        for log in logs(&fleet) {
            for (k, channel) in CHANNELS.iter().enumerate() {
                let to = fleet.path(channel).join(log.file_name().unwrap());
                let is_own = |column: &str| column == "time_s" || column.ends_with(channel);
                rewrite(&log, &to, &facts(&log), is_own, |row| !misses(kind, k, row));
            }
        }
        fleet.configure("sample-data/logs/N412FP/*.parquet", "motor_deg/*.parquet");
        fleet.configure("[channel.screw_position]", "[channel.screw_position]\ngroup = \"screw\"");
        fleet.configure("[channel.load]", "[channel.load]\ngroup = \"load\"");
        let groups = "[group.screw]\nfiles = [\"screw_mm/*.parquet\"]\n\n\
                      [group.load]\nfiles = [\"load_n/*.parquet\"]\n\n[estimate]";
        fleet.configure("[estimate]", groups);
        run_raises_no_flag(&fleet, kind);
    }
}

/// A row per channel and instant, some rows missing: no flag is raised, and the gaps stay.
#[test]
fn missing_rows_of_a_long_log_raise_no_flag() {
    use ingest::parquet::writer::{Column, write_parquet};
    for kind in ["three", "few"] {
        let fleet = one_tail();
        for log in logs(&fleet) {
            let table = Table::read(&log);
            let time = table.numbers("time_s");
            let channels = table.columns().into_iter().filter_map(|(name, values)| {
                let channel = CHANNELS.iter().position(|channel| name.ends_with(channel))?;
                Some((channel, values, name))
            });
            let mut rows: Vec<(f64, String, f64)> = channels
                .flat_map(|(channel, values, name)| {
                    let kept = (0..time.len()).filter(|row| !misses(kind, channel, *row));
                    kept.map(|row| (time[row], name.clone(), values[row])).collect::<Vec<_>>()
                })
                .collect();
            rows.sort_by(|a, b| a.0.total_cmp(&b.0));
            let columns = [
                ("time_s".to_owned(), Column::Real(rows.iter().map(|row| row.0).collect())),
                ("parameter".to_owned(), Column::Text(rows.iter().map(|row| row.1.clone()).collect())),
                ("value".to_owned(), Column::Real(rows.iter().map(|row| row.2).collect())),
            ];
            write_parquet(&log, &columns, &facts(&log)).unwrap();
        }
        let layout = "[layout]\nname_column = \"parameter\"\nvalue_column = \"value\"\n\n[clock]";
        fleet.configure("[clock]", layout);
        run_raises_no_flag(&fleet, kind);
    }
}

/// A clock that starts again: the error names both settings, and neither drops samples in silence.
#[test]
fn a_clock_that_restarts_names_its_settings() {
    let fleet = one_tail();
    let log = &logs(&fleet)[0];
    let mut columns = Table::read(log).columns();
    let (_, times) = columns.iter_mut().find(|(name, _)| name == "time_s").unwrap();
    let half = times.len() / 2;
    let restart = times[half] - times[0];
    times[half..].iter_mut().for_each(|time| *time -= restart);
    write_log(log, columns, &facts(log));
    for command in ["check", "run"] {
        let result = fleet.freeplay(&[command]);
        assert_eq!(result.code, Some(1), "{result:?}");
        assert!(result.err.contains("error[time_goes_back]"), "{}", result.err);
        assert!(result.err.contains("split_at_jumps") && result.err.contains("wraps_at"), "{}", result.err);
        let hint = result.err.lines().find(|line| line.starts_with("hint: ")).unwrap();
        assert!(!hint.contains("max_back_s"), "{hint}");
    }
    fleet.configure("unit = \"s\"", "unit = \"s\"\nsplit_at_jumps = true");
    fleet.run_ok(&["run"]);
    assert_eq!(numbers(&fleet).len(), 1 + 10 * 4);
}
