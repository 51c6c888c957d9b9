//! Reference data, whose folders are given from the folder of this crate: an entry of a JSON file, and Parquet columns as
//! `f64` with missing values as NaN.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;

use serde_json::Value;

use self::table::Table;

#[path = "../../../../tests/table.rs"]
#[allow(dead_code, reason = "other tests read texts as well")]
mod table;

/// The entry of a name in the JSON file of a folder, and the columns of its Parquet file.
pub(crate) fn load(folder: &str, json: &str, name: &str) -> (Value, BTreeMap<String, Vec<f64>>) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
    let all: Value = serde_json::from_reader(File::open(folder.join(json)).unwrap()).unwrap();
    let table = Table::read(&folder.join(format!("{name}.parquet")));
    (all[name].clone(), table.columns().into_iter().collect())
}
