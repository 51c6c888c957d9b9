//! Every column comes back as it went in, through Parquet, Delta and Polars.

use std::sync::Arc;

use arrow::array::{
    Array, ArrayRef, Float64Array, Int64Array, ListArray, RecordBatch, StringArray, TimestampMicrosecondArray,
};
use arrow::datatypes::{DataType, Field, Int64Type, Schema};
use jiff::Timestamp;
use proptest::prelude::*;
use records::row_schema::{from_batch, to_batch};
use records::{GapEstimate, GapRecord};
use store::{LogResult, Query, RecordKey};

use crate::fixtures::{account, fresh, record};

/// Names keep no white space around them, and hold anything else.
fn name() -> impl Strategy<Value = String> {
    "\\PC{0,8}[a-zé漢🛩\u{0}\"',;\\\\%]".prop_map(|text| text.trim().to_owned())
}

fn text() -> impl Strategy<Value = String> {
    prop_oneof![Just(String::new()), "\\PC*", ".*"]
}

fn number() -> impl Strategy<Value = Option<f64>> {
    prop::option::of(prop_oneof![
        prop::num::f64::POSITIVE | prop::num::f64::NEGATIVE | prop::num::f64::SUBNORMAL,
        Just(0.0),
        Just(-0.0),
        Just(f64::MAX),
    ])
}

/// Whole microseconds, from before year 0 to beyond 9999.
fn times() -> impl Strategy<Value = i64> {
    let ends = Timestamp::MIN.as_microsecond() + 1..Timestamp::MAX.as_microsecond();
    prop_oneof![ends, 0_i64..2_000_000_000_000_000]
}

/// One cell of a column of the records.
fn cell(field: &Field) -> BoxedStrategy<ArrayRef> {
    let name_of_column = field.name().clone();
    match (field.data_type(), field.name().as_str()) {
        (DataType::Utf8, column) => {
            let texts = match column {
                "status" => prop::sample::select(vec!["estimated", "refused"])
                    .prop_map(|word| Some(word.to_owned()))
                    .boxed(),
                "tail_number" | "flight_id" | "position" | "part_number" | "serial_number" => {
                    name().prop_map(Some).boxed()
                }
                _ if field.is_nullable() => prop::option::of(text()).boxed(),
                _ => text().prop_map(Some).boxed(),
            };
            texts.prop_map(|text| Arc::new(StringArray::from(vec![text])) as ArrayRef).boxed()
        }
        (DataType::Float64, _) => number().prop_map(|n| Arc::new(Float64Array::from(vec![n])) as _).boxed(),
        (DataType::Int64, _) => any::<i64>().prop_map(|n| Arc::new(Int64Array::from(vec![n])) as _).boxed(),
        (DataType::Timestamp(..), _) => times()
            .prop_map(|us| Arc::new(TimestampMicrosecondArray::from(vec![us]).with_timezone("UTC")) as _)
            .boxed(),
        // Of the lists, only flags have elements.
        _ => prop::collection::vec(text(), 0..4)
            .prop_map(move |flags| {
                let estimate = to_batch(&[GapEstimate { flags, ..GapEstimate::default() }]).unwrap();
                Arc::clone(estimate.column_by_name(&name_of_column).unwrap())
            })
            .boxed(),
    }
}

fn records() -> impl Strategy<Value = GapRecord> {
    let schema = GapRecord::schema();
    let cells: Vec<_> = schema.fields().iter().map(|field| cell(field)).collect();
    cells.prop_map(move |cells| {
        from_batch(&RecordBatch::try_new(Arc::clone(&schema), cells).unwrap()).unwrap().remove(0)
    })
}

fn bits(records: &[GapRecord]) -> Vec<String> {
    // The debug form of an f64 is its shortest exact one, and separates -0.0 from 0.0.
    records.iter().map(|record| format!("{record:?}")).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(12) })]

    #[test]
    fn every_column_comes_back_from_the_store(mut all in prop::collection::vec(records(), 1..12)) {
        all.sort_by_key(RecordKey::of);
        all.dedup_by_key(|record| RecordKey::of(record));
        let (_dir, mut writer) = fresh();
        writer.commit(&[LogResult { account: account(0, 0), records: all.clone(), moved_from: Vec::new() }]).unwrap();
        prop_assert_eq!(bits(&writer.store().records(&Query::default()).unwrap()), bits(&all));
        for record in &all {
            let tail = record.flight.tail_number.to_string();
            let query = Query { tail_number: Some(tail), since_utc: Some(record.flight.departure_utc), ..Query::default() };
            let found = writer.store().records(&query).unwrap();
            prop_assert!(bits(&found).contains(&bits(std::slice::from_ref(record))[0]));
        }
        writer.commit(&[LogResult { account: account(0, 0), records: all.clone(), moved_from: Vec::new() }]).unwrap();
        prop_assert_eq!(bits(&writer.store().records(&Query::default()).unwrap()), bits(&all));
    }
}

#[test]
fn the_columns_are_those_of_the_contract_in_its_order() {
    let schema = GapRecord::schema();
    let names: Vec<&str> = schema.fields().iter().map(|field| field.name().as_str()).collect();
    let contract = "tail_number position part_number serial_number flight_id departure_utc flight_hours \
        tail_hours_end unit_hours status reason flags gap_m gap_se_m gap_p05_m gap_p95_m gap_midrange_m \
        stiffness_n_per_m stiffness_se_n_per_m skew_s loop_width_m lost_motion_m reference_radius_m \
        load_reversals samples samples_upper samples_lower load_p05_n load_p95_n temperature_c nis log_path \
        log_digest config_digest program_version run_id processed_utc";
    let later = "skew_se_s loop_width_se_m lost_motion_se_m load_zero_n load_zero_se_n load_delay_s \
        load_delay_se_s friction_n gap_midrange_fitted_m";
    let known: Vec<&str> = contract.split_whitespace().chain(later.split_whitespace()).collect();
    // A new column is the last.
    assert_eq!(names[..known.len()], known);
}

/// A missing column, a time beyond the calendar, which never wraps, and flags of numbers, which no release has written.
#[test]
fn a_batch_that_holds_no_records_is_an_error_that_names_the_column() {
    let sound = to_batch(&[record(1, 0, "elevator", 1e-6)]).unwrap();
    let with = |name: &str, array: ArrayRef| {
        let at = sound.schema().index_of(name).unwrap();
        let (mut fields, mut arrays) = (sound.schema().fields().to_vec(), sound.columns().to_vec());
        fields[at] = Arc::new(Field::new(name, array.data_type().clone(), false));
        arrays[at] = array;
        RecordBatch::try_new(Arc::new(Schema::new(fields)), arrays).unwrap()
    };
    let mut without = sound.clone();
    without.remove_column(2);
    let beyond = TimestampMicrosecondArray::from(vec![i64::MAX]).with_timezone("UTC");
    let numbers = ListArray::from_iter_primitive::<Int64Type, _, _>([Some([Some(1)])]);
    for (batch, expected) in [
        (without, "column `part_number` is missing"),
        (
            with("departure_utc", Arc::new(beyond)),
            "column `departure_utc`, row 0: 9223372036854775807 µs since 1970",
        ),
        (with("flags", Arc::new(numbers)), "column `flags` holds List"),
    ] {
        let error = from_batch::<GapRecord>(&batch).unwrap_err().to_string();
        assert!(error.starts_with(expected), "{error}");
    }
}
