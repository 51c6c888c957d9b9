//! The accuracy study, which writes `docs/accuracy.md`: flights of known gap, the methods compared, and how far each is from
//! the truth. The paper reproduced, which writes `docs/paper.md`.
//!
//! [`scenarios::CLASSES`] lists classes of flights, each with one assumption of the estimator broken; `Class::case` draws a
//! flight from a class and an index. `simulator` shares no equation with `estimator`, so neither can flatter the other.

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a study prints")]

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Parser;
use indicatif::{ProgressBar, ProgressStyle};
use rayon::prelude::*;

use crate::methods::{MethodResults, estimate_flight};
use crate::metrics::ErrorStats;
use crate::paper::Claims;
use crate::scenarios::{CLASSES, Class, Kind};

mod accuracy_page;
#[cfg(test)]
mod coverage;
mod drawing;
#[cfg(test)]
#[path = "../../../tests/gate.rs"]
mod gate;
mod gear_bench;
mod methods;
mod metrics;
mod paper;
mod plots;
mod robot_logs;
mod scenarios;

/// Estimates simulated flights of known gap by every method and writes tables and plots of the errors.
#[derive(Debug, Parser)]
#[command(
    after_help = "Examples:\n  cargo run --release -p validation\n  cargo run --release -p validation -- --flights 20 --only buffet\n  cargo run --release -p validation -- --only friction --csv /tmp/friction.csv\n  cargo run -p validation -- --paper docs"
)]
struct Args {
    /// Flights of each class.
    #[arg(long, default_value_t = 100)]
    flights: u64,
    /// Flights of the class `wide`; a third as many of each `wide` class with another friction law.
    /// Default: 600, or as `--flights` with `--only`.
    #[arg(long)]
    drawn: Option<u64>,
    /// Run only classes whose name contains TEXT, and print the tables instead of writing them.
    #[arg(long, value_name = "TEXT")]
    only: Option<String>,
    /// List the classes and exit.
    #[arg(long)]
    list: bool,
    /// Write the result of each flight to FILE.
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Folder of the robot's logs and their configuration.
    #[arg(long, value_name = "DIR", default_value = "tests/data/kr300")]
    robot: PathBuf,
    /// Folder of the gear-bench logs with their manifest; they are not part of the project (CC BY-SA 4.0).
    #[arg(long, value_name = "DIR")]
    gears: Option<PathBuf>,
    /// Folder for `accuracy.md` and its plots. Default: docs, or none with `--only`.
    #[arg(long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Run no study, but draw the paper's figures, measure its claims, and write `paper.md` and its pictures to DIR.
    #[arg(long, value_name = "DIR")]
    paper: Option<PathBuf>,
}

fn main() -> ExitCode {
    match run(&Args::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(what) => {
            eprintln!("error: {what}");
            ExitCode::FAILURE
        }
    }
}

fn run(args: &Args) -> Result<(), String> {
    if let Some(folder) = &args.paper {
        let claims = Claims::measure().map_err(|e| e.to_string())?;
        write(folder, "paper.md", &paper::page(&claims))?;
        return write_pictures(folder, paper::pictures(&claims));
    }
    let is_wanted = |class: &&Class| args.only.as_ref().is_none_or(|text| class.name.contains(text));
    let wanted: Vec<&Class> = CLASSES.iter().filter(is_wanted).collect();
    if args.list {
        wanted.iter().for_each(|class| println!("{}", class.name));
        return Ok(());
    }
    let results = estimate_flights(&wanted, args)?;
    if let Some(file) = &args.csv {
        let text = csv(&wanted, &results);
        std::fs::write(file, text).map_err(|e| format!("{}: {e}", file.display()))?;
    }
    let stats: Vec<ErrorStats> =
        wanted.iter().zip(&results).map(|(class, results)| ErrorStats::new(class, results)).collect();
    let whole = args.only.is_none().then(|| Path::new("docs"));
    match args.output.as_deref().or(whole) {
        Some(folder) => write_page(folder, &stats, args),
        None => {
            println!("{}", accuracy_page::tables(&stats));
            Ok(())
        }
    }
}

/// Writes a file into a folder, which is created.
fn write(folder: &Path, name: &str, text: &str) -> Result<(), String> {
    let file = folder.join(name);
    std::fs::create_dir_all(folder)
        .and_then(|()| std::fs::write(&file, text))
        .map_err(|e| format!("{}: {e}", file.display()))
}

fn write_pictures(
    folder: &Path,
    pictures: impl IntoIterator<Item = (&'static str, String)>,
) -> Result<(), String> {
    let folder = folder.join("pictures");
    pictures.into_iter().try_for_each(|(name, picture)| write(&folder, name, &picture))
}

/// The page with its plots, real machines included.
fn write_page(folder: &Path, stats: &[ErrorStats], args: &Args) -> Result<(), String> {
    let robot = robot_logs::robot(&args.robot)?;
    let gears = args.gears.as_deref().map(gear_bench::gear_bench_logs).transpose()?;
    let page = accuracy_page::page(stats, &robot, gears.as_deref());
    let plots = [
        ("accuracy-errors.svg", plots::errors(stats)),
        ("accuracy-scatter.svg", plots::scatter(stats)),
        ("accuracy-classes.svg", plots::classes(stats)),
        ("accuracy-calibration.svg", plots::calibration(stats)),
    ];
    write(folder, "accuracy.md", &page)?;
    write(folder, "accuracy.csv", &accuracy_page::csv(stats))?;
    write_pictures(folder, plots)?;
    println!("{page}");
    Ok(())
}

/// The flights of every class in parallel, one at a time from one queue: a flight takes from
/// milliseconds to seconds.
fn estimate_flights(wanted: &[&Class], args: &Args) -> Result<Vec<Vec<MethodResults>>, String> {
    let drawn = args.drawn.unwrap_or(if args.only.is_some() { args.flights } else { 600 });
    let count = |class: &Class| match class.kind {
        Kind::Wide => drawn,
        Kind::Foreign => drawn.div_ceil(3),
        _ => args.flights,
    };
    let flights: Vec<(&Class, u64)> =
        wanted.iter().flat_map(|class| (0..count(class)).map(|index| (*class, index))).collect();
    let bar = ProgressBar::new(flights.len() as u64);
    if let Ok(style) = ProgressStyle::with_template("flights {bar:30} {pos}/{len}  left {eta}") {
        bar.set_style(style);
    }
    let estimate = |&(class, index): &(&Class, u64)| {
        let results = estimate_flight(class, index);
        bar.inc(1);
        results
    };
    let results: Vec<MethodResults> =
        flights.par_iter().with_max_len(1).map(estimate).collect::<Result<_, _>>()?;
    bar.finish_and_clear();
    let mut rest = results.into_iter();
    Ok(wanted.iter().map(|class| rest.by_ref().take(count(class) as usize).collect()).collect())
}

/// One line for each flight: µm; empty where there is no number.
fn csv(wanted: &[&Class], results: &[Vec<MethodResults>]) -> String {
    let mut text = "class,index,truth_um,gap_um,low_um,high_um,midrange_um,codes\n".to_owned();
    let um = |m: f64| if m.is_finite() { format!("{:.4}", m * 1e6) } else { String::new() };
    for (class, result) in wanted.iter().zip(results).flat_map(|(c, all)| all.iter().map(move |r| (c, r))) {
        let (gap_m, low_m, high_m) = result.contact.unwrap_or((f64::NAN, f64::NAN, f64::NAN));
        let numbers = [result.truth_m, gap_m, low_m, high_m, result.by_method_m[1]].map(um).join(",");
        let codes = result.codes.join(" ");
        let _ = writeln!(text, "\"{}\",{},{numbers},{codes}", class.name, result.index);
    }
    text
}
