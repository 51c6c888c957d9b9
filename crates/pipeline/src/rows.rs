//! Rows for machines: what commands and other doors hand out, as Arrow with stated columns.

use std::sync::Arc;

use arrow::array::RecordBatch;
use arrow::datatypes::{DataType, Field, Schema, SchemaRef, TimeUnit};
use arrow::error::ArrowError;
use arrow::json::ReaderBuilder;
use serde::Serialize;

/// Rows of any serializable kind as a batch of a stated schema; every number keeps its bits.
///
/// # Errors
/// When a value does not fit its column.
pub fn batch<T: Serialize>(schema: &SchemaRef, rows: &[T]) -> Result<RecordBatch, ArrowError> {
    let mut decoder =
        ReaderBuilder::new(Arc::clone(schema)).with_batch_size(rows.len().max(1)).build_decoder()?;
    decoder.serialize(rows)?;
    Ok(decoder.flush()?.unwrap_or_else(|| RecordBatch::new_empty(Arc::clone(schema))))
}

/// A column of instants.
pub fn utc() -> DataType {
    DataType::Timestamp(TimeUnit::Microsecond, Some("UTC".into()))
}

/// Columns of estimates made ad hoc: the store's without those of a run, every one nullable.
pub fn estimates() -> SchemaRef {
    let of_a_run = ["unit_hours", "run_id", "processed_utc"];
    let all = store::columns::schema();
    let fields = all.fields().iter().filter(|f| !of_a_run.contains(&f.name().as_str()));
    Arc::new(Schema::new(fields.map(|f| f.as_ref().clone().with_nullable(true)).collect::<Vec<_>>()))
}

/// The contract's columns of a trend.
pub fn trends() -> SchemaRef {
    let text = |name: &str| Field::new(name, DataType::Utf8, true);
    let real = |name: &str| Field::new(name, DataType::Float64, true);
    let change = DataType::Struct(
        vec![
            Field::new("departure_utc", utc(), true),
            text("flight_id"),
            text("kind"),
            real("step_m"),
            real("step_se_m"),
            real("certainty"),
            Field::new("tail_wide", DataType::Boolean, true),
        ]
        .into(),
    );
    Arc::new(Schema::new(vec![
        text("part_number"),
        text("serial_number"),
        text("tail_number"),
        text("position"),
        Field::new("as_of_utc", utc(), true),
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
        real("hamed_rao_p_value"),
        Field::new("change_points", DataType::List(Arc::new(Field::new("item", change, true))), true),
        real("limit_m"),
        real("crossing_hours_p05"),
        real("crossing_hours_p50"),
        real("crossing_hours_p95"),
        real("crossing_flights_p05"),
        real("crossing_flights_p50"),
        real("crossing_flights_p95"),
        Field::new("not_before_utc", utc(), true),
        Field::new("likely_utc", utc(), true),
        Field::new("not_after_utc", utc(), true),
        real("check_probability"),
        real("hours_per_day"),
        real("hours_per_day_se"),
        real("flights_per_day"),
        real("hours_per_flight"),
        text("usage_source"),
        real("stale_days"),
        Field::new("removed_utc", utc(), true),
        text("state"),
        text("reason"),
    ]))
}
