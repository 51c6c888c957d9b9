//! Completion of names on the command line: tails, serial numbers, parts, positions and flights of the store.
//!
//! The shell asks this program while its user types, so that new names are known without a new script. A missing
//! configuration or store completes nothing and prints nothing.

use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::path::PathBuf;

use clap_complete::{ArgValueCompleter, CompletionCandidate};
use job::Config;
use store::Store;

use crate::args::CONFIG;

const MAX_CANDIDATES: usize = 200;

/// The words by which `query` selects records, each with its column.
pub(crate) const QUERY_KEYS: [(&str, &str); 4] =
    [("tail", "tail_number"), ("serial", "serial_number"), ("flight", "flight_id"), ("position", "position")];

/// Completes the values of a column of the records.
pub(crate) fn of(column: &'static str) -> ArgValueCompleter {
    ArgValueCompleter::new(move |typed: &OsStr| candidates(typed, column))
}

/// Values for the field that the command line of `query` names.
pub(crate) fn queried(typed: &OsStr) -> Vec<CompletionCandidate> {
    let words: Vec<String> = std::env::args().collect();
    let mut typed_words = words.iter().skip_while(|word| *word != "query");
    let key = typed_words.find_map(|word| QUERY_KEYS.iter().find(|(known, _)| known == word));
    key.map(|(_, column)| candidates(typed, column)).unwrap_or_default()
}

fn candidates(typed: &OsStr, column: &str) -> Vec<CompletionCandidate> {
    let Some(typed) = typed.to_str() else { return Vec::new() };
    let names = names(column).unwrap_or_default();
    let fitting = names.into_iter().filter(|name| name.starts_with(typed) && is_plain(name));
    fitting.take(MAX_CANDIDATES).map(CompletionCandidate::new).collect()
}

/// Whether a name means itself in every shell: bash inserts it unquoted, and a name of a log may hold `$(…)`.
fn is_plain(name: &str) -> bool {
    let is_plain = |c: char| c.is_alphanumeric() || "-_.+,:@/%".contains(c);
    name.starts_with(char::is_alphanumeric) && name.chars().all(is_plain)
}

/// Different values of a column of the records; none where no store can be read.
fn names(column: &str) -> Option<BTreeSet<String>> {
    let file = std::env::var_os("FREEPLAY_CONFIG").map_or_else(|| PathBuf::from(CONFIG), PathBuf::from);
    let config = Config::read_layers(&[file]).ok()?;
    Store::open(config.store()).ok()?.distinct(column).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_a_shell_would_read_are_left_out() {
        for name in ["N412FP", "aileron_left", "1040-0013", "20260910T130719Z", "D-ÄB/7.1"] {
            assert!(is_plain(name), "{name}");
        }
        for name in r"ZZ$(touch) a`b` a;b -rf ~root =ls a* {a,b} a'b !1".split(' ').chain(["a b", "a\nb", ""])
        {
            assert!(!is_plain(name), "{name}");
        }
    }
}
