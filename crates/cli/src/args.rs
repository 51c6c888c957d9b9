//! What may be typed. The doc comments are the help texts.

use std::path::PathBuf;

use clap::{ArgAction, Args as ClapArgs, Parser, Subcommand, ValueEnum};
use jiff::Timestamp;

const AFTER: &str = "\
First steps:
  freeplay init            write a commented pipeline.toml here
  freeplay check           see what your logs offer, before anything is computed
  freeplay run             estimate every new flight, store it, state the trends
  freeplay query tail N412FP

Exit codes: 0 all well, 1 some logs in error, 2 usage or configuration, 3 the run failed,
4 a state was reached (--fail-on), 130 interrupted.";

/// The backlash gap of flight-control actuators, from the logs a fleet records anyway.
#[derive(Debug, Parser)]
#[command(name = "freeplay", version, after_help = AFTER, infer_subcommands = false, propagate_version = true)]
pub(crate) struct Args {
    #[command(flatten)]
    pub global: Global,
    #[command(subcommand)]
    pub command: Command,
}

/// The configuration where no other is named.
pub(crate) const CONFIG: &str = "pipeline.toml";

/// Options of every command.
#[derive(Debug, ClapArgs)]
pub(crate) struct Global {
    /// The configuration; a second one is laid over the first, key by key.
    #[arg(
        long,
        global = true,
        env = "FREEPLAY_CONFIG",
        default_value = CONFIG,
        value_name = "FILE"
    )]
    pub config: Vec<PathBuf>,
    /// Say nothing but the answer and errors.
    #[arg(short, long, global = true)]
    pub quiet: bool,
    /// Say more; twice for everything.
    #[arg(short, long, global = true, action = ArgAction::Count)]
    pub verbose: u8,
    /// No progress bar or progress lines.
    #[arg(long, global = true)]
    pub no_progress: bool,
    /// What stderr gets: lines for people, or one JSON object a line for whoever collects logs.
    #[arg(long, global = true, value_enum, default_value_t = LogFormat::Text, value_name = "FORM")]
    pub log_format: LogFormat,
    /// Colour in what people read.
    #[arg(long, global = true, value_enum, default_value_t = Color::Auto, value_name = "WHEN")]
    pub color: Color,
}

/// Form of what is said beside the answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum LogFormat {
    /// For people.
    Text,
    /// For machines.
    Json,
}

/// When to colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Color {
    /// On a terminal, unless `NO_COLOR` is set.
    Auto,
    /// Always.
    Always,
    /// Never.
    Never,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Write a commented pipeline.toml and an example installations.csv; nothing is overwritten
    #[command(after_help = "Examples:\n  freeplay init fleet-a\n  freeplay init --from /data/logs")]
    Init(InitArgs),
    /// Say channel by channel what was found, mapped and converted, and what would be refused
    #[command(after_help = "Example:\n  freeplay check logs/N412FP/20261119_0413.parquet")]
    Check(CheckArgs),
    /// The nightly job: every log not yet accounted for, then the trends of the units it touched
    #[command(
        after_help = "Examples:\n  freeplay run\n  freeplay run --since 2026-11-01 --tail N412FP --redo\n  freeplay run --fail-on act && echo nobody needs a hangar today"
    )]
    Run(RunArgs),
    /// Estimate logs ad hoc; nothing is stored
    #[command(
        after_help = "Examples:\n  freeplay estimate logs/N412FP/*.parquet\n  freeplay estimate bench.parquet --part EMA-27-1040 --trace trace.parquet\n  freeplay estimate bench.parquet --part EMA-27-1040 --plot look.html"
    )]
    Estimate(EstimateArgs),
    /// Write each actuator's channels as `run` sees them: SI, one clock, one file
    #[command(
        after_help = "Examples:\n  freeplay normalize logs/N412FP/*.parquet --output normalized\n  freeplay normalize --output for-spark --encoding compatible"
    )]
    Normalize(NormalizeArgs),
    /// Stored records, of a tail, a serial number, a flight or a position
    #[command(
        after_help = "Examples:\n  freeplay query tail N412FP --last 20\n  freeplay query serial 00317 --since 2026-01-01 --json"
    )]
    Query(QueryArgs),
    /// Level, rate, crossing of the limit and state of each unit
    #[command(
        after_help = "Examples:\n  freeplay trend --tail N412FP\n  freeplay trend --estimates history.csv --queries dates.csv --format csv"
    )]
    Trend(TrendArgs),
    /// How one number came about: its inputs, settings and channels, and the same number made again
    #[command(after_help = "Example:\n  freeplay explain N412FP-0007 aileron_left")]
    Explain(ExplainArgs),
    /// Two stores side by side: what another method or other settings made of the same flights
    #[command(
        after_help = "Example:\n  freeplay run --config pipeline.toml --config trial.toml && freeplay diff results results-trial\n\nMake the other one current by naming it under [store] in pipeline.toml."
    )]
    Diff(DiffArgs),
    /// Past statements against what came true
    #[command(
        after_help = "Examples:\n  freeplay backtest\n  freeplay backtest --estimates history.parquet --json"
    )]
    Backtest(BacktestArgs),
    /// Pages for people: the fleet, each tail, each unit; they open from disk, without a network
    #[command(
        after_help = "Examples:\n  freeplay report --output report\n  freeplay report --output n412fp --tail N412FP"
    )]
    Report(ReportArgs),
    /// Fly a simulated fleet: logs, installations and the truth
    #[command(
        after_help = "Example:\n  freeplay simulate --output /tmp/fleet && freeplay run --config /tmp/fleet/pipeline.toml"
    )]
    Simulate(SimulateArgs),
    /// Care of the results
    #[command(
        after_help = "Examples:\n  freeplay store info --max-age 30h\n  freeplay store export --format csv --output gaps.csv"
    )]
    Store(StoreArgs),
    /// Completions for a shell
    #[command(
        after_help = "Example:\n  freeplay completions bash > ~/.local/share/bash-completion/completions/freeplay"
    )]
    Completions(CompletionsArgs),
    /// The manual page
    #[command(after_help = "Example:\n  freeplay man | man -l -")]
    Man,
}

/// Where rows go, and in which form.
#[derive(Debug, Clone, ClapArgs)]
pub(crate) struct RowFormatArgs {
    /// Form of the rows.
    #[arg(long, value_enum, default_value_t = Format::Table)]
    pub format: Format,
    /// Short for `--format json`.
    #[arg(long, conflicts_with = "format")]
    pub json: bool,
    /// File for the rows instead of stdout.
    #[arg(long, short, value_name = "FILE")]
    pub output: Option<PathBuf>,
}

impl RowFormatArgs {
    /// The form asked for.
    pub(crate) fn format(&self) -> Format {
        if self.json { Format::Json } else { self.format }
    }
}

/// Forms of rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Format {
    /// For people: µm, hours, dates.
    Table,
    /// An array of objects, SI.
    Json,
    /// SI, with a header.
    Csv,
    /// SI.
    Parquet,
}

/// `init`.
#[derive(Debug, ClapArgs)]
pub(crate) struct InitArgs {
    /// Folder to write to.
    #[arg(default_value = ".")]
    pub dir: PathBuf,
    /// Look at the logs below this folder and propose how to read them.
    #[arg(long, value_name = "FOLDER")]
    pub from: Option<PathBuf>,
}

/// `check`.
#[derive(Debug, ClapArgs)]
pub(crate) struct CheckArgs {
    /// Logs; those the configuration names when none is given.
    pub logs: Vec<PathBuf>,
    /// Look at so many of the configured logs at most.
    #[arg(long, default_value_t = 20)]
    pub limit: usize,
    #[command(flatten)]
    pub rows: RowFormatArgs,
}

/// `explain`.
#[derive(Debug, ClapArgs)]
pub(crate) struct ExplainArgs {
    /// The flight.
    pub flight: String,
    /// The position.
    pub position: String,
    /// The aircraft, where two of them have a flight of this name.
    #[arg(long)]
    pub tail: Option<String>,
    /// As JSON, SI.
    #[arg(long)]
    pub json: bool,
}

/// `diff`.
#[derive(Debug, ClapArgs)]
pub(crate) struct DiffArgs {
    /// One store.
    pub before: PathBuf,
    /// The other.
    pub after: PathBuf,
    /// Gaps that differ by less are alike, µm.
    #[arg(long, default_value_t = 0.0)]
    pub least_um: f64,
    #[command(flatten)]
    pub rows: RowFormatArgs,
}

/// `normalize`.
#[derive(Debug, ClapArgs)]
pub(crate) struct NormalizeArgs {
    /// Logs; those the configuration names when none is given.
    pub logs: Vec<PathBuf>,
    /// Folder to write to: TAIL/FLIGHT/POSITION.parquet below it.
    #[arg(long, short, value_name = "DIR")]
    pub output: PathBuf,
    /// How numbers lie in the files.
    #[arg(long, value_enum, default_value_t = LogEncoding::Split)]
    pub encoding: LogEncoding,
    /// Workers; as many as cores by default.
    #[arg(long, short, value_parser = clap::value_parser!(u16).range(1..))]
    pub jobs: Option<u16>,
}

/// How numbers lie in a normalized log.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum LogEncoding {
    /// Byte stream split: smallest, and quickest to read here.
    Split,
    /// Dictionary and plain: for readers that know no byte stream split, such as Spark 4.2.
    Compatible,
}

impl From<LogEncoding> for ingest::parquet::writer::Encoding {
    fn from(encoding: LogEncoding) -> Self {
        match encoding {
            LogEncoding::Split => Self::Split,
            LogEncoding::Compatible => Self::Compatible,
        }
    }
}

/// `run`.
#[derive(Debug, ClapArgs)]
#[expect(clippy::struct_excessive_bools, reason = "each is a flag that a user types")]
pub(crate) struct RunArgs {
    /// Departures from this UTC date or time on.
    #[arg(long, value_parser = parse_utc, value_name = "UTC")]
    pub since: Option<Timestamp>,
    /// Departures before this UTC date or time.
    #[arg(long, value_parser = parse_utc, value_name = "UTC")]
    pub until: Option<Timestamp>,
    /// One aircraft only.
    #[arg(long)]
    pub tail: Option<String>,
    /// Flights of this unit only.
    #[arg(long)]
    pub serial: Option<String>,
    /// So many logs at most.
    #[arg(long)]
    pub limit: Option<usize>,
    /// Workers; as many as cores by default.
    #[arg(long, short, value_parser = clap::value_parser!(u16).range(1..))]
    pub jobs: Option<u16>,
    /// Logs in error again.
    #[arg(long)]
    pub retry: bool,
    /// All logs again.
    #[arg(long)]
    pub redo: bool,
    /// Read the content of known logs too, and do those again that changed without a trace in size or date.
    #[arg(long)]
    pub verify_content: bool,
    /// Say what would be done and why, and do nothing.
    #[arg(long)]
    pub dry_run: bool,
    /// Also write the account as metrics in Prometheus' text format, e.g. for a node exporter.
    #[arg(long, value_name = "FILE")]
    pub metrics: Option<PathBuf>,
    /// Wait for another run that holds the store, e.g. `20m`.
    #[arg(long, value_parser = parse_span, value_name = "TIME")]
    pub wait: Option<std::time::Duration>,
    /// End with code 4 when a unit is at or past this state.
    #[arg(long, value_enum, value_name = "STATE")]
    pub fail_on: Option<FailOn>,
    /// The account of the run as JSON on stdout.
    #[arg(long)]
    pub json: bool,
}

/// States that can fail a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, ValueEnum)]
pub(crate) enum FailOn {
    /// The watch limit.
    Watch,
    /// The planning horizon.
    Plan,
    /// The act limit.
    Act,
}

/// `estimate`.
#[derive(Debug, ClapArgs)]
pub(crate) struct EstimateArgs {
    /// Logs.
    #[arg(required = true)]
    pub logs: Vec<PathBuf>,
    /// Take every actuator as this part: no identity or installations are needed.
    #[arg(long, value_name = "PART")]
    pub part: Option<String>,
    /// Write S(t), its inputs, innovation and its variance, and the flank pressed, per sample.
    #[arg(long, value_name = "FILE.parquet")]
    pub trace: Option<PathBuf>,
    /// Draw it: δX, load and S(t) with both means, and δX against force with the flanks as fitted.
    #[arg(long, value_name = "FILE.svg|png|html")]
    pub plot: Option<PathBuf>,
    #[command(flatten)]
    pub rows: RowFormatArgs,
}

/// `query`.
#[derive(Debug, ClapArgs)]
pub(crate) struct QueryArgs {
    /// What to ask by.
    #[arg(value_enum)]
    pub by: QueryKey,
    /// Its name.
    pub id: String,
    /// Departures from this UTC date or time on.
    #[arg(long, value_parser = parse_utc, value_name = "UTC")]
    pub since: Option<Timestamp>,
    /// Departures before this UTC date or time.
    #[arg(long, value_parser = parse_utc, value_name = "UTC")]
    pub until: Option<Timestamp>,
    /// The newest N records only.
    #[arg(long, value_name = "N")]
    pub last: Option<usize>,
    /// Of this part number only.
    #[arg(long)]
    pub part: Option<String>,
    #[command(flatten)]
    pub rows: RowFormatArgs,
}

/// What records are asked by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum QueryKey {
    /// The aircraft.
    Tail,
    /// The unit.
    Serial,
    /// The flight.
    Flight,
    /// The place on the aircraft.
    Position,
}

/// `trend`.
#[derive(Debug, ClapArgs)]
pub(crate) struct TrendArgs {
    /// Units on this tail.
    #[arg(long)]
    pub tail: Option<String>,
    /// This unit.
    #[arg(long)]
    pub serial: Option<String>,
    /// This part number.
    #[arg(long)]
    pub part: Option<String>,
    /// The day of the statement; by default that of the newest record. Nothing later is looked at.
    #[arg(long, value_parser = parse_utc, value_name = "UTC")]
    pub as_of: Option<Timestamp>,
    #[command(flatten)]
    pub external: ExternalEstimatesArgs,
    /// One row per query: `serial_number`, `as_of_utc`, optionally `part_number`.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["as_of", "tail", "serial", "part"])]
    pub queries: Option<PathBuf>,
    /// Adds Theil–Sen's slope and Hamed and Rao's test; they take longer than all the rest.
    #[arg(long)]
    pub statistics: bool,
    #[command(flatten)]
    pub rows: RowFormatArgs,
}

/// Histories that were estimated elsewhere.
#[derive(Debug, ClapArgs)]
pub(crate) struct ExternalEstimatesArgs {
    /// An estimates table made elsewhere, instead of the store; it needs no configuration.
    #[arg(long, value_name = "FILE")]
    pub estimates: Option<PathBuf>,
    /// The gap that grounds, m, of parts for which the configuration states none: 150e-6 is 150 µm.
    #[arg(long, value_name = "M", value_parser = parse_limit)]
    pub limit_m: Option<f64>,
}

/// `backtest`.
#[derive(Debug, ClapArgs)]
pub(crate) struct BacktestArgs {
    #[command(flatten)]
    pub external: ExternalEstimatesArgs,
    #[command(flatten)]
    pub rows: RowFormatArgs,
}

/// `report`.
#[derive(Debug, ClapArgs)]
pub(crate) struct ReportArgs {
    /// Folder of the pages; a report that is there is replaced, anything else is left alone.
    #[arg(long, short, value_name = "DIR")]
    pub output: PathBuf,
    /// Units on this tail.
    #[arg(long)]
    pub tail: Option<String>,
    /// This unit.
    #[arg(long)]
    pub serial: Option<String>,
    /// The day of the statements; by default that of the newest record. Nothing later is looked at.
    #[arg(long, value_parser = parse_utc, value_name = "UTC")]
    pub as_of: Option<Timestamp>,
}

/// `simulate`.
#[derive(Debug, ClapArgs)]
pub(crate) struct SimulateArgs {
    /// What to fly; a small fleet by default.
    pub spec: Option<PathBuf>,
    /// Folder for logs, installations and truth.
    #[arg(long, short, value_name = "DIR")]
    pub output: PathBuf,
    /// Another seed than the spec's.
    #[arg(long)]
    pub seed: Option<u64>,
    /// Workers; as many as cores by default.
    #[arg(long, short, value_parser = clap::value_parser!(u16).range(1..))]
    pub jobs: Option<u16>,
}

/// `store`.
#[derive(Debug, ClapArgs)]
pub(crate) struct StoreArgs {
    #[command(subcommand)]
    pub command: StoreCommand,
}

/// Care of the results.
#[derive(Debug, Subcommand)]
pub(crate) enum StoreCommand {
    /// What the store holds, and when it was last fed
    Info {
        /// Fail (code 1) when the last completed run is older, e.g. `30h`.
        #[arg(long, value_parser = parse_span, value_name = "TIME")]
        max_age: Option<std::time::Duration>,
        /// As JSON.
        #[arg(long)]
        json: bool,
    },
    /// The last runs with their figures, or the logs of one run by class and reason; killed runs too
    Runs {
        /// The logs of this run; `last` is the newest.
        #[arg(long, value_name = "ID")]
        run: Option<String>,
        /// So many runs at most, the newest.
        #[arg(long, default_value_t = 20)]
        last: usize,
        #[command(flatten)]
        rows: RowFormatArgs,
    },
    /// The data files of a table as of now, one a line, for engines that read no Delta log
    Files {
        /// The table.
        #[arg(long, value_enum, default_value_t = Table::Gaps)]
        table: Table,
    },
    /// Look for missing, changed or doubled data
    Verify,
    /// Merge small files, sorted for queries
    Compact,
    /// Take over what another store found of the same logs, e.g. a trial of other settings
    Adopt {
        /// The other store's folder; it stays as it is.
        #[arg(value_name = "TRIAL")]
        trial: PathBuf,
    },
    /// All records, in order
    Export {
        #[command(flatten)]
        rows: RowFormatArgs,
    },
}

/// Tables of the store.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Table {
    /// One row per actuator and flight.
    Gaps,
    /// The accounts of logs.
    Logs,
    /// The accounts of runs.
    Runs,
}

/// `completions`.
#[derive(Debug, ClapArgs)]
pub(crate) struct CompletionsArgs {
    /// The shell.
    #[arg(value_enum)]
    pub shell: clap_complete::Shell,
}

fn parse_utc(text: &str) -> Result<Timestamp, String> {
    ingest::tables::utc(text)
}

fn parse_limit(text: &str) -> Result<f64, String> {
    let limit_m = text.parse().map_err(|_| format!("`{text}` is no number of metres such as 150e-6"))?;
    job::config::limits::plausible_limit_m(limit_m)
}

fn parse_span(text: &str) -> Result<std::time::Duration, String> {
    let span: jiff::SignedDuration =
        text.parse().map_err(|e| format!("`{text}` is no span of time such as 20m or 30h: {e}"))?;
    span.try_into().map_err(|_| format!("`{text}` is below zero"))
}
