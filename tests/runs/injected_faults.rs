//! File-system calls of a run that fail, are killed at, or never return: `tests/data/disk/faults.c`, preloaded.
//!
//! Every call of the process on a folder is counted, so that each can be tried. A test tries one call of each row, the
//! gate four; `FREEPLAY_FAULTS=all` tries all of them, and a number that many. `docs/reliability.md` has the figures.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::Command;
use std::sync::OnceLock;

use crate::gate::is_gate;
use crate::harness::{CommandResult, TestFleet, each, print_line};
use crate::runs::interruption::{small, whole_flights};

/// Calls that are tried of each kind of fault, by the tests and by the gate.
const SAMPLE: [usize; 2] = [1, 4];

/// The compiled injector, or why there is none.
pub(crate) struct Injector {
    _folder: tempfile::TempDir,
    library: PathBuf,
}

#[derive(Debug, Clone, Copy)]
struct Fault {
    /// Part of the paths whose calls count.
    under: &'static str,
    kind: &'static str,
    /// A name of `errno(3)`, `kill` or `hang`.
    mode: &'static str,
    /// The first call that fails; nothing fails at 0.
    at: usize,
    /// The last one; 0 for all that follow.
    last: usize,
    /// One more call that fails, and how.
    also: Option<(usize, &'static str)>,
}

/// The number of a name of `errno(3)`.
fn errno(mode: &str) -> &str {
    match mode {
        "EIO" => "5",
        "EACCES" => "13",
        "EMFILE" => "24",
        "ENOSPC" => "28",
        "ESTALE" => "116",
        other => other,
    }
}

impl Fault {
    fn at(under: &'static str, kind: &'static str, mode: &'static str, at: usize) -> Self {
        Self { under, kind, mode, at, last: at, also: None }
    }
}

impl Injector {
    /// The injector, compiled once for all tests; none without a C compiler.
    pub(crate) fn get() -> Option<&'static Self> {
        static INJECTOR: OnceLock<Option<Injector>> = OnceLock::new();
        INJECTOR.get_or_init(Self::compile).as_ref()
    }

    fn compile() -> Option<Self> {
        let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).unwrap();
        let library = folder.path().join("faults.so");
        let source = crate::harness::top().join("tests/data/disk/faults.c");
        let mut compile = Command::new("cc");
        compile.args(["-O1", "-shared", "-fPIC", "-o"]).arg(&library).arg(source).arg("-ldl");
        match compile.status() {
            Ok(status) if status.success() => Some(Self { _folder: folder, library }),
            _ => {
                print_line("skipped: no C compiler");
                None
            }
        }
    }

    fn command(&self, fleet: &TestFleet, args: &[&str], fault: &Fault) -> Command {
        let mut command = fleet.command(args);
        command.env("LD_PRELOAD", &self.library).env("FAULT_UNDER", fault.under);
        command.env("FAULT_KIND", fault.kind).env("FAULT_MODE", errno(fault.mode));
        if fault.at > 0 {
            command.env("FAULT_AT", fault.at.to_string()).env("FAULT_LAST", fault.last.to_string());
        }
        if let Some((at, mode)) = fault.also {
            command.env("FAULT_ALSO", format!("{at}:{}", errno(mode)));
        }
        command
    }

    fn run(&self, fleet: &TestFleet, args: &[&str], fault: &Fault) -> CommandResult {
        CommandResult::of(&mut self.command(fleet, args, fault))
    }

    /// A command under a clock that is ahead by `ahead_s` seconds.
    pub(crate) fn with_clock(&self, fleet: &TestFleet, args: &[&str], ahead_s: i64) -> CommandResult {
        let mut command = fleet.command(args);
        CommandResult::of(command.env("LD_PRELOAD", &self.library).env("CLOCK_OFFSET_S", ahead_s.to_string()))
    }

    /// A run one of whose calls on the store fails.
    pub(crate) fn random_fault(&self, fleet: &TestFleet, at: usize) {
        self.run(fleet, &["run", "--jobs", "1", "-q"], &Fault::at("results", "both", "EIO", at.max(1)));
    }

    fn count(&self, fleet: &TestFleet, args: &[&str], under: &'static str, kind: &'static str) -> usize {
        let file = fleet.path("calls.txt");
        let fault = Fault::at(under, kind, "EIO", 0);
        let mut command = self.command(fleet, args, &fault);
        let counted = command.env("FAULT_COUNT", &file).output().unwrap();
        assert!(counted.status.success(), "{args:?}: {}", String::from_utf8_lossy(&counted.stderr));
        std::fs::read_to_string(file).unwrap().parse().unwrap()
    }
}

/// Seed of random calls: `FREEPLAY_SEED`, else a fixed one.
pub(crate) fn seed() -> u64 {
    std::env::var("FREEPLAY_SEED").ok().map_or(412, |seed| seed.parse().unwrap())
}

/// How many calls of each row are tried: all, a number, or those of the gate.
fn sample() -> usize {
    match std::env::var("FREEPLAY_FAULTS") {
        Ok(which) if which == "all" => usize::MAX,
        Ok(which) => which.parse().unwrap(),
        Err(_) => SAMPLE[usize::from(is_gate())],
    }
}

/// The calls to test, spread evenly from the middle of the first part.
fn calls(count: usize) -> Vec<usize> {
    let step = count.div_ceil(sample()).max(1);
    (1 + step / 2..=count).step_by(step).collect()
}

/// The tail whose logs the small fleet's configuration names.
const TAIL: &str = "N413FP";

/// Three flights of four actuators.
pub(crate) fn few() -> TestFleet {
    let fleet = small();
    let kept = &fleet.logs_of(TAIL)[..3];
    fleet.logs().iter().filter(|log| !kept.contains(log)).for_each(|log| std::fs::remove_file(log).unwrap());
    fleet
}

/// Records of the three flights without a fault.
pub(crate) fn few_records() -> &'static str {
    static RECORDS: OnceLock<String> = OnceLock::new();
    RECORDS.get_or_init(|| {
        let fleet = few();
        fleet.run_ok(RUN);
        fleet.exported()
    })
}

/// The fleet with a run behind it and a log that is new.
fn grown() -> TestFleet {
    static GROWN: OnceLock<TestFleet> = OnceLock::new();
    TestFleet::once(&GROWN, || {
        let fleet = few();
        let log = fleet.logs_of(TAIL)[0].clone();
        let bytes = std::fs::read(&log).unwrap();
        std::fs::remove_file(&log).unwrap();
        fleet.run_ok(&["run", "-q"]);
        std::fs::write(&log, bytes).unwrap();
        fleet
    })
}

/// The fleet with every log in its store, in commits of their own.
fn stored() -> TestFleet {
    static STORED: OnceLock<TestFleet> = OnceLock::new();
    TestFleet::once(&STORED, || {
        let fleet = grown();
        fleet.run_ok(&["run", "-q"]);
        fleet
    })
}

/// A command under faults, after which the store must have the records of the three flights.
struct Struck {
    injector: &'static Injector,
    /// The fleet before the command; each try has a copy.
    before: TestFleet,
    args: &'static [&'static str],
    /// Pages of a report that must be there after it.
    pages: Vec<String>,
}

const RUN: &[&str] = &["run", "--jobs", "1"];

fn pages(fleet: &TestFleet) -> Vec<String> {
    let name = |path: PathBuf| path.strip_prefix(fleet.path("")).unwrap().to_string_lossy().into_owned();
    fleet.glob("pages/**/*").into_iter().map(name).collect()
}

impl Struck {
    fn new(injector: &'static Injector, before: TestFleet, args: &'static [&'static str]) -> Self {
        let mut command = Self { injector, before, args, pages: Vec::new() };
        if args[0] == "report" {
            let plain = command.before.copied();
            plain.run_ok(args);
            command.pages = pages(&plain);
            assert!(command.pages.len() > 4, "{:?}", command.pages);
        }
        command
    }

    fn count(&self, under: &'static str, kind: &'static str) -> usize {
        let count = self.injector.count(&self.before.copied(), self.args, under, kind);
        assert!(count > 0, "no call of {:?} on {under} was seen", self.args);
        count
    }

    /// Runs the command with a fault, and then without: the second must end with every record and page, and the first
    /// must have reported an error if one is missing. Returns the first exit code.
    fn tried(&self, fault: &Fault) -> Option<i32> {
        let fleet = self.before.copied();
        let struck = self.injector.run(&fleet, self.args, fault);
        assert!(matches!(struck.code, None | Some(0..=3 | 5)), "{fault:?}: {struck:?}");
        // A log of which one actuator cannot be read keeps the records of the others, and is an error.
        if fault.under == "results" {
            whole_flights(&fleet);
        }
        let is_run = self.args[0] == "run";
        if struck.code == Some(0) || !is_run {
            assert!(fleet.exported() == few_records(), "{fault:?} was not reported: {struck:?}");
        }
        if struck.code == Some(0) {
            assert_eq!(pages(&fleet), self.pages, "{fault:?} was not reported: {struck:?}");
        }
        let healed = fleet.freeplay(self.args);
        assert_eq!(
            healed.code,
            Some(0),
            "without a fault after {fault:?}: {healed:?}; it followed {struck:?}"
        );
        assert!(fleet.exported() == few_records(), "records differ without a fault after {fault:?}");
        assert_eq!(pages(&fleet), self.pages, "pages differ without a fault after {fault:?}");
        whole_flights(&fleet);
        struck.code
    }
}

/// Tries faults, and prints a row of the table in `docs/reliability.md`: what they struck, the calls that can fail, those
/// that were tried, and how often each exit code came. No try lost or doubled a row, as `tried` would have failed.
fn print_row(
    what: &str,
    count: usize,
    faults: impl IntoIterator<Item = Fault>,
    tried: impl Fn(&Fault) -> Option<i32>,
) {
    let mut codes = BTreeMap::<Option<i32>, usize>::new();
    for fault in faults {
        *codes.entry(tried(&fault)).or_default() += 1;
    }
    let shown = |(code, count): (&Option<i32>, &usize)| match code {
        Some(code) => format!("{code}: {count}"),
        None => format!("killed: {count}"),
    };
    let shown: Vec<String> = codes.iter().map(shown).collect();
    print_line(&format!(
        "| {what} | {count} | {} | {} | 0 |",
        codes.values().sum::<usize>(),
        shown.join(", ")
    ));
}

fn strike(injector: &'static Injector, &(args, (make, store), under, kind, mode, is_lasting): &Row) {
    let command = Struck::new(injector, make(), args);
    let count = command.count(under, kind);
    let last = |at| if is_lasting { 0 } else { at };
    let faults =
        calls(count).into_iter().map(|at| Fault { last: last(at), ..Fault::at(under, kind, mode, at) });
    let (args, all) = (args[0], if is_lasting { " and all that follow" } else { "" });
    let what = format!("`{args}`, {store} | {mode} at a {kind} of `{under}`{all}");
    print_row(&what, count, faults, |fault| command.tried(fault));
}

/// A fleet before the command, and what its store is.
type Start = (fn() -> TestFleet, &'static str);

/// A command, what it starts from, the part of the paths whose calls count, their kind, the fault, and whether all calls that
/// follow fail, too.
type Row = (&'static [&'static str], Start, &'static str, &'static str, &'static str, bool);

const NEW: Start = (few, "new store");
const GROWN: Start = (grown, "grown store");
const STORED: Start = (stored, "grown store");

const TABLES: Start = (with_tables, "new store");

const COMPACT: &[&str] = &["store", "compact"];
const REPORT: &[&str] = &["report", "--output", "pages"];
const LOGS: &str = "sample-data/logs";

/// Permissions that are set right (EACCES), and a process that may open more files (EMFILE), change nothing of a log: the next
/// run tries it again by itself.
const FAULTS: [Row; 24] = [
    (RUN, NEW, LOGS, "read", "EIO", false),
    (RUN, NEW, LOGS, "read", "EIO", true),
    (RUN, NEW, LOGS, "read", "ESTALE", false),
    (RUN, NEW, LOGS, "read", "EACCES", false),
    (RUN, NEW, LOGS, "read", "EMFILE", false),
    (RUN, NEW, "results", "write", "EIO", false),
    (RUN, NEW, "results", "write", "kill", false),
    (RUN, NEW, "results", "read", "EIO", false),
    (RUN, GROWN, "results", "write", "EIO", false),
    (RUN, GROWN, "results", "write", "EIO", true),
    (RUN, GROWN, "results", "write", "kill", false),
    (RUN, GROWN, "results", "read", "ESTALE", false),
    (RUN, TABLES, "pipeline.toml", "read", "EIO", false),
    (RUN, TABLES, "installations.csv", "read", "EIO", false),
    (RUN, TABLES, "flights.csv", "read", "EIO", false),
    (RUN, TABLES, "maintenance.csv", "read", "EIO", false),
    (RUN, TABLES, "inspections.csv", "read", "EIO", false),
    (COMPACT, STORED, "results", "write", "EIO", false),
    (COMPACT, STORED, "results", "write", "kill", false),
    (COMPACT, STORED, "results", "read", "EIO", false),
    (COMPACT, STORED, "results", "read", "ESTALE", false),
    (REPORT, STORED, "results", "read", "EIO", false),
    (REPORT, STORED, "pages", "write", "EIO", false),
    (REPORT, STORED, "pages", "write", "kill", false),
];

/// Whatever call fails, and wherever a run, a compaction or a report is killed: the command without a fault makes whole what is
/// missing, and a missing row or page was reported.
#[test]
fn a_fault_at_any_call_loses_nothing_and_is_reported() {
    let Some(injector) = Injector::get() else { return };
    each(&FAULTS, |row| strike(injector, row));
}

/// The fleet with every table that a configuration names.
fn with_tables() -> TestFleet {
    let fleet = few();
    let mut named = "installations = \"sample-data/installations.csv\"".to_owned();
    for (table, text) in [
        (
            "flights",
            "tail_number,flight_id,departure_utc,flight_hours\nN413FP,LATER,2026-11-01T06:00:00Z,1.5\n",
        ),
        (
            "maintenance",
            "part_number,serial_number,utc,kind\nEMA-27-1040,1040-0009,2026-11-01T00:00:00Z,reshim\n",
        ),
        (
            "inspections",
            "part_number,serial_number,date_utc,play_m\nEMA-27-1040,1040-0009,2026-11-01T00:00:00Z,9e-5\n",
        ),
    ] {
        std::fs::write(fleet.path(&format!("{table}.csv")), text).unwrap();
        named.extend(["\n", table, " = \"", table, ".csv\""]);
    }
    fleet.configure("installations = \"sample-data/installations.csv\"", &named);
    fleet
}

/// What is printed at exit code 0 is what is printed without a fault: no unit, flight or alert is left out.
#[test]
fn a_read_that_fails_makes_no_command_print_less() {
    const COMMANDS: [&[&str]; 8] = [
        &["trend", "--format", "csv"],
        &["trend", "--quantities", "--format", "csv"],
        &["query", "tail", "N413FP", "--format", "csv"],
        &["store", "export", "--format", "csv"],
        &["store", "verify"],
        &["store", "alerts", "--format", "csv"],
        &["store", "runs", "--format", "csv"],
        &["work", "list", "--format", "csv"],
    ];
    let Some(injector) = Injector::get() else { return };
    let fleet = stored();
    for command in COMMANDS {
        let sound = injector.run(&fleet, command, &Fault::at("results", "read", "EIO", 0));
        assert_eq!(sound.code, Some(0), "{command:?}: {sound:?}");
        let count = injector.count(&fleet, command, "results", "read");
        for mode in ["EIO", "ESTALE"] {
            let tried = |fault: &Fault| {
                let struck = injector.run(&fleet, command, fault);
                assert!(matches!(struck.code, Some(0..=3 | 5)), "{fault:?}: {struck:?}");
                if struck.code == Some(0) {
                    assert_eq!(struck.out, sound.out, "{command:?}: {fault:?} is silent");
                } else {
                    assert!(struck.err.contains("error["), "{command:?}: {struck:?}");
                }
                struck.code
            };
            let shown = command[..2].join(" ").replace(" --format", "");
            let what = format!("`{shown}` | {mode} at a read of the store");
            let faults = calls(count).into_iter().map(|at| Fault::at("results", "read", mode, at));
            print_row(&what, count, faults, tried);
        }
    }
}

/// Run after run on one store is killed at a call from a seed, until a run finishes, and then from nothing again.
#[test]
fn kills_of_run_after_run_lose_nothing_and_double_nothing() {
    let Some(injector) = Injector::get() else { return };
    let kills = if is_gate() { 200 } else { 8 };
    let wanted = few_records();
    let count = injector.count(&few(), RUN, "results", "write");
    let mut chance = fastrand::Rng::with_seed(seed());
    let (mut fleet, mut kept, mut killed, mut finished, mut partly) = (few(), 0, 0, 0, 0);
    while killed < kills {
        let fault = Fault::at("results", "write", "kill", 1 + (chance.f64() * count as f64) as usize);
        let ended = injector.run(&fleet, RUN, &fault);
        let now = whole_flights(&fleet);
        assert!(now >= kept, "{kept} records were kept, now {now}, after {fault:?}");
        kept = now;
        if ended.code.is_some() {
            assert!(fleet.exported() == wanted, "after kills, the finished store is another one: {ended:?}");
            (fleet, kept, finished) = (few(), 0, finished + 1);
        } else {
            (killed, partly) = (killed + 1, partly + usize::from(now > 0));
        }
    }
    fleet.run_ok(RUN);
    assert_eq!(fleet.exported(), wanted);
    print_line(&format!(
        "{killed} runs were killed, {partly} with records stored, {finished} finished between"
    ));
    assert!(partly > 0 && finished > 0, "no kill came after a commit, or no run finished");
}

#[test]
fn two_faults_in_one_run_lose_nothing() {
    const MODES: [&str; 4] = ["EIO", "ESTALE", "ENOSPC", "kill"];
    let Some(injector) = Injector::get() else { return };
    let mut chance = fastrand::Rng::with_seed(seed());
    for (make, store) in [NEW, GROWN] {
        let command = Struck::new(injector, make(), RUN);
        let count = command.count("results", "both");
        let mut below = |count: usize| (chance.f64() * count as f64) as usize;
        let mut drawn = || {
            let (first, second) = (below(count), below(count));
            let (mode, also) = (MODES[below(3)], MODES[below(4)]);
            let fault = Fault::at("results", "both", mode, 1 + first.min(second));
            Fault { also: Some((1 + first.max(second), also)), ..fault }
        };
        let faults: Vec<Fault> = (0..sample().min(count)).map(|_| drawn()).collect();
        let what = format!("`run`, {store} | two of EIO, ESTALE, ENOSPC and kill at calls of the store");
        print_row(&what, count, faults, |fault| command.tried(fault));
    }
}
