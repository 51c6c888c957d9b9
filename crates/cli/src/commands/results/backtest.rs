//! `backtest`: past statements against what came true, by share of the way that was behind the unit.

use std::sync::Arc;

use arrow::datatypes::{DataType, Field, Schema, SchemaRef};
use pipeline::fleet_trends::assess;
use pipeline::fleet_trends::backtest::{self, BacktestRow};
use store::Store;

use crate::args::{BacktestArgs, Global};
use crate::exit::{Code, Failure};
use crate::output::Output;
use crate::row_output;
use crate::table::{self, number, text};

use crate::commands::context::load_trend_context;

/// Bounds of the shares, and what they are called.
const SHARES: [(f64, f64, &str); 4] = [
    (0.0, 0.35, "below 35 %"),
    (0.35, 0.65, "35 to 65 %"),
    (0.65, 1.01, "65 % and more"),
    (0.0, 1.01, "all"),
];

/// Answers with a summary for people, and with one row for each past statement for machines.
///
/// # Errors
/// When configuration, tables or store cannot be read.
pub(crate) fn backtest(args: &BacktestArgs, global: &Global, output: &Output) -> Result<Code, Failure> {
    let (config, installations) = load_trend_context(&args.external, global, output)?;
    let histories = match &args.external.estimates {
        Some(file) => pipeline::history::external_estimates::read(file)?,
        None => assess::load_histories(&Store::open(config.store())?)?,
    };
    let found = backtest::of_histories(&config, &installations, &histories)?;
    row_output::write_rows(&args.rows, output, || row_output::batch(&schema(), &found), || page(&found))?;
    Ok(Code::Success)
}

fn page(found: &[BacktestRow]) -> String {
    if found.is_empty() {
        return "no past statement can be held against what came true: it takes a unit seen to wear, and more wear since\n".to_owned();
    }
    let columns = [
        text("asked for", 0),
        text("way behind", 0),
        number("statements", 0),
        number("median error %", 0),
        number("90 % interval held %", 0),
        number("said too late %", 1),
        number("said too early %", 1),
        number("within 20 %", 1),
    ];
    let cells: Vec<Vec<String>> = [("limit", "the limit"), ("level", "the level now")]
        .into_iter()
        .flat_map(|(target, name)| SHARES.map(|share| line(found, target, name, share)))
        .flatten()
        .collect();
    table::layout(&columns, &cells)
}

/// One line of the summary; nothing where no statement falls into it.
fn line(
    found: &[BacktestRow],
    target: &str,
    name: &str,
    (from, to, share): (f64, f64, &str),
) -> Option<Vec<String>> {
    let within = |p: &&BacktestRow| p.target == target && p.used_share >= from && p.used_share < to;
    let among: Vec<&BacktestRow> = found.iter().filter(within).collect();
    let mut errors: Vec<f64> = among.iter().map(|p| p.relative_error).collect();
    errors.sort_unstable_by(f64::total_cmp);
    let median = errors.get(errors.len() / 2)?;
    let per_cent = |count: usize| format!("{:.0}", 100.0 * count as f64 / among.len() as f64);
    let ended = |how: &str| per_cent(among.iter().filter(|p| p.interval == how).count());
    Some(vec![
        name.to_owned(),
        share.to_owned(),
        among.len().to_string(),
        format!("{:.0}", 100.0 * median),
        ended("held"),
        ended("late"),
        ended("early"),
        per_cent(errors.iter().filter(|e| **e <= 0.2).count()),
    ])
}

fn schema() -> SchemaRef {
    let text = |name: &str| Field::new(name, DataType::Utf8, true);
    let real = |name: &str| Field::new(name, DataType::Float64, true);
    Arc::new(Schema::new(vec![
        text("part_number"),
        text("serial_number"),
        Field::new("as_of_utc", row_output::utc(), true),
        text("target"),
        real("target_m"),
        real("used_share"),
        real("true_hours"),
        real("hours_p05"),
        real("hours_p50"),
        real("hours_p95"),
        real("relative_error"),
        text("interval"),
    ]))
}
