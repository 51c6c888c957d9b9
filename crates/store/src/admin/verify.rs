//! Is the store still what was committed? Every file against its log, its digest and its rows.

use std::fs::File;
use std::path::PathBuf;

use parquet::file::reader::{FileReader, SerializedFileReader};
use records::Diagnostic;

use crate::delta::data_file;
use crate::delta::snapshot::DataFile;
use crate::delta::table::Table;
use crate::error::Error;
use crate::handle::Store;
use crate::read::polars_scan::{self, ScanRequest};
use crate::read::store_read::files_of;
use crate::rows::gap_columns;
use crate::write::writer::keys;
use records::RecordKey;

/// So many alike are named; the rest is counted.
const NAMED: usize = 3;

impl Store {
    /// What is wrong with the store; nothing when all is well.
    ///
    /// Each data file must be there, as long as its log says, with the content its digest says and as
    /// many rows; and no record may be there twice.
    pub fn verify(&self) -> Vec<Diagnostic> {
        let tables = self.tables();
        let mut findings: Vec<Diagnostic> = tables.into_iter().flat_map(wrong_in).collect();
        if findings.is_empty() {
            findings.extend(self.duplicates().unwrap_or_else(|error| vec![error.diagnostic()]));
        }
        findings
    }

    fn duplicates(&self) -> Result<Vec<Diagnostic>, Error> {
        let files: Vec<PathBuf> = files_of(&self.gaps)?;
        let schema = polars_scan::only(&gap_columns::schema(), &RecordKey::COLUMNS)?;
        let order = &RecordKey::COLUMNS;
        let batch = ScanRequest { files: &files, schema, condition: None, order, last: None }.collect()?;
        let keys = keys(&batch)?;
        let twice: Vec<&RecordKey> = keys.windows(2).filter(|k| k[0] == k[1]).map(|k| &k[0]).collect();
        let mut findings: Vec<Diagnostic> = twice.iter().take(NAMED).map(|key| duplicate(key)).collect();
        if twice.len() > NAMED {
            let more = format!("{} more records are stored twice", twice.len() - NAMED);
            findings.push(Diagnostic::new("store_duplicate", more));
        }
        Ok(findings)
    }
}

fn duplicate(key: &RecordKey) -> Diagnostic {
    let RecordKey { tail_number, flight_id, position, .. } = key;
    Diagnostic::new("store_duplicate", format!("{tail_number} {flight_id} {position} is stored twice"))
        .hint("did another program compact the table while a run was writing? `freeplay run --redo` mends it")
}

fn wrong_in(table: &Table) -> Vec<Diagnostic> {
    match table.snapshot() {
        Ok(snapshot) => snapshot.files.iter().filter_map(|file| wrong_with(table, file)).collect(),
        Err(error) => vec![error.diagnostic()],
    }
}

fn wrong_with(table: &Table, file: &DataFile) -> Option<Diagnostic> {
    let diagnostic = |code: &str, what: &str| {
        Diagnostic::new(code, what).in_file(table.location.display_path(&file.path).display())
    };
    let length = match table.location.length(&file.path) {
        Ok(Some(length)) => length,
        Ok(None) => {
            let what = "a committed data file is missing";
            return Some(
                diagnostic("store_file_missing", what).hint("restore it from a backup of the store"),
            );
        }
        Err(error) => return Some(error.diagnostic()),
    };
    if let Err(error) = table.location.fetch(&file.path).and_then(|()| data_file::check(&file.path)) {
        return Some(error.diagnostic());
    }
    if length != file.size_bytes {
        let mut wrong = diagnostic("store_damaged", "a data file has another length than was committed");
        (wrong.found, wrong.expected) = (Some(bytes(length)), Some(bytes(file.size_bytes)));
        return Some(wrong.hint("restore it from a backup of the store"));
    }
    let rows = match rows(file) {
        Ok(rows) => rows,
        Err(error) => return Some(error.diagnostic().in_file(file.path.display())),
    };
    if file.stats.num_records.is_some_and(|committed| committed != rows) {
        let mut wrong =
            diagnostic("store_damaged", "a data file has another number of rows than was committed");
        (wrong.found, wrong.expected) =
            (Some(rows.to_string()), file.stats.num_records.map(|n| n.to_string()));
        return Some(wrong.hint("restore it from a backup of the store"));
    }
    (!file.has_digest()).then(|| {
        diagnostic("store_file_foreign", "a data file was written by another program and carries no digest")
            .hint("`freeplay store compact` writes its rows anew, with digests; compare them with the logs first")
    })
}

fn bytes(count: u64) -> String {
    format!("{count} bytes")
}

fn rows(file: &DataFile) -> Result<i64, Error> {
    let opened = File::open(&file.path).map_err(Error::io(&file.path, "opened"))?;
    Ok(SerializedFileReader::new(opened)?.metadata().file_metadata().num_rows())
}
