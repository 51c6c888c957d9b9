//! Arguments of the commands that read or make logs: `init`, `check`, `estimate`, `normalize`, `simulate`.

use std::path::PathBuf;

use clap::Args as ClapArgs;
use ingest::parquet::writer::Encoding;

use super::shared::{RowFormatArgs, encoding_parser, parse_workers};

#[derive(Debug, ClapArgs)]
pub(crate) struct InitArgs {
    /// Write to this folder.
    #[arg(default_value = ".")]
    pub dir: PathBuf,
    /// Infer the log mapping from the logs below this folder.
    #[arg(long, value_name = "FOLDER")]
    pub from: Option<PathBuf>,
    /// Set up the sample fleet: simulated logs, all tables, and a pipeline.toml that reads them.
    #[arg(long, conflicts_with = "from")]
    pub sample: bool,
}

#[derive(Debug, ClapArgs)]
pub(crate) struct CheckArgs {
    /// Logs to read; default: those of the configuration.
    pub logs: Option<Vec<PathBuf>>,
    /// Check N logs, and at least one of each tail.
    #[arg(long, value_name = "N", default_value_t = 20)]
    pub limit: usize,
    #[command(flatten)]
    pub rows: RowFormatArgs,
}

#[derive(Debug, ClapArgs)]
pub(crate) struct EstimateArgs {
    /// Logs to estimate.
    #[arg(required = true)]
    pub logs: Vec<PathBuf>,
    /// Treat every actuator as this part number (identity and installations not required).
    #[arg(long, value_name = "PART")]
    pub part: Option<String>,
    /// Write per-sample filter output (inputs, estimated state, innovation, contact side, speed) to Parquet.
    #[arg(long, value_name = "FILE.parquet")]
    pub trace: Option<PathBuf>,
    /// Plot time histories and the load–deflection fit.
    #[arg(long, value_name = "FILE.svg|html")]
    pub plot: Option<PathBuf>,
    #[command(flatten)]
    pub rows: RowFormatArgs,
}

#[derive(Debug, ClapArgs)]
pub(crate) struct NormalizeArgs {
    /// Logs to read; default: those of the configuration.
    pub logs: Option<Vec<PathBuf>>,
    /// Write TAIL/DEPARTURE_FLIGHT/POSITION.parquet below this folder.
    #[arg(long, short, value_name = "DIR")]
    pub output: PathBuf,
    /// Parquet encoding: `split` is small and fast with Freeplay; `compatible` is for readers such as Spark.
    #[arg(long, value_parser = encoding_parser(), default_value = "split")]
    pub encoding: Encoding,
    /// Use N workers; default: one per core.
    #[arg(long, short, value_name = "N", value_parser = parse_workers, allow_negative_numbers = true)]
    pub jobs: Option<u16>,
}

#[derive(Debug, ClapArgs)]
pub(crate) struct SimulateArgs {
    /// Simulation spec; default: the sample fleet.
    pub spec: Option<PathBuf>,
    /// Write logs, installations and ground truth to this folder.
    #[arg(long, short, value_name = "DIR")]
    pub output: PathBuf,
    /// Override the seed of the spec.
    #[arg(long)]
    pub seed: Option<u64>,
    /// Use N workers; default: one per core.
    #[arg(long, short, value_name = "N", value_parser = parse_workers, allow_negative_numbers = true)]
    pub jobs: Option<u16>,
}
