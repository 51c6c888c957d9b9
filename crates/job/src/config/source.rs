//! The text of a configuration, and where in it a key stands.

use std::ops::Range;

use fleet::Complaint;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::meant;

/// Text and its table with spans.
pub(super) struct Source<'t> {
    file: &'t str,
    text: &'t str,
    table: Spanned<DeTable<'t>>,
}

impl<'t> Source<'t> {
    pub(super) fn parse(file: &'t str, text: &'t str) -> Result<Self, Box<Complaint>> {
        match DeTable::parse(text) {
            Ok(table) => Ok(Self { file, text, table }),
            Err(error) => Err(Box::new(from_toml(file, text, &error))),
        }
    }

    pub(super) fn table(&self) -> &DeTable<'t> {
        self.table.get_ref()
    }

    /// A complaint of the TOML reader, with its line.
    pub(super) fn toml_error(&self, error: &toml::de::Error) -> Complaint {
        from_toml(self.file, self.text, error)
    }

    /// Gives a complaint the line of a key, or of the nearest table above it that is written.
    pub(super) fn at(&self, path: &[&str], complaint: Complaint) -> Complaint {
        let span = self.locate(path).unwrap_or(0..0);
        self.at_span(span, complaint)
    }

    pub(super) fn at_span(&self, span: Range<usize>, complaint: Complaint) -> Complaint {
        place(self.file, self.text, span, complaint)
    }

    fn locate(&self, path: &[&str]) -> Option<Range<usize>> {
        let (mut table, mut span) = (self.table(), None);
        for name in path {
            let Some((key, value)) = table.iter().find(|(key, _)| key.get_ref() == name) else { break };
            span = Some(key.span());
            match value.get_ref() {
                DeValue::Table(inner) => table = inner,
                _ => break,
            }
        }
        span
    }
}

fn from_toml(file: &str, text: &str, error: &toml::de::Error) -> Complaint {
    place(file, text, error.span().unwrap_or(0..0), meant::complaint(error.message()))
}

fn place(file: &str, text: &str, span: Range<usize>, complaint: Complaint) -> Complaint {
    let before = &text[..span.start.min(text.len())];
    let line_start = before.rfind('\n').map_or(0, |i| i + 1);
    let line = before.matches('\n').count() + 1;
    let column = before[line_start..].chars().count() + 1;
    let content = text[line_start..].lines().next().unwrap_or_default().to_owned();
    Complaint { line: Some((line, column)), text: Some(content), ..complaint.in_file(file) }
}
