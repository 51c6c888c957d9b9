//! Row output: a table for readers, or one Arrow batch as JSON, JSON lines, CSV or Parquet.

use std::fs::File;
use std::io::{self, IsTerminal, Write};
use std::sync::Arc;

use arrow::array::{Array, AsArray, RecordBatch, StringArray};
use arrow::compute::cast;
use arrow::csv::WriterBuilder as CsvWriter;
use arrow::datatypes::{DataType, Field, Schema};
use arrow::error::ArrowError;
use arrow::json::writer::{JsonArray, LineDelimited, WriterBuilder as JsonWriter};
use parquet::arrow::ArrowWriter;
use records::Diagnostic;
use records::row_schema::{Row, to_nullable_batch};
use records::sanitize::{csv_cell, escape_invisible};

use crate::args::{Format, RowFormatArgs};
use crate::exit::Failure;
use crate::output::Output;

/// Writes `table` or `batch` in the selected format to stdout or a file.
pub(crate) fn write_rows(
    format: &RowFormatArgs,
    output: &Output,
    batch: impl FnOnce() -> Result<RecordBatch, Failure>,
    table: impl FnOnce() -> String,
) -> Result<(), Failure> {
    format.output.as_deref().map_or(Ok(()), |file| output.refuse_input(file))?;
    match (format.format(), &format.output) {
        (Format::Table, None) => output.write_result(&table()),
        (Format::Table, Some(file)) => {
            to_file(file, |out| Ok(out.write_all(escape_invisible(&table()).as_bytes())?))
        }
        (Format::Parquet, None) if io::stdout().is_terminal() => Err(Failure::usage(
            "binary_output",
            "Parquet is binary and is not written to a terminal",
            "add `--output FILE`, or redirect stdout",
        )),
        (format, None) => write(&batch()?, format, &mut io::stdout()),
        (format, Some(file)) => {
            let batch = batch()?;
            to_file(file, |out| write(&batch, format, out))
        }
    }
}

/// Writes to a temporary file and renames it, so that no reader finds half a file. A symbolic link stays a link, and a
/// device or a pipe is written to.
pub(crate) fn to_file(
    file: &std::path::Path,
    fill: impl FnOnce(&mut File) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let target = file.canonicalize().unwrap_or_else(|_| file.to_owned());
    if target.metadata().is_ok_and(|target| !target.is_file() && !target.is_dir()) {
        let opened = File::options().write(true).open(&target);
        return fill(&mut opened.map_err(|e| not_written(file, &e))?);
    }
    let folder = target.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(std::path::Path::new("."));
    let mut temporary = shared().tempfile_in(folder).map_err(|e| not_written(file, &e))?;
    fill(temporary.as_file_mut())?;
    temporary.persist(&target).map(drop).map_err(|e| not_written(file, &e.error))
}

/// Refuses a file that cannot be written, before a long computation: its folder is missing, or it is a folder or an input.
pub(crate) fn check_file(file: &std::path::Path, output: &Output) -> Result<(), Failure> {
    output.refuse_input(file)?;
    let folder = file.parent().filter(|p| !p.as_os_str().is_empty());
    let kind = match folder {
        _ if file.is_dir() => io::ErrorKind::IsADirectory,
        Some(folder) if !folder.exists() => io::ErrorKind::NotFound,
        _ => return Ok(()),
    };
    Err(not_written(file, &kind.into()))
}

pub(crate) fn check_folder(folder: &std::path::Path) -> Result<(), Failure> {
    if !folder.is_file() {
        return Ok(());
    }
    let what = format!("{} is a file, not a folder", folder.display());
    Err(Failure::usage("would_overwrite", what, "name a new or an empty folder"))
}

/// Temporary file with the permissions of the user's umask.
fn shared() -> tempfile::Builder<'static, 'static> {
    let mut builder = tempfile::Builder::new();
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder
}

fn not_written(file: &std::path::Path, error: &io::Error) -> Failure {
    let (why, hint) = match error.kind() {
        io::ErrorKind::NotFound => ("no such folder".to_owned(), "create the folder first"),
        io::ErrorKind::IsADirectory => {
            ("this is a folder, not a file".to_owned(), "name a file, e.g. one in this folder")
        }
        io::ErrorKind::PermissionDenied => ("permission denied".to_owned(), "choose another folder"),
        io::ErrorKind::StorageFull => ("the disk is full".to_owned(), "free space, or choose another folder"),
        _ => (error.to_string(), "check that the folder is writable"),
    };
    let what = format!("the output cannot be written: {why}");
    Failure::failed(Diagnostic::new("output_failed", what).in_file(file.display()).hint(hint))
}

fn write(batch: &RecordBatch, format: Format, out: &mut (impl Write + Send)) -> Result<(), Failure> {
    match format {
        Format::Json | Format::Table => {
            let mut writer = JsonWriter::new().with_explicit_nulls(true).build::<_, JsonArray>(&mut *out);
            writer.write(batch).and_then(|()| writer.finish()).map_err(|e| broken(&e))?;
            out.write_all(b"\n")?;
        }
        Format::Jsonl => {
            let mut writer = JsonWriter::new().with_explicit_nulls(true).build::<_, LineDelimited>(&mut *out);
            writer.write(batch).and_then(|()| writer.finish()).map_err(|e| broken(&e))?;
        }
        Format::Csv => CsvWriter::new()
            .with_header(true)
            .build(&mut *out)
            .write(&csv_safe(&flat(batch)?).map_err(|e| broken(&e))?)
            .map_err(|e| broken(&e))?,
        Format::Parquet => {
            let fail = |e: parquet::errors::ParquetError| broken(&e.into());
            let mut writer = ArrowWriter::try_new(&mut *out, batch.schema(), None).map_err(fail)?;
            writer.write(batch).map_err(fail)?;
            writer.close().map_err(fail)?;
        }
    }
    Ok(out.flush()?)
}

fn broken(error: &ArrowError) -> Failure {
    if error.to_string().contains("Broken pipe") {
        return Failure::PipeClosed;
    }
    Failure::failed(Diagnostic::new("output_failed", format!("the output cannot be written: {error}")))
}

/// The same rows with text that no spreadsheet takes for a formula.
fn csv_safe(batch: &RecordBatch) -> Result<RecordBatch, ArrowError> {
    let safe = |column: &Arc<dyn Array>| -> Arc<dyn Array> {
        let Some(texts) = column.as_string_opt::<i32>() else { return Arc::clone(column) };
        Arc::new(texts.iter().map(|text| text.map(csv_cell)).collect::<StringArray>())
    };
    RecordBatch::try_new(batch.schema(), batch.columns().iter().map(safe).collect())
}

/// Flattens lists for CSV: scalar items are separated by semicolons, nested ones written as JSON.
fn flat(batch: &RecordBatch) -> Result<RecordBatch, Failure> {
    let (mut fields, mut columns) = (Vec::new(), Vec::new());
    for (field, column) in batch.schema().fields().iter().zip(batch.columns()) {
        let nested = matches!(field.data_type(), DataType::List(_));
        fields.push(Field::new(
            field.name(),
            if nested { DataType::Utf8 } else { field.data_type().clone() },
            true,
        ));
        columns.push(if nested { joined(column)? } else { Arc::clone(column) });
    }
    RecordBatch::try_new(Arc::new(Schema::new(fields)), columns).map_err(|e| broken(&e))
}

fn joined(column: &Arc<dyn Array>) -> Result<Arc<dyn Array>, Failure> {
    let lists = column.as_list::<i32>();
    let text = |items: Arc<dyn Array>| -> Result<String, Failure> {
        if let Ok(items) = cast(&items, &DataType::Utf8) {
            return Ok(items.as_string::<i32>().iter().flatten().collect::<Vec<_>>().join(";"));
        }
        let batch = RecordBatch::from(items.as_struct());
        let mut buffer = Vec::new();
        write(&batch, Format::Json, &mut buffer)?;
        Ok(String::from_utf8_lossy(&buffer).trim().to_owned())
    };
    let rows = lists.iter().map(|items| items.map(text).transpose()).collect::<Result<Vec<_>, _>>()?;
    Ok(Arc::new(StringArray::from(rows)))
}

pub(crate) fn batch<R: Row>(rows: &[R]) -> Result<RecordBatch, Failure> {
    to_nullable_batch(rows).map_err(|e| Failure::failed(Diagnostic::new("output_failed", e)))
}

/// The columns `names`, in that order, of the batch or of `texts`, which are additional columns.
pub(crate) fn columns(
    batch: &RecordBatch,
    names: &[&str],
    texts: &[(&str, StringArray)],
) -> Result<RecordBatch, Failure> {
    let column = |name: &&str| -> Result<(String, Arc<dyn Array>, bool), ArrowError> {
        let added = texts.iter().find(|(added, _)| added == name);
        let added = added.map(|(_, column)| Arc::new(column.clone()) as Arc<dyn Array>);
        let column = match added {
            Some(column) => column,
            None => Arc::clone(batch.column(batch.schema().index_of(name)?)),
        };
        Ok(((*name).to_owned(), column, true))
    };
    let columns = names.iter().map(column).collect::<Result<Vec<_>, _>>().map_err(|e| broken(&e))?;
    RecordBatch::try_from_iter_with_nullable(columns).map_err(|e| broken(&e))
}

#[cfg(test)]
mod tests {
    use arrow::array::{ListBuilder, StringBuilder};

    use super::*;

    #[test]
    fn items_of_a_list_are_joined_by_semicolons() {
        let mut flags = ListBuilder::new(StringBuilder::new());
        flags.append_value([Some("load_spikes"), Some("soft_contact")]);
        flags.append_value([None::<&str>; 0]);
        let batch =
            RecordBatch::try_from_iter([("flags", Arc::new(flags.finish()) as Arc<dyn Array>)]).unwrap();
        let mut text = Vec::new();
        write(&batch, Format::Csv, &mut text).unwrap();
        assert_eq!(String::from_utf8(text).unwrap(), "flags\nload_spikes;soft_contact\n\"\"\n");
    }
}
