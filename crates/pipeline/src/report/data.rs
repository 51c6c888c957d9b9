//! Tables of what the pages of a report show, as Parquet files.

use ::report::{Page, Report, UnitView, removal_forecast};
use jiff::Timestamp;
use parquet::arrow::ArrowWriter;
use records::report_rows::{ReportFlightRow, ReportGapRow};
use records::row_schema::{Row, to_nullable_batch};
use trend::Interval;

use crate::error::Error;

/// The tables of a report: `data/NAME.parquet` in its folder, SI units.
///
/// # Errors
/// When a table has more rows than a batch can hold.
pub fn tables(report: &Report) -> Result<Vec<Page>, Error> {
    let units = &report.units;
    Ok(vec![
        table("units", &each(units, |unit| [unit.row.clone()]))?,
        table("flights", &each(units, flights))?,
        table("gaps", &each(units, gaps))?,
        table("quantities", &each(units, |unit| unit.quantities.iter().map(|view| view.row.clone())))?,
        table("changes", &report.quantity_changes)?,
        table("work_requests", &each(units, |unit| unit.work_requests.clone()))?,
        table("past_forecasts", &each(units, |unit| unit.past_forecasts.clone()))?,
        table("inspections", &each(units, |unit| unit.inspections.clone()))?,
        table("removals", &removal_forecast(report))?,
        table("tails", &report.tails)?,
        table("log_errors", &report.log_errors)?,
    ])
}

fn each<'a, R, I: IntoIterator<Item = R>>(units: &'a [UnitView], rows: impl Fn(&'a UnitView) -> I) -> Vec<R> {
    units.iter().flat_map(rows).collect()
}

fn table<R: Row>(name: &str, rows: &[R]) -> Result<Page, Error> {
    let path = format!("data/{name}.parquet");
    let failed = |e: &dyn std::fmt::Display| Error::Pages {
        path: path.clone().into(),
        source: std::io::Error::other(e.to_string()),
    };
    let batch = to_nullable_batch(rows).map_err(|e| failed(&e))?;
    let mut writer = ArrowWriter::try_new(Vec::new(), batch.schema(), None).map_err(|e| failed(&e))?;
    writer.write(&batch).map_err(|e| failed(&e))?;
    let body = writer.into_inner().map_err(|e| failed(&e))?;
    Ok(Page { path, body })
}

fn flights(unit: &UnitView) -> impl Iterator<Item = ReportFlightRow> {
    unit.flights.iter().map(|flight| ReportFlightRow {
        part_number: unit.row.part_number.clone(),
        serial_number: unit.row.serial_number.clone(),
        flight: flight.clone(),
    })
}

fn gaps(unit: &UnitView) -> impl Iterator<Item = ReportGapRow> {
    let row = move |kind| {
        move |(at_utc, gap): &(Timestamp, Interval)| ReportGapRow {
            part_number: unit.row.part_number.clone(),
            serial_number: unit.row.serial_number.clone(),
            kind,
            at_utc: *at_utc,
            gap_m: gap.m,
            gap_p05_m: gap.p05_m,
            gap_p95_m: gap.p95_m,
        }
    };
    unit.level.iter().map(row("level")).chain(unit.forecast.iter().map(row("forecast")))
}
