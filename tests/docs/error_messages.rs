//! All error messages of the program as a user reads them: `tests/data/errors.txt`.
//!
//! `FREEPLAY_BLESS=1 cargo test -p cli error_messages` rewrites that file; read the difference before you commit it.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use regex::Regex;

use crate::harness::{TestFleet, copy, top};

const LOG: &str = "sample-data/logs/N412FP/20260910T130719Z_N412FP-0001.parquet";
const TABLE: &str = "sample-data/installations.csv";

/// Something wrong with one file: what it is called, the file, what is replaced by what, and what is typed.
type Slip = (&'static str, &'static str, &'static str, &'static str, &'static [&'static str]);

const CONFIGURATION: &[Slip] = &[
    ("no TOML", "pipeline.toml", "[logs]", "[logs", &["check"]),
    ("a key twice", "pipeline.toml", "unit = \"s\"", "unit = \"s\"\nunit = \"ms\"", &["check"]),
    ("unknown key", "pipeline.toml", "bandwidth_hz", "bandwith_hz", &["check"]),
    ("unknown table", "pipeline.toml", "[trend]", "[trends]", &["check"]),
    ("unknown channel", "pipeline.toml", "[channel.motor_position]", "[channel.motor_postion]", &["check"]),
    ("text for a number", "pipeline.toml", "= 8.0", "= \"8 kg\"", &["check"]),
    ("number for text", "pipeline.toml", "\"results\"", "7", &["check"]),
    ("missing key", "pipeline.toml", "stiffness_n_per_m = 5.0e7\n", "", &["check"]),
    (
        "missing key of logs",
        "pipeline.toml",
        "installations = \"sample-data/installations.csv\"\n",
        "",
        &["check"],
    ),
    ("bad unit", "pipeline.toml", "unit = \"deg\"", "unit = \"degre\"", &["check"]),
    ("bad unit of time", "pipeline.toml", "unit = \"s\"", "unit = \"mins\"", &["check"]),
    ("a force for a position", "pipeline.toml", "unit = \"mm\"", "unit = \"N\"", &["check"]),
    ("negative stiffness", "pipeline.toml", "5.0e7", "-5.0e7", &["check"]),
    ("a watch level over the limit", "pipeline.toml", "watch_m = 110e-6", "watch_m = 210e-6", &["check"]),
    (
        "no logs named",
        "pipeline.toml",
        "files = [\"sample-data/logs/**/*.parquet\"]",
        "files = []",
        &["check"],
    ),
    ("bad pattern", "pipeline.toml", "logs/**/*", "logs/***/*", &["run"]),
    ("a pattern that fits nothing", "pipeline.toml", "data/logs/**", "data/log/**", &["run"]),
    ("bad method", "pipeline.toml", "\"contact\"", "\"contakt\"", &["check"]),
    ("bad expression", "pipeline.toml", "[identity]", "[identity]\npath = '(?<tail_number>N'", &["check"]),
    ("bad zone", "pipeline.toml", "[identity]", "[identity]\ntime_zone = \"Europe/Istambul\"", &["check"]),
    (
        "unknown fact",
        "pipeline.toml",
        "{ tail_number =",
        "{ tail_nr = \"tail_number\", tail_number =",
        &["check"],
    ),
    ("a store without a folder", "pipeline.toml", "path = \"results\"", "path = \"\"", &["run"]),
    ("text without quotes", "pipeline.toml", "\"contact\"", "contact", &["check"]),
    (
        "a folder for a table",
        "pipeline.toml",
        "\"sample-data/installations.csv\"",
        "\"sample-data\"",
        &["check", LOG],
    ),
    ("no installations", "pipeline.toml", "installations.csv", "installs.csv", &["check", LOG]),
];

const LOGS_AND_TABLES: &[Slip] = &[
    ("time column missing", "pipeline.toml", "\"time_s\"", "\"time\"", &["check", LOG]),
    ("channel missing", "pipeline.toml", "_load_n", "_force_n", &["check", LOG]),
    ("no such position", "pipeline.toml", "{position}_motor_deg", "{position}_motor_rad", &["check", LOG]),
    (
        "no tail in the log",
        "pipeline.toml",
        "tail_number = \"tail_number\"",
        "tail_number = \"ac_reg\"",
        &["check", LOG],
    ),
    (
        "a departure in another form",
        "pipeline.toml",
        "departure_utc = \"departure_utc\"",
        "departure_utc = \"flight_id\"",
        &["check", LOG],
    ),
    (
        "a departure that does not fit its form",
        "pipeline.toml",
        "[identity]",
        "[identity]\ndeparture_format = \"%d.%m.%Y\"",
        &["check", LOG],
    ),
    ("another word for the place", "pipeline.toml", "{position}_load_n", "{pos}_load_n", &["check", LOG]),
    ("part unknown", TABLE, "EMA-27-1040,1040-0005", "EMA-27-1041,1040-0005", &["check", LOG]),
    (
        "overlapping installations",
        TABLE,
        "1060-0008,2026-09-07T00:00:00Z,2026-10-12",
        "1060-0008,2026-09-07T00:00:00Z,2026-10-13",
        &["check"],
    ),
    ("a date that is none", TABLE, "2026-09-07T00:00:00Z", "7.9.2026", &["check"]),
    (
        "a stay that ends before it begins",
        TABLE,
        "1060-0008,2026-09-07T00:00:00Z,2026-10-12",
        "1060-0008,2026-09-07T00:00:00Z,2026-08-12",
        &["check"],
    ),
    ("a column of the table missing", TABLE, "serial_number,", "sn,", &["check"]),
    ("hours that are none", TABLE, "1168.5", "a lot", &["check"]),
    ("a table without rows", TABLE, "tail_number,position", "Tail,position", &["check"]),
];

const ARGUMENTS: &[(&str, &[&str])] = &[
    ("unknown command", &["querry"]),
    ("unknown option", &["run", "--tale", "N412FP"]),
    ("bad date", &["run", "--since", "yesterday"]),
    ("a day that is none", &["run", "--since", "2026-02-30"]),
    ("bad number", &["query", "serial", "1040-0005", "--last", "few"]),
    ("no workers", &["run", "--jobs", "0"]),
    ("bad kind of query", &["query", "tial", "N412FP"]),
    ("bad form of rows", &["store", "export", "--format", "xlsx"]),
    ("no configuration", &["check", "--config", "fleet.toml"]),
    ("no store", &["query", "tail", "N412FP"]),
    ("no store to compare", &["diff", "results", "results-trial"]),
    ("no log of that name", &["check", "sample-data/logs/N412FP/1.parquet"]),
    ("a truncated log", &["check", "cut.parquet"]),
    ("a folder for a log", &["check", "sample-data/logs"]),
    ("a folder for the configuration", &["check", "--config", "sample-data"]),
    ("an empty log", &["check", "empty.parquet"]),
    ("a log that is no Parquet file", &["estimate", "text.parquet"]),
    ("init over something", &["init", "."]),
    ("init from nowhere", &["init", "new-fleet", "--from", "nowhere"]),
    ("estimates that are not there", &["trend", "--estimates", "history.csv"]),
    ("estimates without columns", &["trend", "--estimates", "sample-data/installations.csv"]),
    ("a store that is a file", &["store", "info", "--config", "file-store.toml"]),
];

/// The typed command, its exit code and its output, without the path of the temporary folder.
fn record_output(fleet: &TestFleet, name: &str, args: &[&str], text: &mut String) {
    let result = fleet.command(args).env("COLUMNS", "100").output().unwrap();
    let folder = fs::canonicalize(fleet.path("")).unwrap();
    let words = String::from_utf8(result.stderr).unwrap().replace(&*folder.to_string_lossy(), "FLEET");
    let code = result.status.code().unwrap();
    assert!(code != 0 && words.contains("error"), "{name}: exit {code}, {words}");
    writeln!(text, "## {name}\n$ freeplay {}\n{}\nexit {code}\n", args.join(" "), words.trim_end()).unwrap();
}

fn slips(fleet: &TestFleet, slips: &[Slip], text: &mut String) {
    for (name, file, from, to, args) in slips {
        let path = fleet.path(file);
        let sound = fs::read_to_string(&path).unwrap();
        assert!(sound.contains(from), "{name}: {from} is not in {file}");
        fs::write(&path, sound.replacen(from, to, 1)).unwrap();
        record_output(fleet, name, args, text);
        fs::write(&path, sound).unwrap();
    }
}

fn spoilt(fleet: &TestFleet) {
    let log = fs::read(fleet.path(LOG)).unwrap();
    fs::write(fleet.path("cut.parquet"), &log[..3000]).unwrap();
    fs::write(fleet.path("empty.parquet"), b"").unwrap();
    fs::write(fleet.path("text.parquet"), b"tail,flight\nN412FP,1\n").unwrap();
    let toml = fs::read_to_string(fleet.path("pipeline.toml")).unwrap();
    fs::write(fleet.path("file-store.toml"), toml.replace("\"results\"", "\"pipeline.toml\"")).unwrap();
}

/// Something wrong with a store that was sound: what it is called, what is done to it, and what is typed.
type Spoil = (&'static str, fn(&TestFleet), &'static [&'static str]);

const STORES: &[Spoil] = &[
    ("a store held by another process", |_| {}, &["run"]),
    (
        "a store of a newer release",
        |fleet| fs::write(fleet.path("results/store.json"), "{\"freeplay_store\":9}").unwrap(),
        &["query", "tail", "N412FP"],
    ),
    (
        "a store whose format marker is truncated",
        |fleet| fs::write(fleet.path("results/store.json"), "{\"freepl").unwrap(),
        &["store", "info"],
    ),
    (
        "a folder that is no store",
        |fleet| {
            fs::remove_dir_all(fleet.path("results")).unwrap();
            fs::create_dir(fleet.path("results")).unwrap();
            fs::write(fleet.path("results/notes.txt"), "not a store").unwrap();
        },
        &["store", "info"],
    ),
    (
        "a table whose commit file is truncated",
        |fleet| tear(&newest(fleet, "results/gaps/_delta_log/*.json")),
        &["query", "tail", "N412FP"],
    ),
    (
        "a data file with a flipped byte",
        |fleet| flip(&newest(fleet, "results/gaps/*.parquet")),
        &["query", "tail", "N412FP"],
    ),
    (
        "a data file that was deleted",
        |fleet| fs::remove_file(newest(fleet, "results/gaps/*.parquet")).unwrap(),
        &["query", "tail", "N412FP"],
    ),
    (
        "a store that looks damaged",
        |fleet| fs::remove_file(newest(fleet, "results/gaps/*.parquet")).unwrap(),
        &["store", "verify"],
    ),
    ("an answer into a folder that is not there", |_| {}, &["store", "export", "--output", "none/gaps.csv"]),
    ("a flight that is not stored", |_| {}, &["explain", "N412FP-9999", "aileron_left"]),
    ("a position that is not stored", |_| {}, &["explain", "N412FP-0007", "aileron_lft"]),
    ("a report of nothing", |_| {}, &["report", "--output", "report", "--tail", "N000FP"]),
    ("a report over something else", |_| {}, &["report", "--output", "sample-data"]),
];

/// The newest file that fits a pattern.
fn newest(fleet: &TestFleet, pattern: &str) -> PathBuf {
    glob::glob(fleet.path(pattern).to_str().unwrap()).unwrap().flatten().max().unwrap()
}

fn tear(file: &Path) {
    let whole = fs::read(file).unwrap();
    fs::write(file, &whole[..whole.len() / 2]).unwrap();
}

fn flip(file: &Path) {
    let mut whole = fs::read(file).unwrap();
    let middle = whole.len() / 2;
    whole[middle] ^= 1;
    fs::write(file, whole).unwrap();
}

/// Messages about damaged stores, without parts that differ from run to run (holder, digests).
fn stores(text: &mut String) {
    let fleet = TestFleet::sample();
    fleet.run_ok(&["run", "--tail", "N412FP", "--limit", "2"]);
    let sound = tempfile::tempdir().unwrap();
    copy(&fleet.path("results"), sound.path());
    let lock = fs::File::options().write(true).open(fleet.path("results/lock")).unwrap();
    lock.lock().unwrap();
    let mut store_output = String::new();
    for (name, spoil, args) in STORES {
        spoil(&fleet);
        record_output(&fleet, name, args, &mut store_output);
        fs::remove_dir_all(fleet.path("results")).unwrap();
        copy(sound.path(), &fleet.path("results"));
    }
    for (differs, word) in [
        (r"pid \d+ on \S+ since [^\n]+ UTC", "pid 8812 on HOST since THEN"),
        (r"\d{12}-[0-9a-f]{64}", "DATA-FILE"),
        (r"[0-9a-f]{12}…", "DIGEST…"),
        (r" at line \d+ column \d+", ""),
        // How many commits a run makes depends on how long it takes.
        (r"0{10}\d{10}\.json", "COMMIT.json"),
    ] {
        store_output = Regex::new(differs).unwrap().replace_all(&store_output, word).into_owned();
    }
    text.push_str(&store_output);
}

#[test]
fn errors_read_as_they_were_last_read_by_a_person() {
    let fleet = TestFleet::sample();
    spoilt(&fleet);
    let mut text = String::new();
    slips(&fleet, CONFIGURATION, &mut text);
    slips(&fleet, LOGS_AND_TABLES, &mut text);
    for (name, args) in ARGUMENTS {
        record_output(&fleet, name, args, &mut text);
    }
    assert!(!fleet.path("results").exists(), "an error stores nothing");
    stores(&mut text);
    let kept = top().join("tests/data/errors.txt");
    if std::env::var_os("FREEPLAY_BLESS").is_some() {
        fs::write(&kept, &text).unwrap();
    }
    let kept = fs::read_to_string(kept).unwrap();
    let codes = Regex::new(r"error\[(\w+)\]").unwrap();
    let page = fs::read_to_string(top().join("docs/errors.md")).unwrap();
    for code in codes.captures_iter(&text).map(|found| format!("`{}`", &found[1])) {
        assert!(page.contains(&code), "{code} is not explained in docs/errors.md");
    }
    for (now, before) in text.split("## ").zip(kept.split("## ")) {
        assert_eq!(now, before);
    }
    assert_eq!(text.len(), kept.len(), "an error was added or left out");
}
