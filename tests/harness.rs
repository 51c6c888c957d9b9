//! What every test here needs: a folder of its own, a configuration in it, and the binary.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

use regex::Regex;
use serde::Deserialize;
use serde_json::Value;

use crate::gate::is_gate;
pub(crate) use crate::table::Table;

/// Prints a measurement past the test runner, which captures what tests print.
pub(crate) fn print_line(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// All cases in the gate, else `count` of them, spread evenly with the first.
pub(crate) fn spread<T: Copy>(cases: &[T], count: usize) -> Vec<T> {
    let step = if is_gate() { 1 } else { cases.len().div_ceil(count) };
    cases.iter().copied().step_by(step).collect()
}

/// Tries each case, on as many threads as there are processors.
pub(crate) fn each<T: Sync>(cases: &[T], try_one: impl Fn(&T) + Sync) {
    let next = AtomicUsize::new(0);
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, std::num::NonZero::get) {
            scope.spawn(|| {
                while let Some(case) = cases.get(next.fetch_add(1, Ordering::Relaxed)) {
                    try_one(case);
                }
            });
        }
    });
}

/// Waits until a condition holds; it is tested every millisecond.
pub(crate) fn wait_until(mut condition: impl FnMut() -> bool) {
    while !condition() {
        std::thread::park_timeout(std::time::Duration::from_millis(1));
    }
}

pub(crate) fn top() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..")
}

pub(crate) struct TestFleet {
    folder: tempfile::TempDir,
}

/// How a command ended, and what it printed.
#[derive(Debug)]
pub(crate) struct CommandResult {
    pub(crate) code: Option<i32>,
    pub(crate) out: String,
    pub(crate) err: String,
}

impl CommandResult {
    pub(crate) fn of(command: &mut std::process::Command) -> Self {
        let output = command.output().unwrap();
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        Self { code: output.status.code(), out: text(output.stdout), err: text(output.stderr) }
    }
}

impl TestFleet {
    /// A copy of the tests' small fleet: three aircraft with ten flights each, all with a log.
    pub(crate) fn sample() -> Self {
        Self::of("three-aircraft")
    }

    /// A copy of a fleet that is made once for all tests.
    pub(crate) fn once(made: &OnceLock<Self>, make: fn() -> Self) -> Self {
        let keep = || {
            let fleet = Self { folder: tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).unwrap() };
            copy(make().folder.path(), fleet.folder.path());
            fleet
        };
        made.get_or_init(keep).copied()
    }

    /// A copy of the sample fleet, `sample-data/`.
    pub(crate) fn sample_data() -> Self {
        let fleet = Self { folder: tempfile::tempdir().unwrap() };
        copy(&top().join("sample-data"), &fleet.path("sample-data"));
        std::fs::copy(top().join("pipeline.toml"), fleet.path("pipeline.toml")).unwrap();
        fleet
    }

    /// A copy of a folder of `tests/data`.
    pub(crate) fn of(data: &str) -> Self {
        let fleet = Self { folder: tempfile::tempdir().unwrap() };
        copy(&top().join("tests/data").join(data), fleet.folder.path());
        fleet
    }

    pub(crate) fn empty() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    /// A copy of this fleet in a folder of its own, file times included.
    pub(crate) fn copied(&self) -> Self {
        let fleet = Self::empty();
        copy(self.folder.path(), fleet.folder.path());
        fleet
    }

    pub(crate) fn path(&self, relative: &str) -> PathBuf {
        self.folder.path().join(relative)
    }

    /// The command, in this folder, as a scheduler would start it.
    pub(crate) fn command(&self, args: &[&str]) -> std::process::Command {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_freeplay"));
        command.args(args).current_dir(self.folder.path());
        command.env_remove("FREEPLAY_CONFIG").env_remove("NO_COLOR").stdin(std::process::Stdio::null());
        command
    }

    pub(crate) fn freeplay(&self, args: &[&str]) -> CommandResult {
        CommandResult::of(&mut self.command(args))
    }

    pub(crate) fn run_ok(&self, args: &[&str]) -> String {
        let result = self.freeplay(args);
        assert_eq!(result.code, Some(0), "{args:?}: {result:?}");
        result.out
    }

    /// Output of a command with `--json` that must end well.
    pub(crate) fn json(&self, args: &[&str]) -> Value {
        serde_json::from_str(&self.run_ok(&[args, &["--json"]].concat())).unwrap()
    }

    /// The same, for a command that prints rows.
    pub(crate) fn rows(&self, args: &[&str]) -> Vec<Value> {
        serde_json::from_value(self.json(args)).unwrap()
    }

    pub(crate) fn read(&self, file: &str) -> String {
        std::fs::read_to_string(self.path(file)).unwrap()
    }

    pub(crate) fn read_json(&self, file: &str) -> Value {
        serde_json::from_str(&self.read(file)).unwrap()
    }

    pub(crate) fn edit(&self, file: &str, change: impl FnOnce(&str) -> String) {
        let text = self.read(file);
        let changed = change(&text);
        assert_ne!(changed, text, "{file} was not changed");
        std::fs::write(self.path(file), changed).unwrap();
    }

    /// Every stored record as CSV, without what differs between two runs of the same logs.
    pub(crate) fn exported(&self) -> String {
        let all = self.run_ok(&["store", "export", "--format", "csv"]);
        without(&all, &["run_id", "processed_utc", "log_path"])
    }

    pub(crate) fn configure(&self, from: &str, to: &str) {
        assert!(self.read("pipeline.toml").contains(from), "{from} is not in the configuration");
        self.edit("pipeline.toml", |text| text.replacen(from, to, 1));
    }

    pub(crate) fn configure_also(&self, table: &str) {
        self.edit("pipeline.toml", |text| format!("{text}\n{table}"));
    }

    pub(crate) fn rewrite_logs(&self, how: &LogRewrite) {
        let pattern = |pattern: &Option<String>| pattern.as_ref().map(|pattern| Regex::new(pattern).unwrap());
        let [columns, without, blank] = [&how.columns, &how.without, &how.blank].map(pattern);
        let is = |pattern: &Option<Regex>, name: &str| pattern.as_ref().is_some_and(|p| p.is_match(name));
        let (first, end, step) = how.rows.unwrap_or((0, usize::MAX, 1));
        for log in self.glob(&how.from) {
            let mut own = if how.is_anonymous { Facts::new() } else { facts(&log) };
            own.retain(|(key, _)| !how.facts.contains_key(key));
            let name = log.file_stem().unwrap().to_str().unwrap();
            let fact = |(key, value): (&String, &Option<String>)| {
                Some((key.clone(), value.as_ref()?.replace("{log}", name)))
            };
            own.extend(how.facts.iter().filter_map(fact));
            let mut table = Table::read(&log).columns();
            table.retain(|(name, _)| (columns.is_none() || is(&columns, name)) && !is(&without, name));
            for (name, values) in &mut table {
                if is(&blank, name) {
                    values.iter_mut().skip(1).step_by(2).for_each(|value| *value = f64::NAN);
                }
                if let Some(row) = how.restart_at.filter(|_| name == "time_s") {
                    let restart = values[row] - values[0];
                    values[row..].iter_mut().for_each(|time| *time -= restart);
                }
                let of_column =
                    |(pattern, ..): &&(String, _, _, _)| Regex::new(pattern).unwrap().is_match(name);
                let holes = how.left_out.iter().filter(of_column);
                let holes: BTreeSet<usize> =
                    holes.flat_map(|(_, first, end, step)| (*first..*end).step_by(*step)).collect();
                let rows = (first..end.min(values.len())).step_by(step);
                *values = if how.is_long {
                    rows.map(|row| if holes.contains(&row) { f64::NAN } else { values[row] }).collect()
                } else {
                    rows.filter(|row| !holes.contains(row)).map(|row| values[row]).collect()
                };
                for (from, to) in &how.rename {
                    *name = Regex::new(from).unwrap().replace(name, to).into_owned();
                }
            }
            let rows = table.first().map_or(0, |(_, values)| values.len());
            table.extend(how.add.iter().map(|(name, value)| (name.clone(), vec![*value; rows])));
            let to = self.path(&how.to.replace("{log}", name));
            if how.is_long { write_long(&to, &table, &own) } else { write_log(&to, table, &own) }
        }
    }

    pub(crate) fn glob(&self, pattern: &str) -> Vec<PathBuf> {
        glob::glob(self.path(pattern).to_str().unwrap()).unwrap().flatten().collect()
    }

    pub(crate) fn logs(&self) -> Vec<PathBuf> {
        self.glob("sample-data/logs/*/*.parquet")
    }

    pub(crate) fn logs_of(&self, tail: &str) -> Vec<PathBuf> {
        self.glob(&format!("sample-data/logs/{tail}/*.parquet"))
    }
}

/// Logs that are written again as doubles, with other columns, rows or facts.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct LogRewrite {
    /// Pattern of the paths of logs.
    from: String,
    /// Path of what is written; `{log}` is the name of the log without its ending.
    to: String,
    /// Pattern of the names of columns that stay.
    columns: Option<String>,
    /// Pattern of the names of columns that go.
    without: Option<String>,
    /// Pattern of the names of columns whose every second value is missing.
    blank: Option<String>,
    /// The first row, the row after the last, and the step.
    rows: Option<(usize, usize, usize)>,
    /// Rows that are left out: pattern of the names of columns, the first row, the row after the last, and the step.
    #[serde(default)]
    left_out: Vec<(String, usize, usize, usize)>,
    /// The row at which the clock starts again.
    restart_at: Option<usize>,
    /// A row for each instant and column, whose name is in the column `parameter` and whose number is in `value`.
    #[serde(default)]
    is_long: bool,
    /// Pattern of names, and what replaces them.
    #[serde(default)]
    rename: Vec<(String, String)>,
    /// Further columns of one value.
    #[serde(default)]
    add: BTreeMap<String, f64>,
    /// Without the facts of the log.
    #[serde(default)]
    is_anonymous: bool,
    /// Facts that replace those of the log, in which `{log}` is its name, too; null removes one.
    #[serde(default)]
    facts: BTreeMap<String, Option<String>>,
}

/// Rows of comma-separated values without some of their columns.
pub(crate) fn without(rows: &str, columns: &[&str]) -> String {
    let header: Vec<&str> = rows.lines().next().unwrap_or_default().split(',').collect();
    let kept = |line: &str| {
        let cells = header.iter().zip(line.split(',')).filter(|(name, _)| !columns.contains(name));
        cells.map(|(_, cell)| cell).collect::<Vec<_>>().join(",")
    };
    rows.lines().map(kept).collect::<Vec<_>>().join("\n")
}

pub(crate) fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap().flatten() {
        let (path, target) = (entry.path(), to.join(entry.file_name()));
        if path.is_dir() {
            copy(&path, &target);
        } else {
            std::fs::copy(&path, &target).unwrap();
            let modified = entry.metadata().unwrap().modified().unwrap();
            let times = std::fs::FileTimes::new().set_modified(modified);
            std::fs::File::options().append(true).open(&target).unwrap().set_times(times).unwrap();
        }
    }
}

pub(crate) type Facts = Vec<(String, String)>;

/// The identity of a log from the metadata of its footer.
pub(crate) fn facts(log: &Path) -> Facts {
    use parquet::file::reader::{FileReader, SerializedFileReader};
    let reader = SerializedFileReader::new(std::fs::File::open(log).unwrap()).unwrap();
    let pairs = reader.metadata().file_metadata().key_value_metadata().unwrap();
    pairs
        .iter()
        .filter_map(|p| Some((p.key.clone(), p.value.clone()?)))
        .filter(|p| p.0 != "ARROW:schema")
        .collect()
}

/// Rewrites some rows of a log as doubles, under an identity.
pub(crate) fn rewrite(from: &Path, to: &Path, facts: &Facts, rows: impl Fn(usize) -> bool) {
    let mut kept = Table::read(from).columns();
    for (_, values) in &mut kept {
        let mut row = 0..;
        values.retain(|_| row.next().is_some_and(&rows));
    }
    write_log(to, kept, facts);
}

pub(crate) fn write_log(to: &Path, columns: Vec<(String, Vec<f64>)>, facts: &[(String, String)]) {
    use ingest::parquet::writer::{Column, write_parquet};
    let columns: Vec<_> = columns.into_iter().map(|(name, values)| (name, Column::Real(values))).collect();
    write_parquet(to, &columns, facts).unwrap();
}

/// Writes a log with a row for each number that is there.
fn write_long(to: &Path, columns: &[(String, Vec<f64>)], facts: &[(String, String)]) {
    use ingest::parquet::writer::{Column, write_parquet};
    let (times, channels): (Vec<_>, Vec<_>) = columns.iter().partition(|(name, _)| name == "time_s");
    let numbers = channels.into_iter().flat_map(|(name, values)| {
        times[0].1.iter().zip(values).map(move |(time_s, value)| (*time_s, name.clone(), *value))
    });
    let mut rows: Vec<(f64, String, f64)> = numbers.filter(|row| !row.2.is_nan()).collect();
    rows.sort_by(|a, b| a.0.total_cmp(&b.0));
    let columns = [
        ("time_s".to_owned(), Column::Real(rows.iter().map(|row| row.0).collect())),
        ("parameter".to_owned(), Column::Text(rows.iter().map(|row| row.1.clone()).collect())),
        ("value".to_owned(), Column::Real(rows.iter().map(|row| row.2).collect())),
    ];
    write_parquet(to, &columns, facts).unwrap();
}
