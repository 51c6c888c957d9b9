//! Mistakes of users: what the command ends with, and what its message names.
//!
//! `tests/data/errors.txt` shows the messages whole; this table holds what each must name, whatever its wording: what
//! was found, where, and what to do. Nothing is stored by any of them.

use std::fs;

use crate::harness::{TestFleet, copy};

const LOG: &str = "sample-data/logs/N412FP/20260910T130719Z_N412FP-0001.parquet";
const TABLE: &str = "sample-data/installations.csv";

/// What a user did before the command.
enum Before {
    /// Nothing.
    Nothing,
    /// Replaced text in a file.
    Edit(&'static str, &'static str, &'static str),
    /// Wrote a file.
    Write(&'static str, &'static [u8]),
    /// Removed a file or a folder.
    Remove(&'static str),
    /// Replaced a file by a folder.
    Folder(&'static str),
    /// Cut a file to this number of bytes.
    Cut(&'static str, usize),
}
use Before::{Cut, Edit, Folder, Nothing, Remove, Write};

/// What was done, what is typed, the exit code, and what stderr names.
type Mistake = (Before, &'static [&'static str], i32, &'static [&'static str]);

/// Arguments.
const TYPED: &[Mistake] = &[
    (Nothing, &["querry"], 2, &["querry", "'query'"]),
    (Nothing, &["store", "inf"], 2, &["inf", "'info'"]),
    (Nothing, &["run", "--tale", "N412FP"], 2, &["--tale", "--tail"]),
    (Nothing, &["query"], 2, &["<BY>"]),
    (Nothing, &["diff", "results"], 2, &["<AFTER>"]),
    (Nothing, &["query", "tial", "N412FP"], 2, &["tial", "'tail'", "serial, flight, position"]),
    (Nothing, &["query", "tail", "N412FP", "--last", "0"], 2, &["--last", "`0`", "at least 1"]),
    (Nothing, &["query", "tail", "N412FP", "--last", "-1"], 2, &["--last", "`-1`", "at least 1"]),
    (Nothing, &["run", "--limit", "-5"], 2, &["--limit", "`-5`", "at least 1"]),
    (Nothing, &["run", "--jobs", "0"], 2, &["--jobs", "`0`", "from 1 to 65535"]),
    (Nothing, &["run", "--jobs", "99999"], 2, &["--jobs", "`99999`", "from 1 to 65535"]),
    (Nothing, &["run", "--since", "yesterday"], 2, &["--since", "`yesterday`", "2026-11-19"]),
    (Nothing, &["trend", "--as-of", "19.11.2026"], 2, &["--as-of", "`19.11.2026`", "2026-11-19"]),
    (Nothing, &["run", "--since", "2026-02-30"], 2, &["--since", "no day `2026-02-30`"]),
    (
        Nothing,
        &["query", "tail", "N412FP", "--since", "2026-11-01", "--until", "2026-10-01"],
        2,
        &["2026-11-01", "2026-10-01", "set `--until` later"],
    ),
    (Nothing, &["store", "export", "--format", "xlsx"], 2, &["xlsx", "table, json, jsonl, csv, parquet"]),
    (Nothing, &["trend", "--json", "--format", "csv"], 2, &["--json", "--format"]),
    (Nothing, &["trend", "--limit-m", "150"], 2, &["--limit-m", "150 m", "150e-6"]),
    (Nothing, &["store", "info", "--max-age", "30"], 2, &["--max-age", "`30`", "30h"]),
    (Nothing, &["completions", "cmd"], 2, &["cmd", "bash"]),
    (Nothing, &["work", "close", "W1", "--by", "me"], 2, &["--reason"]),
    (
        Nothing,
        &["work", "defer", "W1", "--until", "2020-01-01", "--reason", "x", "--by", "me"],
        2,
        &["--until", "has passed", "2031-01-31"],
    ),
];

/// Names that nothing has, and commands before their time.
const NAMES: &[Mistake] = &[
    (Nothing, &["query", "tail", "N412F"], 2, &["tail `N412F`", "`N412FP`"]),
    (Nothing, &["query", "tail", "n412fp"], 2, &["tail `n412fp`", "`N412FP`"]),
    (Nothing, &["query", "flight", "N412FP-9999"], 2, &["flight `N412FP-9999`", "nearest known flight"]),
    (Nothing, &["query", "position", "aileron_lft"], 2, &["position `aileron_lft`", "`aileron_left`"]),
    (Nothing, &["query", "serial", "1040-005"], 2, &["serial number `1040-005`", "`1040-0005`"]),
    (Nothing, &["trend", "--part", "EMA-27-104"], 2, &["part number `EMA-27-104`", "`EMA-27-1040`"]),
    (Nothing, &["run", "--tail", "N412F"], 2, &["tail `N412F`", "`N412FP`", "no changes were made"]),
    (Nothing, &["explain", "N412FP-9999", "aileron_left"], 2, &["flight `N412FP-9999`", "nearest known"]),
    (Nothing, &["explain", "N412FP-0007", "aileron_lft"], 2, &["position `aileron_lft`", "`aileron_left`"]),
    (
        Nothing,
        &["explain", "N412FP-0007", "aileron_left", "--tail", "N413FP"],
        2,
        &["aileron_left", "N412FP-0007 of tail N413FP", "freeplay query flight"],
    ),
    (Nothing, &["work", "close", "W99", "--reason", "x", "--by", "me"], 2, &["`W99`", "work list"]),
    (Nothing, &["store", "runs", "--run", "99"], 2, &["`99`", "freeplay store runs"]),
    (Nothing, &["estimate", LOG, "--part", "EMA-27-104"], 2, &["EMA-27-104", "EMA-27-1040, EMA-27-1060"]),
    (Remove("results"), &["report", "--output", "report"], 3, &["results", "freeplay run", "[store]"]),
    (Remove("results"), &["trend"], 3, &["results", "freeplay run", "[store]"]),
];

/// Outputs that cannot be written, and files that are not what they should be.
const FILES: &[Mistake] = &[
    (
        Edit("pipeline.toml", "limit_m = 150e-6", "limit_m = 150e-9"),
        &["trend"],
        2,
        &["pipeline.toml:", "limit_m", "1.5e-7", "150 µm is 150e-6"],
    ),
    (
        Edit("pipeline.toml", "limit_m = 150e-6", ""),
        &["check"],
        2,
        &["pipeline.toml:", "`watch_m` has no effect without a `limit_m`", "[trend] limit_m"],
    ),
    (
        Edit(
            "pipeline.toml",
            "[estimate]",
            "[[override]]\nparts = [\"EMA-27-1004\"]\nchannel.load.sign = 1\n\n[estimate]",
        ),
        &["run"],
        2,
        &["pipeline.toml:", "`EMA-27-1004`, which is not configured", "nearest: `EMA-27-1040`"],
    ),
    (
        Write("pipeline.toml", b"[\0l\0o\0g\0s\0]\0"),
        &["run"],
        2,
        &["pipeline.toml", "UTF-16", "save the file as UTF-8"],
    ),
    (
        Nothing,
        &["trend", "--json", "--output", "pipeline.toml"],
        2,
        &["pipeline.toml is an input", "not changed", "another output file"],
    ),
    (
        Nothing,
        &["trend", "--format", "csv", "--output", "sample-data"],
        3,
        &["sample-data", "folder, not a file", "name a file"],
    ),
    (Nothing, &["trend", "--output", "none/a.csv"], 3, &["none/a.csv", "create the folder first"]),
    (Nothing, &["report", "--output", "pipeline.toml"], 2, &["pipeline.toml is a file", "empty folder"]),
    (Nothing, &["normalize", "--output", "pipeline.toml"], 2, &["pipeline.toml is a file", "empty folder"]),
    (Nothing, &["simulate", "--output", "pipeline.toml"], 2, &["pipeline.toml is a file", "empty folder"]),
    (Nothing, &["init", "pipeline.toml"], 2, &["pipeline.toml is a file", "empty folder"]),
    (Nothing, &["init", "."], 2, &["pipeline.toml already exists", "another folder"]),
    (Nothing, &["run", "--metrics", "none/a.prom"], 3, &["none/a.prom", "create the folder first"]),
    (Nothing, &["run", "--metrics", "sample-data"], 3, &["sample-data", "folder, not a file"]),
    (Nothing, &["estimate", LOG, "--plot", "a.png"], 2, &["a.png", ".svg"]),
    (Nothing, &["check", "sample-data"], 1, &["sample-data", "folder, not a file", "*.parquet"]),
    (Nothing, &["check", "none.parquet"], 1, &["none.parquet", "no such file"]),
    (Nothing, &["check", TABLE], 1, &[TABLE, "CSV", "Parquet"]),
    (Write("a.parquet", b""), &["check", "a.parquet"], 1, &["a.parquet", "no rows"]),
    (Cut(LOG, 3000), &["check", LOG], 1, &[LOG, "truncated", "copy the file again"]),
    (Write("results/store.json", b"{\"freeplay_store\":9}"), &["trend"], 3, &["store.json", "format 9"]),
    (Nothing, &["check", "--config", "fleet.toml"], 2, &["fleet.toml", "no such file", "freeplay init"]),
    (Folder("pipeline.toml"), &["check"], 2, &["pipeline.toml", "folder, not a file"]),
    (Write("pipeline.toml", b""), &["check"], 2, &["pipeline.toml:1:1", "[logs]", "freeplay init"]),
    (Write("pipeline.toml", b"\xff\xfe["), &["check"], 2, &["pipeline.toml", "UTF-8"]),
    (Nothing, &["simulate", "pipeline.toml", "--output", "s"], 2, &["pipeline.toml", "`channel`", "`seed`"]),
];

/// Configuration and installations.
const SETTINGS: &[Mistake] = &[
    (
        Edit("pipeline.toml", "unit = \"s\"", "unit = \"s\"\nunit = \"ms\""),
        &["run"],
        2,
        &["pipeline.toml:16", "duplicate", "remove"],
    ),
    (
        Edit("pipeline.toml", "bandwidth_hz", "bandwith_hz"),
        &["run"],
        2,
        &["pipeline.toml:", "`bandwidth_hz`"],
    ),
    (Edit("pipeline.toml", "[trend]", "[trends]"), &["run"], 2, &["pipeline.toml:", "`trends`", "`trend`"]),
    (Edit("pipeline.toml", "= 8.0", "= \"8 kg\""), &["run"], 2, &["pipeline.toml:", "8 kg", "plain number"]),
    (Edit("pipeline.toml", "\"deg\"", "\"degre\""), &["run"], 2, &["pipeline.toml:", "`degre`", "`deg`"]),
    (
        Edit("pipeline.toml", "5.0e7", "-5.0e7"),
        &["run"],
        2,
        &["pipeline.toml:", "stiffness_n_per_m", "-50000000"],
    ),
    (
        Edit("pipeline.toml", "stiffness_n_per_m = 5.0e7\n", ""),
        &["run"],
        2,
        &["pipeline.toml:", "`stiffness_n_per_m`", "add a line"],
    ),
    (
        Edit("pipeline.toml", "watch_m = 110e-6", "watch_m = 210e-6"),
        &["run"],
        2,
        &["pipeline.toml:", "0.00021", "0.00015", "below `limit_m`"],
    ),
    (
        Edit("pipeline.toml", "data/logs/**/*.parquet", "data/log/*.parquet"),
        &["run"],
        2,
        &["pipeline.toml:4", "data/log/*.parquet", "relative to"],
    ),
    (
        Edit("pipeline.toml", "sample-data/logs/**/*.parquet", "sample-data/*.csv"),
        &["run"],
        2,
        &["pipeline.toml:4", "no Parquet file", "installations.csv", "`.parquet`"],
    ),
    (
        Edit("pipeline.toml", "installations.csv", "installs.csv"),
        &["run"],
        2,
        &["installs.csv", "no such file"],
    ),
    (Edit(TABLE, "serial_number,", "sn,"), &["run"], 2, &[TABLE, "`serial_number`", "[columns]"]),
    (Edit(TABLE, "2026-09-07T00:00:00Z", "7.9.2026"), &["run"], 2, &[TABLE, "`7.9.2026`", "2026-11-19"]),
    (Edit(TABLE, "1168.5", "\"1168,5\""), &["run"], 2, &[TABLE, "`1168,5`", "with a point"]),
    (
        Edit(TABLE, "1060-0008,2026-09-07T00:00:00Z,2026-10-12", "1060-0008,2026-09-07T00:00:00Z,2026-10-13"),
        &["run"],
        2,
        &[TABLE, "rows 4 and 5", "removed_utc"],
    ),
    (
        Edit(TABLE, "EMA-27-1040,1040-0005", "EMA-27-1041,1040-0005"),
        &["check", LOG],
        1,
        &["EMA-27-1041", "[part."],
    ),
];

fn prepare(fleet: &TestFleet, before: &Before) {
    match *before {
        Nothing => {}
        Edit(file, from, to) => {
            let text = fs::read_to_string(fleet.path(file)).unwrap();
            assert!(text.contains(from), "{from} is not in {file}");
            fs::write(fleet.path(file), text.replacen(from, to, 1)).unwrap();
        }
        Write(file, bytes) => fs::write(fleet.path(file), bytes).unwrap(),
        Remove(path) => fs::remove_dir_all(fleet.path(path)).unwrap(),
        Folder(file) => {
            fs::remove_file(fleet.path(file)).unwrap();
            fs::create_dir(fleet.path(file)).unwrap();
        }
        Cut(file, bytes) => {
            let whole = fs::read(fleet.path(file)).unwrap();
            fs::write(fleet.path(file), &whole[..bytes]).unwrap();
        }
    }
}

/// Provokes each mistake in a copy of a fleet with results; all wrong messages are listed at once.
fn provoke(mistakes: &[Mistake]) {
    let sound = TestFleet::sample();
    sound.run_ok(&["run", "--tail", "N412FP", "--limit", "1"]);
    let mut wrong = Vec::new();
    for (before, args, code, names) in mistakes {
        let fleet = TestFleet::empty();
        copy(&sound.path(""), &fleet.path(""));
        prepare(&fleet, before);
        let result = fleet.command(args).env("COLUMNS", "120").output().unwrap();
        let text = String::from_utf8(result.stderr).unwrap();
        let missing: Vec<_> = names.iter().filter(|name| !text.contains(**name)).collect();
        if result.status.code() != Some(*code) || !missing.is_empty() || !text.contains("error") {
            wrong.push(format!("{args:?}: exit {:?}, without {missing:?}:\n{text}", result.status.code()));
        }
        assert!(!text.contains("panicked") && !text.contains("os error 21"), "{args:?}: {text}");
    }
    assert!(wrong.is_empty(), "{} of {}:\n{}", wrong.len(), mistakes.len(), wrong.join("\n"));
}

#[test]
fn wrong_arguments_name_what_was_typed_and_what_is_possible() {
    provoke(TYPED);
}

#[test]
fn unknown_names_bring_the_nearest_known_one() {
    provoke(NAMES);
}

#[test]
fn files_that_are_not_what_they_should_be_are_named_with_the_remedy() {
    provoke(FILES);
}

#[test]
fn mistakes_in_settings_name_file_and_line_or_column() {
    provoke(SETTINGS);
}

/// Semicolons come from spreadsheets of half of Europe: one remedy covers them.
#[test]
fn a_table_with_semicolons_is_recognized() {
    let fleet = TestFleet::sample();
    let text = fs::read_to_string(fleet.path(TABLE)).unwrap();
    fs::write(fleet.path(TABLE), text.replace(',', ";")).unwrap();
    let result = fleet.freeplay(&["run"]);
    assert_eq!(result.code, Some(2), "{result:?}");
    assert!(result.err.contains("separated by `;`"), "{}", result.err);
    // A byte order mark, however, is no mistake.
    fs::write(fleet.path(TABLE), format!("\u{feff}{text}")).unwrap();
    fleet.run_ok(&["run", "--dry-run"]);
}
