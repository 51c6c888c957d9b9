//! `trend`: current gap, wear rate, time to limit and state of each unit.

use pipeline::fleet_trends::assess::{self, UnitSelection};
use records::Installations;
use records::TrendRow;
use store::Store;

use crate::args::{Global, TrendArgs};
use crate::exit::{Code, Failure};
use crate::output::Output;
use crate::row_output;
use crate::sparkline::sparkline;
use crate::table::{self, count, number, state_mark, text};

use crate::commands::context::{KnownNames, load_trend_context, selection};

/// Prints one row per unit, or per query.
///
/// # Errors
/// If configuration, tables or store cannot be read.
pub(crate) fn trend(args: &TrendArgs, global: &Global, output: &Output) -> Result<Code, Failure> {
    let (config, installations) = load_trend_context(&args.external, global, output)?;
    let ask = UnitSelection {
        tail_number: args.tail.clone(),
        serial_number: args.serial.clone(),
        part_number: args.part.clone(),
        as_of_utc: args.as_of,
        statistics: args.statistics,
    };
    let found = match (&args.external.estimates, &args.queries) {
        (None, None) => assess::assess_store(&config, &installations, &Store::open(config.store())?, &ask)?,
        (estimates, queries) => {
            let histories = match estimates {
                Some(file) => pipeline::history::external_estimates::read(file)?,
                None => assess::load_histories(&Store::open(config.store())?)?,
            };
            match queries {
                Some(file) => {
                    let queries = pipeline::history::external_estimates::queries(file)?;
                    assess::assess_queries(&config, &installations, histories, &queries, args.statistics)?
                }
                None => assess::assess_histories(&config, &installations, histories, &ask)?,
            }
        }
    };
    let mut nothing = None;
    if found.is_empty() && args.queries.is_none() {
        let known = match &args.external.estimates {
            Some(file) => {
                KnownNames::new(pipeline::history::external_estimates::read(file)?, Installations::default())
            }
            None => KnownNames::read(&config),
        };
        known.check_units(args.tail.as_deref(), args.serial.as_deref(), args.part.as_deref())?;
        nothing = Some(format!("no unit{} has flown; {}\n", selection(&ask), known.searched()));
    }
    row_output::write_rows(&args.rows, output, || row_output::batch(&found), || page(&found, nothing))?;
    Ok(Code::Success)
}

fn page(found: &[TrendRow], nothing: Option<String>) -> String {
    let columns = [
        text("state", 0),
        text("part / serial", 0),
        text("tail", 2),
        text("position", 4),
        number("flights", 6),
        number("gap [µm]", 0),
        number("SE [µm]", 3),
        text("history", 2),
        number("rate [nm/FH]", 1),
        text("trend", 4),
        number("limit [µm]", 5),
        number("earliest 5 % [FH]", 1),
        text("earliest date", 2),
        number("median [FH]", 4),
        number("latest 95 % [FH]", 6),
        text("reason", 7),
    ];
    let cells = |r: &TrendRow| {
        vec![
            state_mark(r.state),
            format!("{} / {}", r.part_number.as_deref().unwrap_or("–"), r.serial_number),
            r.tail_number.clone().unwrap_or_else(table::empty_cell),
            r.position.clone().unwrap_or_else(table::empty_cell),
            r.flights.to_string(),
            table::micrometres(r.gap_m),
            table::micrometres(r.gap_se_m),
            sparkline(&r.sketch_m.0),
            r.rate_m_per_hour.map_or_else(table::empty_cell, |v| format!("{:.1}", v * 1e9)),
            r.trend.to_owned(),
            table::micrometres(r.limit_m),
            table::hours(r.crossing_hours_p05),
            r.not_before_utc.map_or_else(table::empty_cell, |day| day.strftime("%Y-%m-%d").to_string()),
            table::hours(r.crossing_hours_p50),
            table::hours(r.crossing_hours_p95),
            r.reason.clone().unwrap_or_default(),
        ]
    };
    let Some(as_of) = found.iter().map(|r| r.as_of_utc).max() else {
        return nothing.unwrap_or_else(|| "no unit was queried\n".to_owned());
    };
    let head = format!("{} as of {}\n", count(found.len(), "unit"), as_of.strftime("%Y-%m-%d %H:%M UTC"));
    head + &table::layout(&columns, &found.iter().map(cells).collect::<Vec<_>>())
}
