//! `trend`: current gap, wear rate, time to limit and state of each unit.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::Path;

use ingest::tables::TableBatch;
use job::Config;
use pipeline::State;
use pipeline::assess::trends::{self, StoreAssessment, UnitSelection};
use pipeline::fleet::external_estimates;
use records::uncertainty::NORMAL_95;
use records::{Installations, Quantity, QuantityChange, QuantityRow, TrendRow, significant};

use crate::args::{Global, TrendArgs};
use crate::commands::context::{KnownNames, load_trend_context, note_future};
use crate::sparkline::{SCALE, sparkline};
use crate::table::{self, Column, count, number, or_dash, state_mark, text, unit_name};
use crate::{Code, Failure, Output, row_output};

pub(crate) fn trend(args: &TrendArgs, global: &Global, output: &Output) -> Result<Code, Failure> {
    note_future(args.as_of, output);
    let (config, installations) = load_trend_context(&args.external, global, output)?;
    let ask = args.units.selection(args.as_of);
    if args.quantities || args.changes {
        return quantities(args, &ask, &config, &installations, output);
    }
    let read = |file: &Path| external_estimates::read(file, &config.parts_by_largest_gap());
    let histories = args.external.estimates.as_deref().map(read).transpose()?;
    let queries = args.queries.as_deref().map(|file| external_estimates::queries(&TableBatch::read(file)?));
    let queries = queries.transpose()?;
    let found = trends::assess(&config, &installations, histories, queries.as_deref(), &ask)?;
    let mut nothing = "no unit was queried\n".to_owned();
    if found.now.is_empty() && args.queries.is_none() {
        let known = match &args.external.estimates {
            Some(file) => KnownNames::Estimates(file.clone(), read(file)?),
            None => KnownNames::of(&config),
        };
        known.check_units(&args.units)?;
        nothing = known.why_nothing(&ask) + "\n";
    }
    let shows_all = args.all || args.queries.is_some() || args.units.serial.is_some();
    row_output::write_rows(
        &args.rows,
        output,
        || row_output::batch(&found.now),
        || if found.now.is_empty() { nothing } else { page(&found, shows_all, u8::MAX) },
    )?;
    Ok(Code::Success)
}

fn quantities(
    args: &TrendArgs,
    ask: &UnitSelection,
    config: &Config,
    installations: &Installations,
    output: &Output,
) -> Result<Code, Failure> {
    let store = pipeline::open_store(config, installations)?;
    let StoreAssessment { now: units, followed, .. } =
        trends::assess_store(config, installations, &store, ask)?;
    if units.is_empty() {
        let known = KnownNames::of(config);
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
    if rows.is_empty() {
        return "no unit was selected\n".to_owned();
    }
    let quantity = |row: &QuantityRow| row.quantity.parse::<Quantity>().ok();
    let unit = |row: &QuantityRow| quantity(row).map_or(("", 1.0), Quantity::display_unit);
    let value = |row: &QuantityRow, value: Option<f64>, sign: bool| {
        let value = value.map(|value| value * unit(row).1);
        let plus = if sign && value.is_some_and(|value| value > 0.0) { "+" } else { "" };
        value.map_or_else(table::empty_cell, |value| format!("{plus}{}", significant(value)))
    };
    let columns: &table::Columns<'_, QuantityRow> = &[
        (text("part / serial", 0), &|r| unit_name(r.part_number.as_deref(), &r.serial_number)),
        (text("quantity", 0), &|r| quantity(r).map_or(r.quantity, Quantity::label).to_owned()),
        (number("flights", 5), &|r| r.flights.to_string()),
        (number("level", 0), &|r| value(r, r.level, false)),
        (number("SE", 2), &|r| value(r, r.level_se, false)),
        (text("unit", 1), &|r| unit(r).0.to_owned()),
        (number("change", 1), &|r| value(r, r.change, true)),
        (number("limit", 4), &|r| value(r, r.change_limit, false)),
        (number("per 1000 FH", 3), &|r| value(r, r.rate_per_hour.map(|rate| rate * 1000.0), true)),
        (number("steps", 6), &|r| r.steps.len().to_string()),
        (text("state", 0), &|r| r.state.unwrap_or_default().replace('_', " ")),
    ];
    table::of(rows, columns)
}

fn changes_page(changes: &[QuantityChange], units: usize) -> String {
    if changes.is_empty() {
        return format!("no quantity other than the gap changed on {}\n", count(units, "unit"));
    }
    let name = |change: &QuantityChange| match (&change.serial_number, &change.tail_number) {
        (Some(serial), _) => unit_name(change.part_number.as_deref(), serial),
        (None, Some(tail)) => tail.clone(),
        (None, None) => or_dash(change.part_number.as_deref()),
    };
    let columns: &table::Columns<'_, QuantityChange> = &[
        (text("since", 0), &|c| c.since_utc.strftime("%Y-%m-%d").to_string()),
        (text("scope", 0), &|c| c.scope.to_owned()),
        (text("part / serial or tail", 0), &name),
        (text("position", 3), &|c| c.positions.join(", ")),
        (text("state", 2), &|c| c.state.unwrap_or_default().replace('_', " ")),
        (text("evidence", 0), &|c| c.evidence.clone()),
    ];
    table::of(changes, columns)
}

/// The units of an assessment with what limits the trust in it; normal units are only counted unless `shows_all`.
pub(crate) fn page(found: &StoreAssessment, shows_all: bool, max_rank: u8) -> String {
    let dates: BTreeSet<_> = found.now.iter().map(|row| row.as_of_utc).collect();
    let as_of = match (dates.first(), dates.len()) {
        (Some(date), 1) => date.strftime("%Y-%m-%d %H:%M UTC").to_string(),
        _ => "the date of each query".to_owned(),
    };
    let mut page = format!("{} as of {as_of}: {}\n", count(found.now.len(), "unit"), by_state(&found.now));
    let faults = found.mapping_faults.iter().map(ToString::to_string);
    for note in faults.chain(found.notes.iter().cloned()) {
        page.push_str(&table::labelled("! ", &note));
    }
    let (shown, folded): (Vec<&TrendRow>, Vec<&TrendRow>) =
        found.now.iter().partition(|row| shows_all || needs_attention(row));
    page.push_str(&unit_table(shown, max_rank));
    if !folded.is_empty() {
        let _ = writeln!(page, "not shown: {}; all with `freeplay trend --all`", by_state(folded));
    }
    page
}

/// Whether a unit asks for something: it is neither normal without a finding nor removed.
fn needs_attention(row: &TrendRow) -> bool {
    row.action.is_some() || row.state.is_some_and(|state| state != State::Normal.as_str())
}

/// Numbers of units by state, most urgent first, and how many normal ones have a caveat.
pub(crate) fn by_state<'r>(rows: impl IntoIterator<Item = &'r TrendRow>) -> String {
    let mut states = BTreeMap::<_, usize>::new();
    let mut with_caveats = 0;
    for row in rows {
        let state = row.state.and_then(|word| word.parse::<State>().ok());
        *states.entry(state).or_default() += 1;
        with_caveats += usize::from(state == Some(State::Normal) && !row.caveats.0.is_empty());
    }
    let of_state = |(state, n): (&Option<State>, &usize)| match state {
        Some(State::Normal) if with_caveats > 0 => format!("{n} normal ({with_caveats} with caveats)"),
        state => format!("{n} {}", state.map_or("removed", State::as_str)),
    };
    states.iter().rev().map(of_state).collect::<Vec<_>>().join(", ")
}

/// Heading of the dates of assessments, shown where they differ.
const AS_OF: &str = "as of";

/// Units by urgency, with date, reason and certainty; without the columns above a rank.
pub(crate) fn unit_table(mut units: Vec<&TrendRow>, max_rank: u8) -> String {
    units.sort_by(|a, b| a.by_urgency(b));
    let or_dash_number = |value: Option<f64>, factor: f64| {
        value.map_or_else(table::empty_cell, |value| format!("{:.1}", value * factor))
    };
    let columns: &table::Columns<'_, TrendRow> = &[
        (text(AS_OF, 0), &|r| r.as_of_utc.strftime("%Y-%m-%d").to_string()),
        (text("state", 0), &|r| state_mark(r.state)),
        (text("due", 0), &|r| or_dash(r.due_text().as_deref())),
        (text("tail", 0), &|r| or_dash(r.tail_number.as_deref())),
        (text("position", 0), &|r| or_dash(r.position.as_deref())),
        (text("serial", 0), &|r| r.serial_number.clone()),
        (number("gap ± 90 % [µm]", 2), &|r| table::gap(r.gap_m, r.gap_se_m.map(|se_m| NORMAL_95 * se_m))),
        (text("part", 3), &|r| or_dash(r.part_number.as_deref())),
        (text(SCALE, 1), &|r| sparkline(&r.sketch_m.0, r.limit_m)),
        (text("action", 4), &|r| or_dash(r.action.map(|action| action.replace('_', " ")).as_deref())),
        (number("limit [µm]", 5), &|r| table::micrometres(r.limit_m)),
        (number("rate [nm/FH]", 6), &|r| or_dash_number(r.rate_m_per_hour, 1e9)),
        (number("5 % [FH]", 7), &|r| table::hours(r.crossing_hours_p05)),
        (number("50 % [FH]", 8), &|r| table::hours(r.crossing_hours_p50)),
        (number("95 % [FH]", 8), &|r| table::hours(r.crossing_hours_p95)),
        (number("flights", 9), &|r| r.flights.to_string()),
        (text("why, and how sure", 0), &|r| r.statement_text()),
    ];
    let is_of_one_date = units.iter().all(|row| row.as_of_utc == units[0].as_of_utc);
    let is_kept = |column: &Column| column.rank <= max_rank && !(is_of_one_date && column.heading == AS_OF);
    let kept: Vec<_> = columns.iter().copied().filter(|(column, _)| is_kept(column)).collect();
    table::of(units, &kept)
}
