//! Names from logs and tables that hold escape sequences, line feeds, direction overrides or formulas, on every surface.

use std::path::Path;

use crate::harness::{CommandResult, Table, TestFleet, facts, facts_with, write_log};

/// Clears a terminal, colours it, begins a line that looks like a message, and reverses the text that follows.
const HOSTILE: &str = "\u{1b}[2J\u{1b}[31m\u{7}\nerror[forged]: x\u{202e}";

/// A tail that a spreadsheet executes.
const TAIL: &str = "=HYPERLINK(\"x\")";

/// What a name of the small fleet becomes.
fn hostile(name: &str) -> String {
    format!("+{name}{HOSTILE}")
}

fn renamed(column: &str) -> String {
    match column
        .strip_suffix("_motor_deg")
        .or(column.strip_suffix("_screw_mm"))
        .or(column.strip_suffix("_load_n"))
    {
        Some(position) => column.replacen(position, &hostile(position), 1),
        None => column.to_owned(),
    }
}

/// A copy of a log whose file, columns, positions, tail, flight and metadata have hostile names.
fn rename_log(log: &Path, to: &Path, tail: &str) {
    let table = Table::read(log);
    let mut columns = table.columns();
    columns.iter_mut().for_each(|(name, _)| *name = renamed(name));
    columns.push((format!("unmapped{HOSTILE}"), vec![0.0; table.rows()]));
    let mut known = facts(log);
    for (key, value) in &mut known {
        match key.as_str() {
            "tail_number" => tail.clone_into(value),
            "flight_id" => *value = hostile(value),
            _ => {}
        }
    }
    known.push((format!("extra{HOSTILE}"), HOSTILE.to_owned()));
    write_log(to, columns, &known);
}

/// The first tail under hostile names: nine logs, one without loads, one with a departure that is none, one that is text.
fn fleet() -> TestFleet {
    let fleet = TestFleet::sample();
    let folder = fleet.path("hostile");
    std::fs::create_dir(&folder).unwrap();
    let tail = format!("{TAIL}{HOSTILE}");
    for (n, log) in fleet.logs().into_iter().take(9).enumerate() {
        rename_log(&log, &folder.join(format!("{n}{HOSTILE}.parquet")), &tail);
    }
    std::fs::write(folder.join(format!("text{HOSTILE}.parquet")), "no log").unwrap();
    let log = &fleet.logs()[9];
    let known = facts_with(log, "departure_utc", HOSTILE);
    let time = Table::read(log).numbers("time_s");
    let columns = vec![("time_s".to_owned(), time.clone()), (format!("other{HOSTILE}"), time)];
    write_log(&folder.join(format!("dated{HOSTILE}.parquet")), columns.clone(), &known);
    write_log(&folder.join(format!("lacks{HOSTILE}.parquet")), columns, &facts(log));
    fleet.configure("sample-data/logs/**/*.parquet", "hostile/*.parquet");
    let table = fleet.read("sample-data/installations.csv");
    let mut rows = table.lines();
    let mut text = format!("{}\n", rows.next().unwrap());
    for row in rows.filter(|row| row.starts_with("N412FP")) {
        let cells: Vec<&str> = row.splitn(5, ',').collect();
        let quoted = |text: &str| format!("\"{}\"", text.replace('"', "\"\""));
        let (position, serial) = (hostile(cells[1]), format!("={}{HOSTILE}", cells[3]));
        let line =
            [quoted(&tail), quoted(&position), cells[2].to_owned(), quoted(&serial), cells[4].to_owned()];
        text += &line.join(",");
        text.push('\n');
    }
    std::fs::write(fleet.path("sample-data/installations.csv"), text).unwrap();
    fleet
}

/// No character of a stream moves the cursor or reverses text, and no line of it begins as the name's own one does.
fn is_harmless(args: &[&str], result: &CommandResult) {
    for text in [&result.out, &result.err] {
        let hidden = text.chars().find(|c| (c.is_control() && !matches!(c, '\n' | '\t')) || *c == '\u{202e}');
        assert_eq!(hidden, None, "{args:?}: {result:?}");
        assert!(!text.lines().any(|line| line.starts_with("error[forged]")), "{args:?}: {text}");
    }
}

#[test]
fn a_hostile_name_has_no_effect_in_any_command() {
    let fleet = fleet();
    let run = fleet.freeplay(&["run"]);
    is_harmless(&["run"], &run);
    assert!(run.out.contains("36 records of 9 flights"), "{run:?}");
    let rows = fleet.json(&["query", "position", &hostile("aileron_left")]);
    let flight = rows[0]["flight_id"].as_str().unwrap().to_owned();
    let (tail, position) = (format!("{TAIL}{HOSTILE}"), hostile("aileron_left"));
    let log = format!("hostile/0{HOSTILE}.parquet");
    let commands: [&[&str]; 18] = [
        &["check"],
        &["check", "-v"],
        &["check", &log],
        &["run"],
        &["run", "-v", "--retry"],
        &["run", "--dry-run"],
        &["estimate", &log],
        &["query", "tail", &tail],
        &["query", "serial", HOSTILE],
        &["trend"],
        &["trend", "--tail", HOSTILE],
        &["explain", &flight, &position],
        &["explain", &flight, HOSTILE],
        &["explain", HOSTILE, &position],
        &["normalize", "--output", "normalized"],
        &["report", "--output", "pages"],
        &["store", "runs", "--run", "last"],
        &["init", "proposed", "--from", "hostile"],
    ];
    for args in commands {
        is_harmless(args, &fleet.freeplay(args));
    }
}

/// Comments of a proposed configuration hold names: they stay comments, and keys stay the names.
#[test]
fn a_hostile_name_stays_a_comment_or_a_string_in_a_proposed_configuration() {
    let fleet = fleet();
    fleet.run_ok(&["init", "proposed", "--from", "hostile"]);
    let text = fleet.read("proposed/pipeline.toml");
    assert!(!text.contains(['\u{1b}', '\u{202e}', '\u{7}']), "{text}");
    assert!(!text.lines().any(|line| line.starts_with("error[forged]")), "{text}");
    let checked = fleet.freeplay(&["check", "--config", "proposed/pipeline.toml"]);
    assert!(!checked.err.contains("config_invalid"), "{checked:?}");
    let table = fleet.read("proposed/installations.csv");
    assert!(!table.lines().any(|line| line.starts_with(['=', '+', '-', '@'])), "{table}");
}

/// The first characters of the OWASP page *CSV Injection*, in each command that writes CSV.
#[test]
fn no_csv_cell_is_a_formula() {
    let fleet = fleet();
    fleet.freeplay(&["run"]);
    let (tail, log) = (format!("{TAIL}{HOSTILE}"), format!("hostile/0{HOSTILE}.parquet"));
    let commands: [&[&str]; 5] = [
        &["check", &log, "--format", "csv"],
        &["estimate", &log, "--format", "csv"],
        &["query", "tail", &tail, "--format", "csv"],
        &["trend", "--format", "csv"],
        &["store", "export", "--format", "csv"],
    ];
    for args in commands {
        let text = fleet.freeplay(args).out;
        let mut rows = arrow::csv::ReaderBuilder::new(any_columns(&text))
            .with_header(true)
            .build(std::io::Cursor::new(text.as_bytes()))
            .unwrap();
        let batch = rows.next().unwrap().unwrap();
        assert!(batch.num_rows() > 0, "{args:?}: {text}");
        for column in batch.columns() {
            use arrow::array::AsArray;
            for cell in column.as_string::<i32>().iter().flatten() {
                let is_formula = cell.starts_with(['=', '+', '-', '@', '\t', '\r']);
                assert!(!is_formula || cell.parse::<f64>().is_ok(), "{args:?}: {cell}");
                assert!(!cell.contains(['\u{1b}', '\u{7}', '\u{202e}']), "{args:?}: {cell}");
            }
        }
    }
}

/// Every column of a CSV text as text.
fn any_columns(text: &str) -> std::sync::Arc<arrow::datatypes::Schema> {
    use arrow::datatypes::{DataType, Field, Schema};
    let names = text.lines().next().unwrap_or_default().split(',');
    let fields: Vec<Field> = names.map(|name| Field::new(name, DataType::Utf8, true)).collect();
    std::sync::Arc::new(Schema::new(fields))
}
