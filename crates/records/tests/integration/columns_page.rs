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
    let mut expected = page.clone();
    for (name, table) in [
        ("records", table::<GapRecord>()),
        ("trends", table::<TrendRow>()),
        ("quantities", table::<QuantityRow>()),
        ("changes", table::<QuantityChange>()),
        ("work requests", table::<WorkRequest>()),
        ("alerts", table::<AlertRecord>()),
        ("report flights", table::<ReportFlightRow>()),
        ("report gaps", table::<ReportGapRow>()),
        ("report past forecasts", table::<ReportPastForecastRow>()),
        ("report inspections", table::<ReportInspectionRow>()),
        ("report removals", table::<ReportRemovalsRow>()),
        ("report tails", table::<ReportTailRow>()),
        ("report log errors", table::<ReportLogErrorRow>()),
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

fn table<R: Row>() -> String {
    let mut table = "| column | type | meaning |\n|---|---|---|\n".to_owned();
    for column in row_schema::columns::<R>() {
        assert!(!column.doc.is_empty(), "{} has no documentation", column.name);
        writeln!(table, "| `{}` | {} | {} |", column.name, type_name(&column), column.doc).unwrap();
    }
    table
}

fn type_name(column: &Column) -> String {
    let name = match &column.data_type {
        DataType::Utf8 => "text",
        DataType::Float64 => "f64",
        DataType::Int64 => "i64",
        DataType::Timestamp(..) => "timestamp µs UTC",
        DataType::List(element) if element.data_type() == &DataType::Utf8 => "list of text",
        DataType::List(element) if element.data_type() == &DataType::Float64 => "list of f64",
        DataType::List(_) => "list of struct",
        DataType::Boolean => "bool",
        other => panic!("{other} has no name on the page"),
    };
    if column.nullable { format!("{name}, null") } else { name.to_owned() }
}
