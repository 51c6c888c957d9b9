//! `trend`: level, rate, crossing of the limit and state of each unit.

use std::sync::Arc;

use arrow::datatypes::{DataType, Field, Schema, SchemaRef};
use pipeline::trends::{self, Ask, TrendRow};
use store::Store;

use crate::args::{Global, TrendArgs};
use crate::exit::{Code, Failure};
use crate::rows;
use crate::spark::spark;
use crate::table::{self, count, number, state_mark, text};
use crate::talk::Talk;

use super::booked;

/// Answers with one row for each unit, or for each query.
///
/// # Errors
/// When configuration, tables or store cannot be read.
pub(crate) fn trend(args: &TrendArgs, global: &Global, talk: &Talk) -> Result<Code, Failure> {
    let (config, installations) = booked(global)?;
    let ask = Ask {
        tail_number: args.tail.clone(),
        serial_number: args.serial.clone(),
        part_number: args.part.clone(),
        as_of_utc: args.as_of,
    };
    let found = match (&args.estimates, &args.queries) {
        (Some(file), None) => {
            trends::of_flown(&config, &installations, pipeline::estimates::read(file)?, &ask)?
        }
        (None, None) => trends::of_store(&config, &installations, &Store::open(config.store())?, &ask)?,
        (estimates, Some(queries)) => {
            let queries = pipeline::estimates::queries(queries)?;
            let flown = match estimates {
                Some(file) => pipeline::estimates::read(file)?,
                None => trends::flown_in_store(&installations, &Store::open(config.store())?)?,
            };
            trends::of_queries(&config, &installations, flown, &queries)?
        }
    };
    rows::answer(&args.output, talk, || rows::batch(&schema(), &found), || page(&found))?;
    Ok(Code::Well)
}

fn page(found: &[TrendRow]) -> String {
    let columns = [
        text("state", 0),
        text("part / serial", 0),
        text("tail", 2),
        text("position", 4),
        number("flights", 6),
        number("gap µm", 0),
        number("± µm", 3),
        text("so far", 2),
        number("nm/h", 1),
        text("trend", 4),
        number("limit µm", 5),
        number("not before h", 1),
        text("not before", 2),
        number("likely h", 4),
        number("not after h", 6),
        text("why", 7),
    ];
    let cells = |r: &TrendRow| {
        vec![
            state_mark(r.state),
            format!("{} / {}", r.part_number.as_deref().unwrap_or("–"), r.serial_number),
            r.tail_number.clone().unwrap_or_else(table::dash),
            r.position.clone().unwrap_or_else(table::dash),
            r.flights.to_string(),
            table::micrometres(r.gap_m),
            table::micrometres(r.gap_se_m),
            spark(&r.sketch_m),
            r.rate_m_per_hour.map_or_else(table::dash, |v| format!("{:.1}", v * 1e9)),
            r.trend.to_owned(),
            table::micrometres(r.limit_m),
            table::hours(r.crossing_hours_p05),
            r.not_before_utc.map_or_else(table::dash, |day| day.strftime("%Y-%m-%d").to_string()),
            table::hours(r.crossing_hours_p50),
            table::hours(r.crossing_hours_p95),
            r.reason.clone().unwrap_or_default(),
        ]
    };
    let as_of = found.iter().map(|r| r.as_of_utc).max();
    let head = as_of.map_or_else(
        || "no unit fits\n".to_owned(),
        |as_of| format!("{} as of {}\n", count(found.len(), "unit"), as_of.strftime("%Y-%m-%d %H:%M UTC")),
    );
    if found.is_empty() {
        head
    } else {
        head + &table::layout(&columns, &found.iter().map(cells).collect::<Vec<_>>())
    }
}

/// The contract's columns.
fn schema() -> SchemaRef {
    let text = |name: &str| Field::new(name, DataType::Utf8, true);
    let real = |name: &str| Field::new(name, DataType::Float64, true);
    let change = DataType::Struct(
        vec![
            Field::new("departure_utc", rows::utc(), true),
            text("flight_id"),
            text("kind"),
            real("step_m"),
            real("step_se_m"),
        ]
        .into(),
    );
    Arc::new(Schema::new(vec![
        text("part_number"),
        text("serial_number"),
        text("tail_number"),
        text("position"),
        Field::new("as_of_utc", rows::utc(), true),
        Field::new("flights", DataType::Int64, true),
        real("unit_hours"),
        real("gap_m"),
        real("gap_se_m"),
        Field::new("estimates", DataType::Int64, true),
        Field::new("outliers", DataType::Int64, true),
        real("noise_factor"),
        real("rate_m_per_hour"),
        real("rate_p05_m_per_hour"),
        real("rate_p95_m_per_hour"),
        text("trend"),
        real("growth_probability"),
        text("wear_law"),
        real("wear_law_probability"),
        text("usage_axis"),
        real("trend_p_value"),
        real("sen_rate_m_per_hour"),
        real("sen_low_m_per_hour"),
        real("sen_high_m_per_hour"),
        Field::new("change_points", DataType::List(Arc::new(Field::new("item", change, true))), true),
        real("limit_m"),
        real("crossing_hours_p05"),
        real("crossing_hours_p50"),
        real("crossing_hours_p95"),
        real("crossing_flights_p05"),
        real("crossing_flights_p50"),
        real("crossing_flights_p95"),
        Field::new("not_before_utc", rows::utc(), true),
        Field::new("likely_utc", rows::utc(), true),
        Field::new("not_after_utc", rows::utc(), true),
        real("check_probability"),
        text("state"),
        text("reason"),
    ]))
}
