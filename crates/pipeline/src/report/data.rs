//! Tables of what the pages of a report show, as Parquet files.

use ::report::{Page, Report, TimedInterval, UnitView, removal_forecast};
use parquet::arrow::ArrowWriter;
use records::report_rows::{
    ReportFlightRow, ReportGapRow, ReportInspectionRow, ReportLogErrorRow, ReportPastForecastRow,
    ReportRemovalsRow, ReportTailRow,
};
use records::row_schema::{Row, to_nullable_batch};

use crate::error::Error;

/// The tables of a report: `data/NAME.parquet` in its folder, SI units.
///
/// # Errors
/// When a table has more rows than a batch can hold.
pub fn tables(report: &Report) -> Result<Vec<Page>, Error> {
    let units = &report.units;
    let changes = &report.quantity_changes;
    let quantities: Vec<_> = each(units, |unit| unit.quantities.iter().map(|view| view.row.clone()));
    let requests: Vec<_> = each(units, |unit| unit.work_requests.iter().cloned());
    Ok(vec![
        table("units", &report.trend_rows)?,
        table("flights", &each(units, flights))?,
        table("gaps", &each(units, gaps))?,
        table("quantities", &quantities)?,
        table("changes", changes)?,
        table("work_requests", &requests)?,
        table("past_forecasts", &each(units, past_forecasts))?,
        table("inspections", &each(units, inspections))?,
        table("removals", &removals(report))?,
        table("tails", &tails(report))?,
        table("log_errors", &log_errors(report))?,
    ])
}

fn each<'a, R, I: Iterator<Item = R>>(units: &'a [UnitView], rows: impl Fn(&'a UnitView) -> I) -> Vec<R> {
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
        part_number: unit.part_number.clone(),
        serial_number: unit.serial_number.clone(),
        tail_number: flight.tail_number.to_string(),
        position: flight.position.to_string(),
        flight_id: flight.flight_id.to_string(),
        departure_utc: flight.departure_utc,
        unit_hours: flight.unit_hours,
        gap_m: flight.gap_m,
        gap_p05_m: flight.gap_p05_m,
        gap_p95_m: flight.gap_p95_m,
        gap_midrange_m: flight.gap_midrange_m,
        load_reversals: flight.load_reversals.map(|n| n as i64),
        load_p05_n: flight.load_p05_n,
        load_p95_n: flight.load_p95_n,
        remarks: flight.remarks.to_string(),
    })
}

fn gaps(unit: &UnitView) -> impl Iterator<Item = ReportGapRow> {
    let row = move |kind| {
        move |at: &TimedInterval| ReportGapRow {
            part_number: unit.part_number.clone(),
            serial_number: unit.serial_number.clone(),
            kind,
            at_utc: at.at_utc,
            gap_m: at.m,
            gap_p05_m: at.p05_m,
            gap_p95_m: at.p95_m,
        }
    };
    unit.level.iter().map(row("level")).chain(unit.forecast.iter().map(row("forecast")))
}

fn past_forecasts(unit: &UnitView) -> impl Iterator<Item = ReportPastForecastRow> {
    unit.past_forecasts.iter().map(|past| ReportPastForecastRow {
        part_number: unit.part_number.clone(),
        serial_number: unit.serial_number.clone(),
        as_of_utc: past.as_of_utc,
        days_ago: past.days_ago,
        state: past.state.clone(),
        gap_m: past.gap_m,
        predicted_m: past.predicted_m,
        predicted_p05_m: past.predicted_low_m,
        predicted_p95_m: past.predicted_high_m,
        found_m: past.found_m,
    })
}

fn inspections(unit: &UnitView) -> impl Iterator<Item = ReportInspectionRow> {
    unit.inspections.iter().map(|inspection| ReportInspectionRow {
        part_number: unit.part_number.clone(),
        serial_number: unit.serial_number.clone(),
        date_utc: inspection.date_utc,
        play_m: inspection.play_m,
        estimate_m: inspection.estimate_m,
        estimates: inspection.estimates as i64,
        instrument: inspection.instrument.clone(),
        force_n: inspection.force_n,
    })
}

fn removals(report: &Report) -> Vec<ReportRemovalsRow> {
    let row = |month: ::report::Month| ReportRemovalsRow {
        month: month.name,
        expected: month.expected,
        low: month.low,
        high: month.high,
    };
    removal_forecast(report).into_iter().map(row).collect()
}

fn tails(report: &Report) -> Vec<ReportTailRow> {
    let row = |tail: &::report::Tail| ReportTailRow {
        tail_number: tail.tail_number.clone(),
        flights: tail.flights as i64,
        records: tail.records as i64,
        refused: tail.refused as i64,
        logs_in_error: tail.logs_in_error as i64,
        last_departure_utc: tail.last_departure_utc,
        last_estimate_utc: tail.last_estimate_utc,
    };
    report.tails.iter().map(row).collect()
}

fn log_errors(report: &Report) -> Vec<ReportLogErrorRow> {
    let row = |error: &::report::LogError| ReportLogErrorRow {
        log_path: error.log_path.clone(),
        tail_number: error.tail_number.clone(),
        error_code: error.code.clone(),
        processed_utc: error.processed_utc,
    };
    report.log_errors.iter().map(row).collect()
}
