//! `trend`: current gap, wear rate, time to limit and state of each unit.

use std::cmp::Ordering;

use job::Config;
use pipeline::assess::trends::{self, StoreAssessment, UnitSelection};
use pipeline::findings::monitoring::mapping_faults::MappingFault;
use records::uncertainty::NORMAL_95;
use records::{Installations, Quantity, QuantityChange, QuantityRow, TrendRow};

use crate::args::{Global, TrendArgs};
use crate::exit::{Code, Failure};
use crate::output::{Output, escape};
use crate::row_output;
use crate::sparkline::sparkline;
use crate::table::{self, count, number, state_mark, text};

use crate::commands::context::{KnownNames, load_trend_context, note_future, selection};

/// Prints one row per unit, or per query.
///
/// # Errors
/// If configuration, tables or store cannot be read.
pub(crate) fn trend(args: &TrendArgs, global: &Global, output: &Output) -> Result<Code, Failure> {
    note_future(args.as_of, output);
    let (config, installations) = load_trend_context(&args.external, global, output)?;
    let ask = args.units.selection(args.as_of);
    if args.quantities || args.changes {
        return quantities(args, &ask, &config, &installations, output);
    }
    let (mut mapping_faults, mut notes) = (Vec::new(), Vec::new());
    let found = match (&args.external.estimates, &args.queries) {
        (None, None) => {
            let store = pipeline::open_store(&config, &installations)?;
            let found = trends::assess_store_with_quantities(&config, &installations, &store, &ask)?;
            (mapping_faults, notes) = (found.mapping_faults, found.notes);
            found.now
        }
        (estimates, queries) => {
            let histories = match estimates {
                Some(file) => pipeline::fleet::external_estimates::read(file)?,
                None => trends::load_histories(&pipeline::open_store(&config, &installations)?)?,
            };
            match queries {
                Some(file) => {
                    let queries = pipeline::fleet::external_estimates::queries(file)?;
                    trends::assess_queries(&config, &installations, histories, &queries)?
                }
                None => {
                    let found = trends::assess_histories(&config, &installations, histories, &ask)?;
                    notes = pipeline::findings::monitoring::coverage::notes(&found, &config);
                    found
                }
            }
        }
    };
    let mut nothing = None;
    if found.is_empty() && args.queries.is_none() {
        let known = match &args.external.estimates {
            Some(file) => {
                KnownNames::new(pipeline::fleet::external_estimates::read(file)?, Installations::default())
            }
            None => KnownNames::read(&config),
        };
        known.check_units(&args.units)?;
        nothing = Some(format!("no unit{} has flown; {}\n", selection(&ask), known.searched()));
    }
    row_output::write_rows(
        &args.rows,
        output,
        || row_output::batch(&found),
        || page(&found, &mapping_faults, &notes, nothing),
    )?;
    Ok(Code::Success)
}

/// Reason of the state, with the states of the other followed quantities.
fn reason_and_conditions(row: &TrendRow) -> String {
    let conditions = row.conditions.iter().map(|state| state.replace('_', " "));
    row.reason.iter().cloned().chain(conditions).collect::<Vec<_>>().join("; ")
}

/// Prints the followed quantities of the units, or what changed.
fn quantities(
    args: &TrendArgs,
    ask: &UnitSelection,
    config: &Config,
    installations: &Installations,
    output: &Output,
) -> Result<Code, Failure> {
    let store = pipeline::open_store(config, installations)?;
    let StoreAssessment { now: units, followed, .. } =
        trends::assess_store_with_quantities(config, installations, &store, ask)?;
    if units.is_empty() {
        let known = KnownNames::read(config);
        known.check_units(&args.units)?;
    }
    if args.changes {
        let page = || changes_page(&followed.changes, units.len());
        row_output::write_rows(&args.rows, output, || row_output::batch(&followed.changes), page)?;
    } else {
        let page = || quantities_page(&followed.rows);
        row_output::write_rows(&args.rows, output, || row_output::batch(&followed.rows), page)?;
    }
    Ok(Code::Success)
}

fn quantities_page(rows: &[QuantityRow]) -> String {
    let columns = [
        text("part / serial", 0),
        text("quantity", 0),
        number("flights", 5),
        number("level", 0),
        number("SE", 2),
        text("unit", 1),
        number("change", 1),
        number("limit", 4),
        number("per 1000 FH", 3),
        number("steps", 6),
        text("state", 0),
    ];
    let cells = |row: &QuantityRow| {
        let quantity = Quantity::from_name(row.quantity);
        let (unit, factor) = quantity.map_or(("", 1.0), Quantity::display_unit);
        let value = |value: Option<f64>, sign: bool| {
            value.map_or_else(table::empty_cell, |v| significant(v * factor, sign))
        };
        vec![
            format!("{} / {}", row.part_number.as_deref().unwrap_or("–"), row.serial_number),
            quantity.map_or(row.quantity, Quantity::label).to_owned(),
            row.flights.to_string(),
            value(row.level, false),
            value(row.level_se, false),
            unit.to_owned(),
            value(row.change, true),
            value(row.change_limit, false),
            value(row.rate_per_hour.map(|rate| rate * 1000.0), true),
            row.steps.len().to_string(),
            row.state.unwrap_or_default().replace('_', " "),
        ]
    };
    if rows.is_empty() {
        return "no unit was selected\n".to_owned();
    }
    table::layout(&columns, &rows.iter().map(cells).collect::<Vec<_>>())
}

/// A number with three significant digits.
fn significant(value: f64, sign: bool) -> String {
    let magnitude = if value == 0.0 { 0 } else { value.abs().log10().floor() as i32 };
    let places = (2 - magnitude).clamp(0, 4) as usize;
    if sign && value != 0.0 { format!("{value:+.places$}") } else { format!("{value:.places$}") }
}

fn changes_page(changes: &[QuantityChange], units: usize) -> String {
    if changes.is_empty() {
        return format!("nothing but the gap changed on {}\n", count(units, "unit"));
    }
    let columns = [
        text("since", 0),
        text("scope", 0),
        text("part / serial or tail", 0),
        text("position", 3),
        text("state", 2),
        text("evidence", 0),
    ];
    let cells = |change: &QuantityChange| {
        let part = change.part_number.as_deref();
        let name = match (&change.serial_number, &change.tail_number) {
            (Some(serial), _) => format!("{} / {serial}", part.unwrap_or("–")),
            (None, Some(tail)) => tail.clone(),
            (None, None) => part.unwrap_or("–").to_owned(),
        };
        vec![
            change.since_utc.strftime("%Y-%m-%d").to_string(),
            change.scope.to_owned(),
            name,
            change.positions.join(", "),
            change.state.unwrap_or_default().replace('_', " "),
            change.evidence.clone(),
        ]
    };
    table::layout(&columns, &changes.iter().map(cells).collect::<Vec<_>>())
}

fn page(
    found: &[TrendRow],
    mapping_faults: &[MappingFault],
    notes: &[String],
    nothing: Option<String>,
) -> String {
    let Some(as_of) = found.iter().map(|r| r.as_of_utc).max() else {
        return nothing.unwrap_or_else(|| "no unit was queried\n".to_owned());
    };
    let as_of = as_of.strftime("%Y-%m-%d %H:%M UTC");
    let head = format!("{} as of {as_of}; ± is half the 90 % interval\n", count(found.len(), "unit"));
    let faults = mapping_faults.iter().map(|fault| format!("mapping  {}\n", escape(&fault.to_string())));
    let notes = notes.iter().map(|note| format!("note     {}\n", escape(note)));
    head + &unit_table(found.iter().collect()) + &faults.chain(notes).collect::<String>()
}

/// Units by urgency, with action and date.
pub(crate) fn unit_table(mut units: Vec<&TrendRow>) -> String {
    units.sort_by(|a, b| a.urgency().partial_cmp(&b.urgency()).unwrap_or(Ordering::Equal));
    let columns = [
        text("state", 0),
        text("tail", 0),
        text("position", 0),
        text("part / serial", 1),
        number("gap [µm]", 0),
        number("records", 8),
        number("latest [µm]", 9),
        number("limit [µm]", 3),
        text("action", 4),
        text("due by", 0),
        text("history", 2),
        number("rate [nm/FH]", 5),
        text("trend", 7),
        number("5 % [FH]", 6),
        number("median [FH]", 8),
        number("95 % [FH]", 9),
        number("flights", 10),
        text("reason", 0),
    ];
    let cells = |r: &&TrendRow| {
        vec![
            state_mark(r.state),
            r.tail_number.clone().unwrap_or_else(table::empty_cell),
            r.position.clone().unwrap_or_else(table::empty_cell),
            format!("{} / {}", r.part_number.as_deref().unwrap_or("–"), r.serial_number),
            table::gap(r.gap_m, r.gap_se_m.map(|se_m| NORMAL_95 * se_m)),
            r.gap_records.map_or_else(table::empty_cell, |n| n.to_string()),
            table::micrometres(r.latest_gap_m),
            table::micrometres(r.limit_m),
            r.action.map_or_else(table::empty_cell, |action| action.replace('_', " ")),
            r.due_text().unwrap_or_else(table::empty_cell),
            sparkline(&r.sketch_m.0, r.limit_m),
            r.rate_m_per_hour.map_or_else(table::empty_cell, |v| format!("{:.1}", v * 1e9)),
            r.trend.to_owned(),
            table::hours(r.crossing_hours_p05),
            table::hours(r.crossing_hours_p50),
            table::hours(r.crossing_hours_p95),
            r.flights.to_string(),
            reason_and_conditions(r),
        ]
    };
    table::layout(&columns, &units.iter().map(cells).collect::<Vec<_>>())
}
