//! Time to read a store's records and to group them by unit: `histories STORE`. `docs/design.md` compares it with Polars.

#![expect(clippy::print_stdout, reason = "an example prints what it measured")]

use std::error::Error;
use std::time::Instant;

use pipeline::fleet_trends::assess::load_histories;
use store::Store;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().nth(1).ok_or("usage: histories STORE")?;
    let store = Store::open(folder)?;
    let begun = Instant::now();
    let histories = load_histories(&store)?;
    let rows: usize = histories.iter().map(|(_, history)| history.flights().len()).sum();
    println!("{} units, {rows} flights, {:.3} s", histories.names().count(), begun.elapsed().as_secs_f64());
    Ok(())
}
