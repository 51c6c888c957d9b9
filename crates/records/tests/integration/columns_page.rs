//! The tables of `docs/columns.md` are those of the row types. `FREEPLAY_BLESS=1` writes them.

use std::fmt::Write as _;
use std::path::Path;

use arrow::datatypes::DataType;
use records::report_rows::{
    ReportFlightRow, ReportGapRow, ReportInspectionRow, ReportLogErrorRow, ReportPastForecastRow,
    ReportRemovalsRow, ReportTailRow,
};
use records::row_schema::{self, Column, Row};
use records::{AlertRecord, GapRecord, QuantityChange, QuantityRow, TrendRow, WorkRequest};

#[test]
fn the_page_lists_every_column_with_its_type_and_meaning() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/columns.md");
    let page = std::fs::read_to_string(&file).unwrap();
    let (mut expected, mut former) = (page.clone(), Vec::new());
    for (name, table) in [
        ("records", table::<GapRecord>(&mut former)),
        ("trends", table::<TrendRow>(&mut former)),
        ("quantities", table::<QuantityRow>(&mut former)),
        ("changes", table::<QuantityChange>(&mut former)),
        ("work requests", table::<WorkRequest>(&mut former)),
        ("alerts", table::<AlertRecord>(&mut former)),
        ("report flights", table::<ReportFlightRow>(&mut former)),
        ("report gaps", table::<ReportGapRow>(&mut former)),
        ("report past forecasts", table::<ReportPastForecastRow>(&mut former)),
        ("report inspections", table::<ReportInspectionRow>(&mut former)),
        ("report removals", table::<ReportRemovalsRow>(&mut former)),
        ("report tails", table::<ReportTailRow>(&mut former)),
        ("report log errors", table::<ReportLogErrorRow>(&mut former)),
    ] {
        let (begin, end) = (format!("<!-- columns of {name} -->\n"), "<!-- end -->");
        let (before, rest) = expected.split_once(&begin).unwrap();
        let (_, after) = rest.split_once(end).unwrap();
        expected = format!("{before}{begin}\n{table}\n{end}{after}");
    }
    if std::env::var_os("FREEPLAY_BLESS").is_some() {
        std::fs::write(&file, &expected).unwrap();
    }
    assert_eq!(std::fs::read_to_string(&file).unwrap(), expected);
}

/// A row for each column; columns with one meaning share a row, and a standard error that of its column. Below the
/// table, the columns of a former table.
fn table<R: Row>(former: &mut Vec<Column>) -> String {
    let (known, new): (Vec<Column>, Vec<Column>) =
        row_schema::columns::<R>().into_iter().partition(|column| former.contains(column));
    let mut rows: Vec<(Vec<Column>, String)> = Vec::new();
    for column in &new {
        assert!(!column.doc.is_empty(), "{} has no documentation", column.name);
        let of = column.doc.strip_prefix("Standard error of `").and_then(|rest| rest.split('`').next());
        let is_alike = |other: &Column| type_name(other) == type_name(column);
        let shared = rows.iter_mut().find(|(columns, doc)| {
            is_alike(&columns[0]) && (*doc == column.doc || columns.iter().any(|c| Some(c.name) == of))
        });
        match shared {
            Some((columns, doc)) if of.is_some() => {
                columns.push(column.clone());
                *doc = format!("{}, and its standard error.", doc.trim_end_matches('.'));
            }
            Some((columns, _)) => columns.push(column.clone()),
            None => rows.push((vec![column.clone()], column.doc.to_owned())),
        }
    }
    let mut table = "| column | type | meaning |\n|---|---|---|\n".to_owned();
    for (columns, doc) in rows {
        writeln!(table, "| {} | {} | {doc} |", names(&columns), type_name(&columns[0])).unwrap();
    }
    if !known.is_empty() {
        write!(table, "\nAlso, as in a table above: {}.\n", names(&known)).unwrap();
    }
    former.extend(new);
    table
}

fn names(columns: &[Column]) -> String {
    columns.iter().map(|column| format!("`{}`", column.name)).collect::<Vec<_>>().join(", ")
}

fn type_name(column: &Column) -> String {
    let name = match &column.data_type {
        DataType::Utf8 => "text",
        DataType::Float64 => "f64",
        DataType::Int64 => "i64",
        DataType::Timestamp(..) => "timestamp",
        DataType::List(element) if element.data_type() == &DataType::Utf8 => "list of text",
        DataType::List(element) if element.data_type() == &DataType::Float64 => "list of f64",
        DataType::List(_) => "list of struct",
        DataType::Boolean => "bool",
        other => panic!("{other} has no name on the page"),
    };
    if column.nullable { format!("{name}?") } else { name.to_owned() }
}
