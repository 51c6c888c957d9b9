//! `backtest`: scores past forecasts against later measurements, by share of life used.

use pipeline::assess::backtest::{self, BacktestRow};
use pipeline::assess::trends;

use crate::args::{BacktestArgs, Global};
use crate::commands::context::load_trend_context;
use crate::table::{self, number, text};
use crate::{Code, Failure, Output, row_output};

const SHARES: [(f64, f64, &str); 4] = [
    (0.0, 0.35, "below 35 %"),
    (0.35, 0.65, "35 to 65 %"),
    (0.65, f64::INFINITY, "65 % and more"),
    (0.0, f64::INFINITY, "all"),
];

/// Prints a summary table, or one row per past forecast in the machine-readable formats.
pub(crate) fn backtest(args: &BacktestArgs, global: &Global, output: &Output) -> Result<Code, Failure> {
    let (config, installations) = load_trend_context(&args.external, global, output)?;
    let by_largest = config.parts_by_largest_gap();
    let histories = match &args.external.estimates {
        Some(file) => pipeline::fleet::external_estimates::read(file, &by_largest)?,
        None => trends::load_histories(&pipeline::open_store(&config, &installations)?, &by_largest)?,
    };
    let found = backtest::of_histories(&config, &installations, histories)?;
    row_output::write_rows(&args.rows, output, || row_output::batch(&found), || page(&found))?;
    Ok(Code::Success)
}

fn page(found: &[BacktestRow]) -> String {
    if found.is_empty() {
        return "no past forecast can be scored yet: needs a wearing unit with later data\n".to_owned();
    }
    let columns = [
        text("target", 0),
        text("life used", 0),
        number("forecasts", 0),
        number("median error [%]", 0),
        number("90 % interval coverage [%]", 0),
        number("late forecasts [%]", 1),
        number("early forecasts [%]", 1),
        number("within 20 % [%]", 1),
    ];
    let cells: Vec<Vec<String>> = [("limit", "the limit"), ("level", "the current level")]
        .into_iter()
        .flat_map(|(target, name)| SHARES.map(|share| line(found, target, name, share)))
        .flatten()
        .collect();
    table::layout(&columns, &cells)
}

/// One line of the summary; `None` if it has no forecast.
fn line(
    found: &[BacktestRow],
    target: &str,
    name: &str,
    (from, to, share): (f64, f64, &str),
) -> Option<Vec<String>> {
    let within = |p: &&BacktestRow| p.target == target && p.used_share >= from && p.used_share < to;
    let among: Vec<&BacktestRow> = found.iter().filter(within).collect();
    let errors: Vec<f64> = among.iter().map(|p| p.relative_error).collect();
    let near = errors.iter().filter(|error| **error <= 0.2).count();
    let median = trend::quantity::median(errors)?;
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
        per_cent(near),
    ])
}
