//! `query`: lists stored records by tail, serial, flight or position.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use arrow::array::{RecordBatch, StringArray};
use arrow::datatypes::{DataType, Field, Schema};
use job::Config;
use pipeline::explain::remedy;
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
    let records = pipeline::open_store(&config, &installations)?.records(&query_of(args))?;
    if records.is_empty() {
        check_names(args, &KnownNames::read(&config))?;
    }
    row_output::write_rows(
        &args.rows,
        output,
        || with_remedies(to_batch(&records).map_err(store::Error::from)?, &records),
        || page(&records, &config),
    )?;
    if records.is_empty() {
        output.note(&format!(
            "no record of {} `{}`{}; list the store's contents with `freeplay store info`",
            word(args.by),
            args.id,
            range(args)
        ));
    }
    Ok(Code::Success)
}

/// Refuses an unknown name of the selection.
fn check_names(args: &QueryArgs, known: &KnownNames) -> Result<(), Failure> {
    let id = Some(args.id.as_str());
    match args.by {
        QueryKey::Tail => check_name("tail", id, known.tails())?,
        QueryKey::Serial => check_name("serial number", id, known.serials())?,
        QueryKey::Flight => check_name("flight", id, known.flights())?,
        QueryKey::Position => check_name("position", id, known.positions())?,
    }
    check_name("part number", args.part.as_deref(), known.parts())
}

/// The searched range as text.
fn range(args: &QueryArgs) -> String {
    let part = args.part.as_ref().map(|part| format!(" with part number {part}"));
    let since = args.departures.since.map(|since| format!(" from {since}"));
    let until = args.departures.until.map(|until| format!(" before {until}"));
    [part, since, until].into_iter().flatten().collect()
}

fn word(by: QueryKey) -> &'static str {
    match by {
        QueryKey::Tail => "tail",
        QueryKey::Serial => "serial",
        QueryKey::Flight => "flight",
        QueryKey::Position => "position",
    }
}

fn query_of(args: &QueryArgs) -> Query {
    let id = |by: QueryKey| (args.by == by).then(|| args.id.clone());
    Query {
        tail_number: id(QueryKey::Tail),
        serial_number: id(QueryKey::Serial),
        flight_id: id(QueryKey::Flight),
        position: id(QueryKey::Position),
        part_number: args.part.clone(),
        run_id: None,
        since_utc: args.departures.since,
        until_utc: args.departures.until,
        last: args.last,
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
