//! Generator of `docs/commands.md` from the argument parser; the test compares the file with it.

use std::fmt::Write as _;
use std::path::Path;

use clap::{Arg, Command, CommandFactory};

use crate::args::Args;

const HEAD: &str = "# Every command\n\nThe text of `freeplay COMMAND -h`, written by a test; options of every command are \
                    listed once, under `freeplay`. Results go\nto stdout, progress and diagnostics to stderr; all \
                    commands have the same [exit codes](columns.md#exit-codes). Keys and columns of\nJSON, JSON lines, \
                    CSV and Parquet are stable; ignore new ones that you do not know. Text for people may change in \
                    every release.\n";

#[test]
fn the_reference_of_commands_is_what_the_parser_knows() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/commands.md");
    let mut root = Args::command();
    root.build();
    let mut page = HEAD.to_owned();
    let _ = write!(page, "\n## `freeplay`\n\n```text\n{}\n```\n", help(&root, Arg::is_global_set));
    root.get_subcommands().for_each(|command| section(&mut page, command));
    if std::env::var_os("FREEPLAY_BLESS").is_some() {
        std::fs::write(&file, &page).unwrap();
    }
    let found = std::fs::read_to_string(&file).unwrap();
    assert!(
        found == page,
        "docs/commands.md is not what the parser knows: FREEPLAY_BLESS=1 cargo test -p cli commands_doc"
    );
}

/// The help of a command, then that of each command below it. Options of every command are only in the help of `freeplay`.
fn section(page: &mut String, command: &Command) {
    if command.get_name() == "help" {
        return;
    }
    let name = command.get_bin_name().unwrap_or_default();
    let _ = write!(page, "\n## `{name}`\n\n```text\n{}\n```\n", help(command, |arg| !arg.is_global_set()));
    command.get_subcommands().for_each(|command| section(page, command));
}

/// The help of a command with the options that `shows` selects.
fn help(command: &Command, shows: impl Fn(&Arg) -> bool) -> String {
    let is_hidden = |arg: &Arg| arg.is_hide_set() || ["help", "version"].contains(&arg.get_id().as_str());
    let shown = command.clone().mut_args(|arg| {
        let hide = is_hidden(&arg) || !shows(&arg);
        arg.hide(hide).hide_env_values(true)
    });
    shown.term_width(100).render_help().to_string().trim().to_owned()
}
