//! Faults of a configuration: diagnostics of the keys whose values make no sense, each with its line.

use records::Diagnostic;

use super::layers::Source;

/// Collects the faults of a configuration, below the table that is being checked.
pub(crate) struct Faults<'s> {
    source: &'s Source<'s>,
    table: Vec<String>,
    /// What was found so far.
    pub(super) found: Vec<Diagnostic>,
}

impl<'s> Faults<'s> {
    pub(super) fn new(source: &'s Source<'s>) -> Self {
        Self { source, table: Vec::new(), found: Vec::new() }
    }

    /// Checks a table: keys that `check` reports lie below it.
    pub(super) fn within<T>(&mut self, table: &[&str], check: impl FnOnce(&mut Self) -> T) -> T {
        let above = self.table.len();
        self.table.extend(table.iter().map(|&name| name.to_owned()));
        let checked = check(self);
        self.table.truncate(above);
        checked
    }

    /// Reports a fault of a key of the present table; without a key, of the table itself.
    pub(super) fn report(&mut self, key: &[&str], fault: Diagnostic) {
        let path: Vec<&str> = self.table.iter().map(String::as_str).chain(key.iter().copied()).collect();
        self.found.push(self.source.at(&path, fault));
    }

    /// A pattern of `*` and `?`; a text that is none is reported.
    pub(super) fn pattern(&mut self, key: &[&str], text: &str, kind: &str) -> Option<glob::Pattern> {
        let pattern = glob::Pattern::new(text);
        let what = |e| format!("`{text}` is not a valid {kind}: {e}");
        pattern.map_err(|e| self.report(key, Diagnostic::new("bad_pattern", what(e)))).ok()
    }
}
