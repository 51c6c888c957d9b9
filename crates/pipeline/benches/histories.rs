//! Time to read records and to group them by unit: `histories STORE` or `histories ESTIMATES.parquet`.
//! `benches/histories.py` compares it with Polars.

#![expect(clippy::print_stdout, reason = "an example prints what it measured")]

use std::collections::BTreeSet;
use std::error::Error;
use std::path::Path;
use std::time::Instant;

use pipeline::assess::trends::load_histories;
use pipeline::fleet::external_estimates;
use store::Store;

fn main() -> Result<(), Box<dyn Error>> {
    let source = std::env::args()
        .skip(1)
        .find(|a| a != "--bench")
        .ok_or("usage: histories STORE|ESTIMATES.parquet")?;
    let begun = Instant::now();
    let histories = if source.ends_with(".parquet") {
        external_estimates::read(Path::new(&source), &BTreeSet::new())?
    } else {
        load_histories(&Store::open(&source)?, &BTreeSet::new())?
    };
    let rows: usize = histories.units.values().map(|history| history.flights().len()).sum();
    println!("{} units, {rows} flights, {:.3} s", histories.units.len(), begun.elapsed().as_secs_f64());
    Ok(())
}
