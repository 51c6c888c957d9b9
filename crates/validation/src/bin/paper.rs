//! Reproduces the paper: writes its figures, and a page with its claims.

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a command prints")]

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Parser;

use validation::paper::{Claims, page, pictures};
use validation::write;

/// Draws figures 2 to 7 of the paper from a simulated flight, measures its claims, and writes `paper.md`.
#[derive(Debug, Parser)]
#[command(name = "paper", after_help = "Example:\n  cargo run -p validation --bin paper -- --output docs")]
struct Args {
    /// Folder for `paper.md` and its pictures.
    #[arg(long, value_name = "DIR")]
    output: PathBuf,
}

fn main() -> ExitCode {
    match run(&Args::parse().output) {
        Ok(()) => ExitCode::SUCCESS,
        Err(what) => {
            eprintln!("error: {what}");
            ExitCode::FAILURE
        }
    }
}

fn run(folder: &Path) -> Result<(), String> {
    let claims = Claims::measure().map_err(|e| e.to_string())?;
    write(folder, "paper.md", &page(&claims))?;
    for (name, picture) in pictures(&claims) {
        write(&folder.join("pictures"), name, &picture.map_err(|e| format!("{name}: {e}"))?)?;
    }
    println!("{}", folder.join("paper.md").display());
    Ok(())
}
