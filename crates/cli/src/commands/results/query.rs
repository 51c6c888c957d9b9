//! `query`: lists stored records by tail, serial, flight or position.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use arrow::array::{RecordBatch, StringArray};
use arrow::datatypes::{DataType, Field, Schema};
use clap::ValueEnum;
use ingest::mapping::column_pattern::nearest;
use job::Config;
use pipeline::inspect::explain::remedy;
use records::row_schema::to_batch;
use records::{GapRecord, PartNumber};
use store::Query;

use crate::args::{Global, QueryArgs, QueryKey};
use crate::exit::{Code, Failure};
use crate::output::Output;
use crate::row_output;
use crate::sparkline::sparkline;
use crate::table::{self, count, number, text};

use crate::commands::context::{KnownNames, check_name, check_range, load_with_installations};

/// Minimum number of estimates for a history line.
const LEAST_HISTORY: usize = 3;

/// Prints the matching records, oldest first.
///
/// # Errors
/// If configuration or store cannot be read.
pub(crate) fn query(args: &QueryArgs, global: &Global, output: &Output) -> Result<Code, Failure> {
    check_range(args.departures.since, args.departures.until)?;
    let (config, installations) = load_with_installations(global)?;
    let query = query_of(args, &config)?;
    let records = pipeline::open_store(&config, &installations)?.records(&query)?;
    if records.is_empty() {
        check_names(&query, &KnownNames::read(&config))?;
    }
    row_output::write_rows(
        &args.rows,
        output,
        || with_remedies(to_batch(&records).map_err(store::Error::from)?, &records),
        || page(&records, &config),
    )?;
    if records.is_empty() {
        output.note(&format!(
            "no record of {}{}; list the store's contents with `freeplay store info`",
            selected(&query),
            range(args)
        ));
    }
    Ok(Code::Success)
}

/// Refuses an unknown name of the selection.
fn check_names(query: &Query, known: &KnownNames) -> Result<(), Failure> {
    check_name("tail", query.tail_number.as_deref(), known.tails())?;
    check_name("serial number", query.serial_number.as_deref(), known.serials())?;
    check_name("flight", query.flight_id.as_deref(), known.flights())?;
    check_name("position", query.position.as_deref(), known.positions())?;
    check_name("part number", query.part_number.as_deref(), known.parts())
}

/// The searched range as text.
fn range(args: &QueryArgs) -> String {
    let part = args.part.as_ref().map(|part| format!(" with part number {part}"));
    let since = args.departures.since.map(|since| format!(" from {since}"));
    let until = args.departures.until.map(|until| format!(" before {until}"));
    [part, since, until].into_iter().flatten().collect()
}

/// The selected names as text.
fn selected(query: &Query) -> String {
    let names = [
        ("tail", &query.tail_number),
        ("serial", &query.serial_number),
        ("flight", &query.flight_id),
        ("position", &query.position),
    ];
    let names = names.iter().filter_map(|(word, name)| Some(format!("{word} `{}`", name.as_ref()?)));
    names.collect::<Vec<_>>().join(", ")
}

/// The selection: by options, by a word and a value, or by a value alone that a tail, serial number, flight or position has.
fn query_of(args: &QueryArgs, config: &Config) -> Result<Query, Failure> {
    let base = Query {
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
    let by = |by: QueryKey, id: &str| {
        let id = Some(id.to_owned());
        match by {
            QueryKey::Tail => Query { tail_number: id, ..base.clone() },
            QueryKey::Serial => Query { serial_number: id, ..base.clone() },
            QueryKey::Flight => Query { flight_id: id, ..base.clone() },
            QueryKey::Position => Query { position: id, ..base.clone() },
        }
    };
    match (args.first.as_deref(), args.second.as_deref()) {
        (None, _) => Ok(base),
        (Some(word), Some(id)) => match QueryKey::from_str(word, false) {
            Ok(key) => Ok(by(key, id)),
            Err(_) => {
                const WORDS: [&str; 4] = ["tail", "serial", "flight", "position"];
                let near =
                    nearest(word, WORDS).map(|near| format!("; the nearest is '{near}'")).unwrap_or_default();
                let what = format!("records cannot be selected by `{word}`{near}");
                let hint = format!("possible are {}, e.g. `freeplay query tail N412FP`", WORDS.join(", "));
                Err(Failure::usage("unknown_name", what, &hint))
            }
        },
        (Some(id), None) => {
            let known = KnownNames::read(config);
            let key = if known.tails().any(|name| name == id) {
                QueryKey::Tail
            } else if known.serials().any(|name| name == id) {
                QueryKey::Serial
            } else if known.flights().any(|name| name == id) {
                QueryKey::Flight
            } else {
                let positions =
                    known.tails().chain(known.serials()).chain(known.flights()).chain(known.positions());
                check_name("tail, serial number, flight or position", Some(id), positions)?;
                QueryKey::Position
            };
            Ok(by(key, id))
        }
    }
}

/// Records as a table.
pub(crate) fn page(records: &[GapRecord], config: &Config) -> String {
    let columns = [
        text("departure [UTC]", 0),
        text("tail", 3),
        text("flight", 2),
        text("position", 1),
        text("part / serial", 2),
        number("gap [µm]", 0),
        number("mid-range [µm]", 5),
        number("load reversals", 7),
        number("load [N]", 6),
        text("flags", 0),
    ];
    let cells = |r: &GapRecord| {
        let e = &r.estimate;
        vec![
            r.flight.departure_utc.strftime("%Y-%m-%d %H:%M").to_string(),
            r.flight.tail_number.to_string(),
            r.flight.flight_id.to_string(),
            r.position.to_string(),
            format!("{} / {}", r.part_number, r.serial_number),
            table::gap(e.gap_m, e.gap_p05_m.zip(e.gap_p95_m).map(|(low, high)| 0.5 * (high - low))),
            table::micrometres(e.gap_midrange_m),
            e.load_reversals.to_string(),
            load(e),
            flags_text(e),
        ]
    };
    let head = format!("{}\n", count(records.len(), "record"));
    if records.is_empty() {
        head
    } else {
        let head = format!("{}; ± is half the 90 % interval\n", count(records.len(), "record"));
        let table = table::layout(&columns, &records.iter().map(cells).collect::<Vec<_>>());
        head + &table + &remedies(records) + &sketches(records, config)
    }
}

/// One line per rejection code of these records, with its remedy.
fn remedies(records: &[GapRecord]) -> String {
    let codes: BTreeSet<&str> = records.iter().filter_map(|r| rejection_code(&r.estimate)).collect();
    let line = |code: &str| Some(format!("{code}: {}\n", job::rejection::remedy(code)?));
    let lines: String = codes.into_iter().filter_map(line).collect();
    if lines.is_empty() { lines } else { format!("\n{lines}") }
}

/// Rejection code of an estimate.
fn rejection_code(e: &records::GapEstimate) -> Option<&str> {
    e.reason.as_deref().filter(|_| e.status == records::Status::Refused)
}

/// The rows with the remedy of each rejection as last column.
fn with_remedies(batch: RecordBatch, records: &[GapRecord]) -> Result<RecordBatch, Failure> {
    let remedies: StringArray = records.iter().map(|r| remedy(&r.estimate)).collect();
    let (schema, mut columns, _) = batch.into_parts();
    let mut fields: Vec<_> = schema.fields().iter().cloned().collect();
    fields.push(Arc::new(Field::new("remedy", DataType::Utf8, true)));
    columns.push(Arc::new(remedies));
    let batch = RecordBatch::try_new(Arc::new(Schema::new(fields)), columns);
    batch.map_err(|e| Failure::from(std::io::Error::other(e)))
}

/// One line per unit with a history in these records: sparkline, first and last gap.
fn sketches(records: &[GapRecord], config: &Config) -> String {
    let mut units: BTreeMap<(&PartNumber, &str), Vec<f64>> = BTreeMap::new();
    for r in records {
        let key = (&r.part_number, r.serial_number.as_str());
        units.entry(key).or_default().extend(r.estimate.gap_m);
    }
    units.retain(|_, gaps_m| gaps_m.len() >= LEAST_HISTORY);
    let rows: Vec<Vec<String>> = units
        .iter()
        .map(|((part, serial), gaps_m)| {
            let ends = [gaps_m.first(), gaps_m.last()].map(|gap_m| table::micrometres(gap_m.copied()));
            let limit_m = config.limit_m(Some(part));
            vec![
                format!("{part} / {serial}"),
                sparkline(gaps_m, limit_m),
                ends.join(" → "),
                gaps_m.len().to_string(),
            ]
        })
        .collect();
    if rows.is_empty() {
        return String::new();
    }
    let columns = [text("part / serial", 0), text("history", 0), text("gap [µm]", 0), number("estimates", 0)];
    format!("\n{}", table::layout(&columns, &rows))
}

/// Load band of an estimate, N.
pub(crate) fn load(e: &records::GapEstimate) -> String {
    e.load_p05_n.zip(e.load_p95_n).map_or_else(table::empty_cell, |(low, high)| format!("{low:.0}…{high:.0}"))
}

/// Rejection reason or quality flags.
pub(crate) fn flags_text(e: &records::GapEstimate) -> String {
    let reason = e.reason.iter().map(|reason| match e.status {
        records::Status::Refused => format!("refused: {reason}"),
        records::Status::Estimated | records::Status::Withdrawn => reason.clone(),
    });
    let others = e.flags.iter().filter(|flag| Some(*flag) != e.reason.as_ref()).cloned();
    reason.chain(others).collect::<Vec<_>>().join(", ")
}
