//! Every column comes back as it went in, through Parquet, Delta and Polars.

use std::sync::Arc;

use arrow::array::{
    Array, ArrayRef, Float64Array, Int64Array, ListArray, RecordBatch, StringArray, TimestampMicrosecondArray,
};
use arrow::datatypes::{DataType, Field, Int64Type, Schema};
use jiff::Timestamp;
use records::row_schema::{from_batch, to_batch};
use records::{GapEstimate, GapRecord};
use store::{LogResult, Query, RecordKey};

use crate::fixtures::{account, fresh, record};

const ROWS: usize = 8;
const TEXTS: [&str; ROWS] = ["", " ", "a b", "é漢🛩", "\"',;\\%", "\u{0}", "a\nb\r\t", "null"];
const NUMBERS: [Option<f64>; ROWS] = [
    None,
    Some(0.0),
    Some(-0.0),
    Some(f64::MAX),
    Some(f64::MIN_POSITIVE),
    Some(5e-324),
    Some(-1.5e-5),
    Some(1.0 / 3.0),
];

/// Records with every cell that a layer could cut, round or take for another, in every column that may have it.
fn records() -> Vec<GapRecord> {
    // Whole microseconds, from before year 0 to the end of 9999.
    let ends = [Timestamp::MIN.as_second() + 1, Timestamp::MAX.as_second()].map(|second| second * 1_000_000);
    let times = [ends[0], -1, 0, 1, 999, 1_767_247_200_123_456, ends[1] - 1, ends[1]];
    let counts = [i64::MIN, -1, 0, 1, 2, 30_000, 1 << 53, i64::MAX];
    let estimate = |row: usize| GapEstimate {
        flags: TEXTS[..row].iter().map(|text| (*text).to_owned()).collect(),
        gap_profile_m: NUMBERS[..row].iter().copied().flatten().collect(),
        ..GapEstimate::default()
    };
    let lists = to_batch(&(0..ROWS).map(estimate).collect::<Vec<_>>()).unwrap();
    let schema = GapRecord::schema();
    let columns = schema.fields().iter().enumerate().map(|(place, field)| -> ArrayRef {
        // A row has unlike cells, so that columns are not exchanged unseen.
        let cells = (0..ROWS).map(|row| row * (2 * place + 1) % ROWS);
        match (field.data_type(), field.name().as_str()) {
            (DataType::Utf8, "status") => {
                Arc::new(StringArray::from_iter_values(cells.map(|at| ["estimated", "refused"][at % 2])))
            }
            // Names keep no white space around them, and hold anything else.
            (DataType::Utf8, "tail_number" | "flight_id" | "position" | "part_number" | "serial_number") => {
                let names = cells.map(|at| format!("{}é", TEXTS[at]).trim().to_owned());
                Arc::new(StringArray::from_iter_values(names))
            }
            (DataType::Utf8, _) => {
                let is_missing = |at: usize| field.is_nullable() && at == 0;
                Arc::new(cells.map(|at| (!is_missing(at)).then_some(TEXTS[at])).collect::<StringArray>())
            }
            (DataType::Float64, _) => Arc::new(cells.map(|at| NUMBERS[at]).collect::<Float64Array>()),
            (DataType::Int64, _) => Arc::new(Int64Array::from_iter_values(cells.map(|at| counts[at]))),
            (DataType::Timestamp(..), _) => {
                let times = TimestampMicrosecondArray::from_iter_values(cells.map(|at| times[at]));
                Arc::new(times.with_timezone("UTC"))
            }
            (_, name) => Arc::clone(lists.column_by_name(name).unwrap()),
        }
    });
    from_batch(&RecordBatch::try_new(Arc::clone(&schema), columns.collect()).unwrap()).unwrap()
}

fn bits(records: &[GapRecord]) -> Vec<String> {
    // The debug form of an f64 is its shortest exact one, and separates -0.0 from 0.0.
    records.iter().map(|record| format!("{record:?}")).collect()
}

#[test]
fn every_column_comes_back_from_the_store() {
    let mut all = records();
    all.sort_by_key(RecordKey::of);
    let (_dir, mut writer) = fresh();
    // The second time, each record takes its own place.
    for _ in 0..2 {
        let result = LogResult { account: account(0, 0), records: all.clone(), moved_from: Vec::new() };
        writer.commit(&[result]).unwrap();
        assert_eq!(bits(&writer.store().records(&Query::default()).unwrap()), bits(&all));
    }
    for record in &all {
        let tail = record.flight.tail_number.to_string();
        let since_utc = Some(record.flight.departure_utc);
        let query = Query { tail_number: Some(tail), since_utc, ..Query::default() };
        let found = writer.store().records(&query).unwrap();
        assert!(bits(&found).contains(&bits(std::slice::from_ref(record))[0]), "{record:?}");
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

#[test]
fn a_number_that_is_not_finite_is_stored_as_missing() {
    let of_nis = |nis| GapEstimate { nis: Some(nis), ..GapEstimate::default() };
    let batch = to_batch(&[f64::INFINITY, f64::NAN, 1.0].map(of_nis)).unwrap();
    assert_eq!(batch.column_by_name("nis").unwrap().null_count(), 2);
}
