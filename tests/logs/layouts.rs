//! Logs in other shapes give the numbers of the plain ones: normalized, re-encoded, in pieces, in groups of
//! files, read by overrides.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use crate::harness::{Facts, Table, TestFleet, facts, facts_with, rewrite, without, write_log};

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

/// The numbers of that tail's logs as they are.
fn plain() -> Vec<String> {
    static PLAIN: LazyLock<Vec<String>> = LazyLock::new(|| {
        let fleet = one_tail();
        fleet.run_ok(&["run"]);
        numbers(&fleet)
    });
    PLAIN.clone()
}

fn logs(fleet: &TestFleet) -> Vec<PathBuf> {
    fleet.logs_of("N412FP")
}

#[test]
fn normalized_logs_give_the_same_gaps_bit_for_bit() {
    for encoding in ["split", "compatible"] {
        let fleet = one_tail();
        let output = fleet.run_ok(&["normalize", "--output", "normalized", "--encoding", encoding]);
        assert!(output.contains("40 normalized logs of 10 logs"), "{output}");
        fleet.configure("sample-data/logs/N412FP/*.parquet", "normalized/**/*.parquet");
        fleet.run_ok(&["run"]);
        assert_eq!(numbers(&fleet), plain(), "{encoding}");
        let output = facts(&fleet.glob("normalized/N412FP/*/*.parquet")[0]);
        for key in ["freeplay.source_log", "freeplay.source_digest", "freeplay.step_s", "freeplay.units"] {
            assert!(output.iter().any(|(k, v)| k == key && !v.is_empty()), "{key}");
        }
    }
}

/// The same samples as doubles instead of floats: another file, another digest, the same flight.
#[test]
fn a_log_encoded_anew_is_recognised_by_its_samples() {
    let fleet = one_tail();
    let log = &logs(&fleet)[3];
    rewrite(log, &log.with_file_name("again.parquet"), &facts(log), |_| true, |_| true);
    fleet.run_ok(&["run"]);
    assert_eq!(numbers(&fleet), plain());
}

#[test]
fn a_flight_in_pieces_is_one_flight_whatever_the_pieces_are_called() {
    let fleet = one_tail();
    for (n, log) in logs(&fleet).iter().enumerate() {
        let names = if n % 2 == 0 { ["a", "b"] } else { ["b", "a"] };
        let piece = |name: &str| log.with_file_name(format!("{n}-{name}.parquet"));
        rewrite(log, &piece(names[0]), &facts(log), |_| true, |row| row < 4321);
        rewrite(log, &piece(names[1]), &facts(log), |_| true, |row| row >= 4321);
        std::fs::remove_file(log).unwrap();
    }
    fleet.configure("[store]", "pieces = true\n\n[store]");
    let account = fleet.run_ok(&["run"]);
    assert!(account.contains("10 logs: 10 new or changed"), "{account}");
    assert_eq!(numbers(&fleet), plain());
    assert!(fleet.run_ok(&["run"]).contains("10 logs: 0 new or changed, 10 already processed"));
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
    assert_eq!(numbers(&fleet), plain());
    assert!(fleet.run_ok(&["run"]).contains("10 logs: 0 new or changed, 10 already processed"));
    let checked = fleet.run_ok(&["check", "days/2.parquet"]);
    assert!(
        checked.contains("2 logs checked, 0 failed") && checked.contains("2.parquet#N412FP/"),
        "{checked}"
    );
}

/// Positions in one file, loads in another: of these, one row of each `every`.
fn loads_apart(every: usize, identity: impl Fn(&Path) -> Facts) -> TestFleet {
    let fleet = one_tail();
    for log in logs(&fleet) {
        let [loads, positions] =
            ["loads", "positions"].map(|to| fleet.path(to).join(log.file_name().unwrap()));
        let is_load = |column: &str| column.ends_with("_load_n");
        let own = identity(&log);
        rewrite(&log, &loads, &own, |c| is_load(c) || c == "time_s", |row| row % every == 0);
        rewrite(&log, &positions, &own, |c| !is_load(c), |_| true);
    }
    fleet.configure("sample-data/logs/N412FP/*.parquet", "positions/*.parquet");
    fleet.configure(
        "[channel.load]",
        "[group.loads]\nfiles = [\"loads/*.parquet\"]\n\n[channel.load]\ngroup = \"loads\"",
    );
    fleet
}

/// The same numbers, also under a flight number that flies every day.
#[test]
fn loads_in_files_of_their_own_find_their_flights() {
    let fleet = loads_apart(1, facts);
    fleet.run_ok(&["run"]);
    assert_eq!(numbers(&fleet), plain());
    let fleet = loads_apart(1, |log| facts_with(log, "flight_id", "FP100"));
    fleet.run_ok(&["run"]);
    // The fifth column is the flight id.
    let unnamed = |line: String| {
        let cells: Vec<&str> = line.split(',').collect();
        [&cells[..4], &cells[5..]].concat().join(",")
    };
    let [found, wanted] = [numbers(&fleet), plain()].map(|lines| lines.into_iter().map(unnamed));
    assert!(found.eq(wanted));
}

/// Loads at half the rate: nearly the same numbers.
#[test]
fn loads_of_half_the_rate_give_nearly_the_same_gaps() {
    let fleet = loads_apart(2, facts);
    fleet.run_ok(&["run"]);
    fleet.run_ok(&["store", "export", "--format", "parquet", "--output", "half.parquet"]);
    let truth = Table::read(&fleet.path("sample-data/truth.parquet")).by_flight("gap_m");
    let found = Table::read(&fleet.path("half.parquet")).by_flight("gap_m").into_iter();
    let mut errors: Vec<f64> = found.map(|(key, gap)| (gap / truth[&key] - 1.0).abs()).collect();
    errors.sort_by(f64::total_cmp);
    let (median, worst) = (errors[errors.len() / 2], errors[errors.len() - 1]);
    assert!(median < 0.008 && worst < 0.03, "a load at 50 Hz costs {median}, at most {worst}");
}

#[test]
fn a_broken_file_of_a_group_and_one_without_a_flight_are_reported() {
    let fleet = loads_apart(1, facts);
    std::fs::write(&fleet.glob("loads/*.parquet")[0], b"PAR1 truncated").unwrap();
    std::fs::remove_file(&fleet.glob("positions/*.parquet")[1]).unwrap();
    let result = fleet.freeplay(&["run"]);
    assert_eq!(result.code, Some(1), "{result:?}");
    assert!(result.err.contains("error[not_parquet]") && result.err.contains("loads/"), "{}", result.err);
    let checked = fleet.freeplay(&["check"]);
    assert!(checked.err.contains("no matching main log for this flight"), "{}", checked.err);
}

/// A column is renamed after some years: each log is read with its own schema, and `check` reports the change.
#[test]
fn changed_columns_are_reported() {
    let fleet = one_tail();
    let log = &logs(&fleet)[0];
    rewrite(log, &log.with_file_name("x.parquet"), &facts(log), |c| c != "aileron_left_load_n", |_| true);
    std::fs::rename(log.with_file_name("x.parquet"), log).unwrap();
    let output = fleet.run_ok(&["check"]);
    assert!(output.contains("missing or whose type differs between 10 logs"), "{output}");
    assert!(output.contains("`aileron_left_load_n`: Float32 in 9"), "{output}");
    assert!(
        output.contains("`aileron_left_motor_deg`: Float32 in 9") && output.contains("Float64 in 1"),
        "{output}"
    );
    assert!(output.contains("channel_unmapped: the log lacks aileron_left_load_n"), "{output}");
    let account = fleet.run_ok(&["run"]);
    assert!(account.contains("40 records") && account.contains("channel_unmapped 1"), "{account}");
}

#[test]
fn a_flights_table_tells_what_the_logs_do_not() {
    let fleet = one_tail();
    let mut table = String::from("reg,leg,off,fh,log\n");
    for (n, log) in logs(&fleet).iter().enumerate() {
        let known = facts(log);
        let fact = |key: &str| known.iter().find(|(k, _)| k == key).map(|(_, v)| v.clone()).unwrap();
        let name = log.file_name().unwrap().to_str().unwrap();
        writeln!(table, "N412FP,L{n},{},{},{name}", fact("departure_utc"), n + 1).unwrap();
    }
    std::fs::write(fleet.path("flights.csv"), table).unwrap();
    fleet.edit("pipeline.toml", |text| {
        text.lines().filter(|line| !line.starts_with("metadata = {")).flat_map(|line| [line, "\n"]).collect()
    });
    fleet.configure(
        "[store]",
        "flights = \"flights.csv\"\n\n[columns.flights]\ntail_number = \"reg\"\nflight_id = \"leg\"\n\
         departure_utc = \"off\"\nflight_hours = \"fh\"\npath = \"log\"\n\n[store]",
    );
    fleet.run_ok(&["run"]);
    assert_eq!(fleet.json(&["query", "flight", "L3"])[0]["flight_hours"], 4.0);
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

/// A screw position in every second row, and nothing between: `check` names the setting, and it gives the gaps.
#[test]
fn check_names_the_rate_of_a_slower_screw() {
    let fleet = one_tail();
    for log in logs(&fleet) {
        let mut columns = Table::read(&log).columns();
        for (_, values) in columns.iter_mut().filter(|(name, _)| name.ends_with("screw_mm")) {
            values.iter_mut().skip(1).step_by(2).for_each(|value| *value = f64::NAN);
        }
        write_log(&log, columns, &facts(&log));
    }
    let text = fleet.freeplay(&["check", "--limit", "1"]).out;
    assert!(text.contains("rate_hz = 50"), "{text}");
    fleet.configure("_screw_mm\"", "_screw_mm\"\nrate_hz = 50.0");
    let text = fleet.run_ok(&["check", "--limit", "1"]);
    assert!(!text.contains("rate_hz"), "{text}");
}

/// A motor position of one value throughout: `check` names the column that is read in its place.
#[test]
fn check_names_the_redundant_column_that_is_read() {
    let fleet = one_tail();
    let log = &logs(&fleet)[0];
    let mut columns = Table::read(log).columns();
    let motor = columns.iter_mut().find(|(name, _)| name == "aileron_left_motor_deg").unwrap();
    let constant = vec![1.0; motor.1.len()];
    let moving = std::mem::replace(&mut motor.1, constant);
    columns.push(("aileron_left_motor_b".to_owned(), moving));
    write_log(log, columns, &facts(log));
    let other = "unit = \"deg\"\nalternatives = [{ column = \"{position}_motor_b\", unit = \"deg\" }]";
    fleet.configure("unit = \"deg\"", other);
    let text = fleet.run_ok(&["check", log.to_str().unwrap()]);
    assert!(text.contains("aileron_left_motor_b") && !text.contains("aileron_left_motor_deg"), "{text}");
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

/// Three thirds of a flight, each with the instant of its first row as its departure, as files `c`, `a` and `b`.
fn thirds(fleet: &TestFleet) {
    let log = &logs(fleet)[0];
    let whole: BTreeMap<String, String> = facts(log).into_iter().collect();
    let departure: jiff::Timestamp = whole["departure_utc"].parse().unwrap();
    let rows = Table::read(log).rows();
    for (k, name) in ["c.parquet", "a.parquet", "b.parquet"].into_iter().enumerate() {
        let own = departure + jiff::SignedDuration::from_secs(36 * k as i64);
        let own = facts_with(log, "departure_utc", &own.to_string());
        let part = rows * k / 3..rows * (k + 1) / 3;
        rewrite(log, &log.with_file_name(name), &own, |_| true, |row| part.contains(&row));
    }
    std::fs::remove_file(log).unwrap();
}

/// In whichever order the pieces are found, none is taken for a flight; once the setting declares pieces, they are read.
#[test]
fn undeclared_pieces_with_their_own_departures_are_an_error() {
    let fleet = one_tail();
    thirds(&fleet);
    let late = fleet.path("sample-data/logs/N412FP/a.parquet");
    let bytes = std::fs::read(&late).unwrap();
    std::fs::remove_file(&late).unwrap();
    let faults = |text: &str| text.matches("error[pieces_undeclared]").count();
    for command in ["check", "run"] {
        let result = fleet.freeplay(&[command]);
        assert_eq!((result.code, faults(&result.err)), (Some(1), 2), "{result:?}");
        assert!(
            result.err.contains("logs.pieces = true") && result.err.contains("logs.pieces = false"),
            "{result:?}"
        );
    }
    let others = numbers(&fleet);
    assert_eq!(others.len(), 1 + 9 * 4);
    // A piece that comes later changes nothing for the others.
    std::fs::write(&late, bytes).unwrap();
    for (command, count) in [("check", 3), ("run", 1)] {
        let result = fleet.freeplay(&[command]);
        assert_eq!((result.code, faults(&result.err)), (Some(1), count), "{command}: {result:?}");
    }
    assert_eq!(numbers(&fleet), others);
    fleet.configure("[logs]", "[logs]\npieces = true");
    fleet.run_ok(&["check"]);
    fleet.run_ok(&["run"]);
    assert_eq!(numbers(&fleet), plain());
}

/// A piece whose flight was stored alone keeps its records; declared as flights of their own, all are stored.
#[test]
fn a_second_piece_is_named_and_the_first_stays() {
    let fleet = one_tail();
    thirds(&fleet);
    let folder = fleet.path("sample-data/logs/N412FP");
    let hidden: Vec<(PathBuf, Vec<u8>)> = ["a.parquet", "b.parquet"]
        .map(|name| (folder.join(name), std::fs::read(folder.join(name)).unwrap()))
        .into();
    hidden.iter().for_each(|(path, _)| std::fs::remove_file(path).unwrap());
    fleet.run_ok(&["run"]);
    assert_eq!(numbers(&fleet).len(), 1 + 10 * 4);
    hidden.iter().for_each(|(path, bytes)| std::fs::write(path, bytes).unwrap());
    assert_eq!(fleet.freeplay(&["run"]).code, Some(1));
    assert_eq!(numbers(&fleet).len(), 1 + 10 * 4);
    fleet.configure("[logs]", "[logs]\npieces = false");
    fleet.run_ok(&["check"]);
    fleet.run_ok(&["run"]);
    assert_eq!(numbers(&fleet).len(), 1 + 12 * 4);
}

/// Pieces that are not declared are two logs of one flight, also where one recorder numbers flights otherwise: `check`
/// reports what `run` does, and both name the setting.
#[test]
fn check_finds_a_flight_in_two_logs_as_run_does() {
    for flight_id in ["N412FP-0001", "N412FP-0001X"] {
        let fleet = one_tail();
        let log = &logs(&fleet)[0];
        let folder = fleet.path("pieces");
        let other = facts_with(log, "flight_id", flight_id);
        rewrite(log, &folder.join("a.parquet"), &facts(log), |_| true, |row| row < 4321);
        rewrite(log, &folder.join("b.parquet"), &other, |_| true, |row| row >= 4321);
        fleet.configure("sample-data/logs/N412FP/*.parquet", "pieces/*.parquet");
        for command in ["check", "run"] {
            let result = fleet.freeplay(&[command]);
            assert_eq!(result.code, Some(1), "{result:?}");
            assert_eq!(result.err.matches("error[duplicate_flight]").count(), 1, "{}", result.err);
            assert!(result.err.contains("logs.pieces = true"), "{}", result.err);
        }
    }
}
