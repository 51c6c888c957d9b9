//! Generator of `docs/commands.md` from the argument parser; the test compares the file with it.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::Path;

use clap::{Arg, Command, CommandFactory};

use crate::args::Args;

const HEAD: &str = "# Every command\n\nThe text of `freeplay help COMMAND`, written by a test. Results go to stdout, \
                    progress and diagnostics to stderr; all\ncommands have the same \
                    [exit codes](columns.md#exit-codes). Keys and columns of JSON, JSON lines, CSV and Parquet\nare \
                    stable; ignore new ones that you do not know. Text for people may change in every release.\n";

#[test]
fn the_reference_of_commands_is_what_the_parser_knows() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/commands.md");
    let page = page();
    if std::env::var_os("FREEPLAY_BLESS").is_some() {
        std::fs::write(&file, &page).unwrap();
    }
    let found = std::fs::read_to_string(&file).unwrap();
    assert!(
        found == page,
        "docs/commands.md is not what the parser knows: FREEPLAY_BLESS=1 cargo test -p cli commands_doc"
    );
}

/// The page: each command, what several of them take, and what all of them take.
fn page() -> String {
    let mut root = Args::command();
    root.build();
    let mut rows = BTreeMap::new();
    count(&root, &mut rows);
    let common: BTreeSet<String> = rows.into_iter().filter_map(|(row, n)| (n > 2).then_some(row)).collect();
    let mut page = HEAD.to_owned();
    for command in root.get_subcommands().filter(|command| command.get_name() != "help") {
        section(&mut page, command, &common);
    }
    let global = root.get_arguments().filter(|arg| arg.is_global_set()).map(row);
    page + "\n## Common options\n" + &table(common) + "\n## Options of every command\n" + &table(global)
}

/// In how many commands each row occurs.
fn count(command: &Command, rows: &mut BTreeMap<String, usize>) {
    for arg in taken(command) {
        *rows.entry(row(arg)).or_default() += 1;
    }
    command.get_subcommands().for_each(|command| count(command, rows));
}

/// The arguments of a command itself.
fn taken(command: &Command) -> impl Iterator<Item = &Arg> {
    command
        .get_arguments()
        .filter(|arg| !arg.is_global_set() && !matches!(arg.get_id().as_str(), "help" | "version"))
}

/// How a command is typed, its purpose, what it takes, its examples, and its own commands.
fn section(page: &mut String, command: &Command, common: &BTreeSet<String>) {
    let usage = command.clone().render_usage().to_string().replace(" [OPTIONS]", "");
    let about = command.get_about().map(ToString::to_string).unwrap_or_default();
    let _ = write!(page, "\n## `{}`\n\n{about}.\n", usage.trim_start_matches("Usage: ").trim());
    let (shared, own): (Vec<&Arg>, Vec<&Arg>) = taken(command).partition(|arg| common.contains(&row(arg)));
    if !own.is_empty() {
        page.push_str(&table(own.into_iter().map(row)));
    }
    if !shared.is_empty() {
        let names: Vec<String> = shared.into_iter().map(name_of).collect();
        let _ = write!(page, "\n[Common options](#common-options): {}.\n", names.join(", "));
    }
    if let Some(examples) = command.get_after_help() {
        let _ = write!(page, "\n```text\n{}\n```\n", examples.to_string().trim());
    }
    for command in command.get_subcommands().filter(|command| command.get_name() != "help") {
        section(page, command, common);
    }
}

fn table(rows: impl IntoIterator<Item = String>) -> String {
    "\n| option | meaning |\n|---|---|\n".to_owned() + &rows.into_iter().collect::<String>()
}

/// A row of a table of options.
fn row(arg: &Arg) -> String {
    let help = arg.get_long_help().or(arg.get_help()).map(ToString::to_string).unwrap_or_default();
    let help = help.split_whitespace().collect::<Vec<_>>().join(" ");
    format!("| {} | {}.{} |\n", typed(arg), help.trim_end_matches('.').replace('|', "\\|"), notes(arg))
}

/// The long name of an option, or that of its value.
fn name_of(arg: &Arg) -> String {
    arg.get_long().map_or_else(|| typed(arg), |long| format!("`--{long}`"))
}

/// An option as it is typed: `-j`, `--jobs JOBS`, or `LOGS...`.
fn typed(arg: &Arg) -> String {
    let names: Vec<String> = arg.get_value_names().into_iter().flatten().map(ToString::to_string).collect();
    let takes = arg.get_action().takes_values();
    let value = if takes { names.join(" ") } else { String::new() };
    let more = if arg.get_num_args().is_some_and(|n| n.max_values() > 1) { "…" } else { "" };
    match (arg.get_short(), arg.get_long()) {
        (Some(short), Some(long)) => format!("`-{short}`, `{}`", format!("--{long} {value}").trim()),
        (None, Some(long)) => format!("`{}`", format!("--{long} {value}").trim()),
        _ => format!("`{value}{more}`"),
    }
    .replace('|', "\\|")
}

/// The words an option takes, its default, and the variable that gives it.
fn notes(arg: &Arg) -> String {
    let mut notes = String::new();
    let words: Vec<String> =
        arg.get_possible_values().iter().map(|v| format!("`{}`", v.get_name())).collect();
    if arg.get_action().takes_values() && !words.is_empty() {
        let _ = write!(notes, " One of {}.", words.join(", "));
    }
    let default: Vec<_> = arg.get_default_values().iter().map(|v| v.to_string_lossy()).collect();
    if arg.get_action().takes_values() && !default.is_empty() {
        let _ = write!(notes, " Default `{}`.", default.join(" "));
    }
    if let Some(variable) = arg.get_env() {
        let _ = write!(notes, " Also by `{}`.", variable.to_string_lossy());
    }
    notes
}
