//! Runs the accuracy study and writes `docs/accuracy.md` and its pictures.

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a study prints")]

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Parser;
use indicatif::{ProgressBar, ProgressStyle};
use rayon::prelude::*;

use validation::methods::{MethodResults, estimate_flight};
use validation::metrics::ErrorStats;
use validation::scenarios::{Class, Kind, classes};
use validation::{accuracy_page, gear_bench, plots, robot_logs};

/// Estimates simulated flights of known gap by every method, and writes tables and pictures of the errors.
#[derive(Debug, Parser)]
#[command(
    after_help = "Examples:\n  cargo run --release -p validation\n  cargo run --release -p validation -- --flights 20 --drawn 60 --only mixture --output /tmp/validation"
)]
struct Args {
    /// Flights in each scenario.
    #[arg(long, default_value_t = 100)]
    flights: u64,
    /// Flights drawn over wide ranges; a third as many for each foreign friction law.
    #[arg(long, default_value_t = 600)]
    drawn: u64,
    /// Only scenarios whose name holds this.
    #[arg(long, value_name = "TEXT")]
    only: Option<String>,
    /// The robot's logs and their configuration.
    #[arg(long, value_name = "DIR", default_value = "tests/data/kr300")]
    robot: PathBuf,
    /// Logs of the gear actuators, with their manifest; they are not part of the project (CC BY-SA 4.0).
    #[arg(long, value_name = "DIR")]
    gears: Option<PathBuf>,
    /// Where `accuracy.md` and its pictures go.
    #[arg(long, value_name = "DIR", default_value = "docs")]
    output: PathBuf,
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
    let wanted: Vec<&Class> =
        classes().iter().filter(|s| args.only.as_ref().is_none_or(|text| s.name.contains(text))).collect();
    let robot = robot_logs::robot(&args.robot)?;
    let gears = args.gears.as_deref().map(gear_bench::gear_bench_logs).transpose()?;
    let tallies = fly(&wanted, args)?;
    let page = accuracy_page::page(&tallies, &robot, gears.as_deref());
    let pictures = [
        ("accuracy-errors.svg", plots::errors(&tallies)),
        ("accuracy-scatter.svg", plots::scatter(&tallies)),
        ("accuracy-calibration.svg", plots::calibration(&tallies)),
    ];
    write(&args.output, "accuracy.md", &page)?;
    for (name, drawn) in pictures {
        write(&args.output.join("pictures"), name, &drawn.map_err(|e| format!("{name}: {e}"))?)?;
    }
    println!("{page}");
    Ok(())
}

/// All flights of all scenarios side by side, so that a slow one at the end keeps no core idle for long.
fn fly(wanted: &[&Class], args: &Args) -> Result<Vec<ErrorStats>, String> {
    let count = |scenario: &Class| match scenario.kind {
        Kind::Wide => args.drawn,
        Kind::Foreign => args.drawn.div_ceil(3),
        _ => args.flights,
    };
    let flights: Vec<(usize, u64)> = wanted
        .iter()
        .enumerate()
        .flat_map(|(s, scenario)| (0..count(scenario)).map(move |k| (s, k)))
        .collect();
    let bar = ProgressBar::new(flights.len() as u64);
    if let Ok(style) = ProgressStyle::with_template("flights {bar:30} {pos}/{len}  left {eta}") {
        bar.set_style(style);
    }
    let fly = |&(s, k): &(usize, u64)| {
        let results = estimate_flight(wanted[s], k);
        bar.inc(1);
        results
    };
    // One at a time from the queue: flights take from milliseconds to seconds.
    let answers: Vec<MethodResults> =
        flights.par_iter().with_max_len(1).map(fly).collect::<Result<_, _>>()?;
    bar.finish_and_clear();
    let mut rest = answers.as_slice();
    Ok(wanted
        .iter()
        .map(|scenario| {
            let (mine, others) = rest.split_at(count(scenario) as usize);
            rest = others;
            ErrorStats::new(scenario, mine)
        })
        .collect())
}

fn write(folder: &Path, name: &str, text: &str) -> Result<(), String> {
    let file = folder.join(name);
    std::fs::create_dir_all(folder)
        .and_then(|()| std::fs::write(&file, text))
        .map_err(|e| format!("{}: {e}", file.display()))
}
