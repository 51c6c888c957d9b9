//! The text of a configuration, in one file or several that override each other, the location of its keys, and the faults
//! of their values, each with its line.

use std::fmt::Display;
use std::ops::Range;

use records::Diagnostic;
use serde::de::DeserializeOwned;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::toml_errors;

/// Bytes of a line that a diagnostic shows at most.
const MAX_CONTENT: usize = 4096;

#[derive(Debug)]
pub(super) struct ConfigLayer {
    file: String,
    /// Its text, after as many empty lines as the files before have bytes: a span then identifies its file.
    text: String,
    start: usize,
    lines: Vec<usize>,
}

impl ConfigLayer {
    /// Names and texts of files; each overrides those before it.
    pub(super) fn stack(files: impl IntoIterator<Item = (String, String)>) -> Vec<Self> {
        let mut start = 0;
        let layer = |(file, text): (String, String)| {
            let lines = std::iter::once(0).chain(text.match_indices('\n').map(|(at, _)| at + 1)).collect();
            let layer = Self { file, text: "\n".repeat(start) + &text, start, lines };
            start = layer.text.len() + 1;
            layer
        };
        files.into_iter().map(layer).collect()
    }
}

pub(super) struct Source<'t> {
    pub(super) layers: &'t [ConfigLayer],
    table: Spanned<DeTable<'t>>,
}

impl<'t> Source<'t> {
    /// Keys of a later layer override those before. Tables are merged key by key, lists are replaced.
    pub(super) fn parse(layers: &'t [ConfigLayer]) -> Result<Self, Box<Diagnostic>> {
        let mut whole: Option<Spanned<DeTable<'t>>> = None;
        for layer in layers {
            let table = DeTable::parse(&layer.text).map_err(|e| Box::new(from_toml(layers, &e)))?;
            match &mut whole {
                None => whole = Some(table),
                Some(below) => merge(below.get_mut(), table.into_inner()),
            }
        }
        Ok(Self { layers, table: whole.unwrap_or_else(|| Spanned::new(0..0, DeTable::new())) })
    }

    pub(super) fn table(&self) -> &DeTable<'t> {
        self.table.get_ref()
    }

    pub(super) fn document<T: DeserializeOwned>(&self) -> Result<T, Diagnostic> {
        T::deserialize(toml::de::Deserializer::from(self.table.clone()))
            .map_err(|e| from_toml(self.layers, &e))
    }

    /// Gives a diagnostic the line of a key, or of the nearest table above it that is written.
    pub(super) fn at(&self, path: &[&str], diagnostic: Diagnostic) -> Diagnostic {
        at_span(self.layers, &self.locate(path).unwrap_or(0..0), diagnostic)
    }

    fn locate(&self, path: &[&str]) -> Option<Range<usize>> {
        let (mut table, mut span) = (self.table(), None);
        for name in path {
            let Some((key, value)) = table.get_key_value(*name) else { break };
            span = Some(key.span());
            match value.get_ref() {
                DeValue::Table(inner) => table = inner,
                _ => break,
            }
        }
        span
    }
}

/// Collects the faults of a configuration, below the table that is being checked.
pub(crate) struct Faults<'s> {
    source: &'s Source<'s>,
    table: Vec<String>,
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

    /// Reports a fault by its code, what is wrong, and how to correct it.
    pub(super) fn wrong(&mut self, key: &[&str], code: &str, what: impl Display, hint: impl Display) {
        self.report(key, Diagnostic::new(code, what).hint(hint));
    }

    /// A pattern of `*` and `?`; a text that is none is reported.
    pub(super) fn pattern(&mut self, key: &[&str], text: &str, kind: &str) -> Option<glob::Pattern> {
        let pattern = glob::Pattern::new(text);
        let what = |e| format!("`{text}` is not a valid {kind}: {e}");
        pattern.map_err(|e| self.report(key, Diagnostic::new("bad_pattern", what(e)))).ok()
    }
}

pub(super) fn fits(pattern: &str, text: &str) -> bool {
    glob::Pattern::new(pattern).is_ok_and(|pattern| pattern.matches(text))
}

fn merge<'t>(below: &mut DeTable<'t>, over: DeTable<'t>) {
    for (key, value) in over {
        match (below.get_mut(&key).map(Spanned::get_mut), value.get_ref()) {
            (Some(DeValue::Table(inner)), DeValue::Table(_)) => {
                if let DeValue::Table(value) = value.into_inner() {
                    merge(inner, value);
                }
            }
            _ => {
                // Taken out first, so that the key's place is that of the layer that won.
                below.remove(&key);
                below.insert(key, value);
            }
        }
    }
}

/// Names the line of a text value, or else the file.
pub(super) fn at_text(layers: &[ConfigLayer], value: &str, diagnostic: Diagnostic) -> Diagnostic {
    let quoted = [format!("\"{value}\""), format!("'{value}'")];
    let found = layers.iter().rev().find_map(|layer| quoted.iter().find_map(|text| layer.text.find(text)));
    match (found, layers.first()) {
        (Some(start), _) => at_span(layers, &(start..start), diagnostic),
        (None, Some(layer)) => diagnostic.in_file(&layer.file),
        (None, None) => diagnostic,
    }
}

fn from_toml(layers: &[ConfigLayer], error: &toml::de::Error) -> Diagnostic {
    at_span(layers, &error.span().unwrap_or(0..0), toml_errors::diagnostic(error.message()))
}

pub(super) fn at_span(layers: &[ConfigLayer], span: &Range<usize>, diagnostic: Diagnostic) -> Diagnostic {
    let Some(layer) = layers.iter().rfind(|layer| layer.start <= span.start) else { return diagnostic };
    let text = &layer.text[layer.start..];
    let at = (span.start - layer.start).min(text.len());
    let line = layer.lines.partition_point(|start| *start <= at);
    let line_start = layer.lines[line - 1];
    let column = text[line_start..at].chars().count() + 1;
    // Each diagnostic has its own copy.
    let content = text[line_start..].lines().next().unwrap_or_default();
    let content = content[..content.floor_char_boundary(MAX_CONTENT)].to_owned();
    // A webhook's address holds its secret.
    let is_secret = |line: &String| line.contains("http") || line.contains("://") && line.contains('@');
    let content = Some(content).filter(|line| !is_secret(line));
    Diagnostic { line: Some((line, column)), text: content, ..diagnostic.in_file(&layer.file) }
}
