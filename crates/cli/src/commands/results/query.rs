//! `query`: lists stored records by tail, serial, flight or position.

use std::collections::BTreeSet;

use arrow::array::{RecordBatch, StringArray};
use ingest::mapping::column_pattern::nearest;
use job::Config;
use pipeline::assess::trends::{self, UnitSelection};
use pipeline::inspect::explain::remedy;
use records::row_schema::to_batch;
use records::{GapEstimate, GapRecord, Installations};
use store::{Query, Store};

use crate::args::{Format, Global, QueryArgs};
use crate::commands::context::{KnownNames, called, check_range, load_with_installations};
use crate::commands::results::trend;
use crate::completion::QUERY_KEYS;
use crate::table::{self, count, number, text};
use crate::{Code, Failure, Output, row_output};

/// Prints the matching records, oldest first.
pub(crate) fn query(args: &QueryArgs, global: &Global, output: &Output) -> Result<Code, Failure> {
    check_range(args.departures.since, args.departures.until)?;
    let (config, installations) = load_with_installations(global)?;
    let known = KnownNames::of(&config);
    let query = query_of(args, &known)?;
    let store = pipeline::open_store(&config, &installations)?;
    let records = store.records(&query)?;
    if records.is_empty() {
        for (column, name) in selected(&query).into_iter().chain([("part_number", &query.part_number)]) {
            known.check(&[column], name.as_deref())?;
        }
    }
    let verdict = match args.rows.format() {
        Format::Table => verdict(&query, &config, &installations, &store)?,
        _ => String::new(),
    };
    row_output::write_rows(&args.rows, output, || with_remedies(&records), || verdict + &page(&records))?;
    if records.is_empty() {
        let names = selected(&query).into_iter().filter_map(|(column, name)| Some((column, name.as_ref()?)));
        let names: Vec<String> = names.map(|(column, name)| format!("{} `{name}`", called(column))).collect();
        let of = if names.is_empty() { String::new() } else { format!(" of {}", names.join(", ")) };
        output.note(&format!(
            "no record{of}{}; list all units of the store with `freeplay trend --all`",
            restrictions(args)
        ));
    }
    Ok(Code::Success)
}

/// What is due on the selected tail or unit, and what limits the trust in it; nothing for other selections.
fn verdict(
    query: &Query,
    config: &Config,
    installations: &Installations,
    store: &Store,
) -> Result<String, Failure> {
    const MAX_RANK: u8 = 1;
    if query.tail_number.is_none() && query.serial_number.is_none() {
        return Ok(String::new());
    }
    let ask = UnitSelection {
        tail_number: query.tail_number.clone(),
        serial_number: query.serial_number.clone(),
        part_number: query.part_number.clone(),
        as_of_utc: None,
    };
    let found = trends::assess_store(config, installations, store, &ask)?;
    let is_one_unit = query.serial_number.is_some();
    Ok(if found.now.is_empty() { String::new() } else { trend::page(&found, is_one_unit, MAX_RANK) + "\n" })
}

fn restrictions(args: &QueryArgs) -> String {
    let part = args.part.as_ref().map(|part| format!(" with part number {part}"));
    let since = args.departures.since.map(|since| format!(" from {since}"));
    let until = args.departures.until.map(|until| format!(" before {until}"));
    [part, since, until].into_iter().flatten().collect()
}

fn selected(query: &Query) -> [(&'static str, &Option<String>); 4] {
    [
        ("tail_number", &query.tail_number),
        ("serial_number", &query.serial_number),
        ("flight_id", &query.flight_id),
        ("position", &query.position),
    ]
}

/// The selection by options, by a word and a name, or by the name alone of a tail, serial number, flight or position.
fn query_of(args: &QueryArgs, known: &KnownNames) -> Result<Query, Failure> {
    let mut query = Query {
        tail_number: args.tail.clone(),
        serial_number: args.serial.clone(),
        flight_id: args.flight.clone(),
        position: args.position.clone(),
        part_number: args.part.clone(),
        run_id: None,
        since_utc: args.departures.since,
        until_utc: args.departures.until,
        last: args.last,
    };
    let (column, id) = match (args.first.as_deref(), args.second.clone()) {
        (None, _) => return Ok(query),
        (Some(word), Some(id)) => {
            let key = QUERY_KEYS.iter().find(|(known, _)| *known == word);
            (key.ok_or_else(|| unknown_word(word))?.1, id)
        }
        (Some(id), None) => {
            let columns = QUERY_KEYS.map(|(_, column)| column);
            known.check(&columns, Some(id))?;
            let column = columns.into_iter().find(|column| known.names(column).contains(id));
            (column.unwrap_or("position"), id.to_owned())
        }
    };
    let field = match column {
        "tail_number" => &mut query.tail_number,
        "serial_number" => &mut query.serial_number,
        "flight_id" => &mut query.flight_id,
        _ => &mut query.position,
    };
    *field = Some(id);
    Ok(query)
}

fn unknown_word(word: &str) -> Failure {
    let words = QUERY_KEYS.map(|(word, _)| word);
    let near = nearest(word, words).map(|near| format!("; the nearest is '{near}'")).unwrap_or_default();
    let what = format!("records cannot be selected by `{word}`{near}");
    let hint = format!("possible are {}, e.g. `freeplay query tail N412FP`", words.join(", "));
    Failure::usage("unknown_name", what, &hint)
}

pub(crate) fn page(records: &[GapRecord]) -> String {
    let half_width_m = |e: &GapEstimate| e.gap_p05_m.zip(e.gap_p95_m).map(|(low, high)| 0.5 * (high - low));
    let columns: &table::Columns<'_, GapRecord> = &[
        (text("departure [UTC]", 0), &|r| r.flight.departure_utc.strftime("%Y-%m-%d %H:%M").to_string()),
        (text("tail", 3), &|r| r.flight.tail_number.to_string()),
        (text("flight", 4), &|r| r.flight.flight_id.to_string()),
        (text("position", 1), &|r| r.position.to_string()),
        (text("serial", 0), &|r| r.serial_number.to_string()),
        (number("gap ± 90 % [µm]", 0), &|r| table::gap(r.estimate.gap_m, half_width_m(&r.estimate))),
        (text("part", 5), &|r| r.part_number.to_string()),
        (number("mid-range [µm]", 6), &|r| table::micrometres(r.estimate.gap_midrange_m)),
        (number("load reversals", 8), &|r| r.estimate.load_reversals.to_string()),
        (number("load [N]", 7), &|r| load(&r.estimate)),
        (text("flags", 0), &|r| flags_text(&r.estimate)),
    ];
    count(records.len(), "record") + "\n" + &table::of(records, columns) + &remedies(records)
}

/// One line per rejection code of these records, with its remedy.
fn remedies(records: &[GapRecord]) -> String {
    let line = |e: &GapEstimate| Some(format!("{}: {}\n", e.reason.as_deref()?, remedy(e)?));
    let lines: BTreeSet<String> = records.iter().filter_map(|r| line(&r.estimate)).collect();
    let above = if lines.is_empty() { "" } else { "\n" };
    lines.iter().fold(above.to_owned(), |text, line| text + line)
}

/// The rows with the remedy of each rejection as last column.
fn with_remedies(records: &[GapRecord]) -> Result<RecordBatch, Failure> {
    let remedies: StringArray = records.iter().map(|r| remedy(&r.estimate)).collect();
    let (batch, schema) = (to_batch(records).map_err(store::Error::from)?, GapRecord::schema());
    let names = schema.fields().iter().map(|field| field.name().as_str());
    row_output::columns(&batch, &names.chain(["remedy"]).collect::<Vec<_>>(), &[("remedy", remedies)])
}

pub(crate) fn load(e: &GapEstimate) -> String {
    e.load_p05_n.zip(e.load_p95_n).map_or_else(table::empty_cell, |(low, high)| format!("{low:.0}…{high:.0}"))
}

pub(crate) fn flags_text(e: &GapEstimate) -> String {
    let reason = e.reason.iter().map(|reason| match e.status {
        records::Status::Refused => format!("refused: {reason}"),
        records::Status::Estimated | records::Status::Withdrawn => reason.clone(),
    });
    let others = e.flags.iter().filter(|flag| Some(*flag) != e.reason.as_ref()).cloned();
    reason.chain(others).collect::<Vec<_>>().join(", ")
}
