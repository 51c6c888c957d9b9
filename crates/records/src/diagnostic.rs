//! Structured error for users: code, message, location, found and expected value, and a hint.
//!
//! Every crate has its own error type. [`Diagnostic`] is the one form in which an error reaches the terminal,
//! the run summary and a script, so that all three report the same.

use std::borrow::Cow;
use std::fmt;

use crate::sanitize::{MAX_FIELD_CHARS, escape_cell, escape_invisible, limit_length};
use serde::{Deserialize, Serialize, Serializer};

/// One error in one file, with a hint that its owner can act on.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Diagnostic {
    /// Stable, lower case; scripts match on it.
    pub code: String,
    /// One sentence without blame and without a full stop.
    #[serde(rename = "what", serialize_with = "serialize_masked")]
    pub message: String,
    /// The file: a log, a table, the configuration.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "serialize_masked_option")]
    pub file: Option<String>,
    /// Line and column in a text file, from 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub line: Option<(usize, usize)>,
    /// The text of that line.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "serialize_masked_option")]
    pub text: Option<String>,
    /// The column of a table or log.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "serialize_masked_option")]
    pub column: Option<String>,
    /// The row: of a log from 0, of a table from 1, header excluded.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub row: Option<u64>,
    /// The row group of a Parquet file, from 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub row_group: Option<u64>,
    /// The value that was found.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "serialize_masked_option")]
    pub found: Option<String>,
    /// The value that was expected.
    #[serde(
        rename = "wanted",
        skip_serializing_if = "Option::is_none",
        serialize_with = "serialize_masked_option"
    )]
    pub expected: Option<String>,
    /// Instruction that resolves the error.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "serialize_masked_option")]
    pub hint: Option<String>,
}

impl Diagnostic {
    /// A diagnostic with its code and message only.
    pub fn new(code: impl Into<String>, message: impl fmt::Display) -> Self {
        Self { code: code.into(), message: message.to_string(), ..Self::default() }
    }

    /// Sets the file.
    #[must_use]
    pub fn in_file(mut self, file: impl fmt::Display) -> Self {
        self.file = Some(file.to_string());
        self
    }

    /// Sets the hint.
    #[must_use]
    pub fn hint(mut self, hint: impl fmt::Display) -> Self {
        self.hint = Some(hint.to_string());
        self
    }

    /// Column, row and row group as one phrase; `None` when none is known.
    pub fn location(&self) -> Option<String> {
        let parts = [
            self.column.as_ref().map(|c| format!("column `{c}`")),
            self.row.map(|r| format!("row {r}")),
            self.row_group.map(|g| format!("row group {g}")),
        ];
        let known: Vec<String> = parts.into_iter().flatten().collect();
        (!known.is_empty()).then(|| known.join(", "))
    }
}

/// Masks the credentials of addresses in a text: `user:password@` before a host or bucket, and signed queries.
///
/// A diagnostic may quote a line of the configuration, and ends up on terminals, in logs and in tickets.
fn mask_credentials(text: &str) -> Cow<'_, str> {
    const SIGNATURES: [&str; 5] = ["sig=", "signature=", "-signature=", "token=", "secret="];
    let (mut masked, mut rest) = (String::new(), text);
    while let Some(at) = rest.find("://") {
        let (before, address) = rest.split_at(at + 3);
        let end = address.find(|c: char| c.is_whitespace() || "\"'`<>".contains(c)).unwrap_or(address.len());
        let (address, after) = address.split_at(end);
        let authority = address.split('/').next().unwrap_or(address);
        let user = authority.contains('@').then(|| address.find('@')).flatten();
        masked.push_str(before);
        masked.push_str(if user.is_some() { "***@" } else { "" });
        let path = user.map_or(address, |at| &address[at + 1..]);
        let query = path.find('?').filter(|at| {
            let query = path[*at..].to_ascii_lowercase();
            SIGNATURES.iter().any(|name| query.contains(name))
        });
        masked.push_str(&path[..query.unwrap_or(path.len())]);
        masked.push_str(if query.is_some() { "?***" } else { "" });
        rest = after;
    }
    masked.push_str(rest);
    if masked == text { Cow::Borrowed(text) } else { Cow::Owned(masked) }
}

fn serialize_masked<S: Serializer>(text: &str, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_str(&mask_credentials(&limit_length(text, MAX_FIELD_CHARS)))
}

#[expect(clippy::ref_option, reason = "serde passes the field")]
fn serialize_masked_option<S: Serializer>(text: &Option<String>, to: S) -> Result<S::Ok, S::Error> {
    let limited = text.as_deref().map(|text| limit_length(text, MAX_FIELD_CHARS));
    limited.as_deref().map(mask_credentials).serialize(to)
}

/// A field as people see it: on its line, without credentials, invisible characters, or more text than they can take in.
fn readable(text: &str) -> String {
    let masked = mask_credentials(text);
    escape_cell(&limit_length(&masked, MAX_FIELD_CHARS)).into_owned()
}

/// The layout of `docs/errors.md`, without colour: the first line is the error, the other lines are indented.
impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "error[{}]: {}", self.code, readable(&self.message))?;
        let file = self.file.as_deref().map(readable);
        if let (Some(file), Some((line, column))) = (&file, self.line) {
            write!(f, "\n  {file}:{line}:{column}")?;
            if let Some(text) = &self.text {
                write!(f, "   {}", readable(text.trim()))?;
            }
        } else if let Some(file) = &file {
            write!(f, "\n  file    {file}")?;
        }
        if let Some(location) = self.location() {
            write!(f, "\n  at      {}", readable(&location))?;
        }
        for (label, value) in [("found ", &self.found), ("wanted", &self.expected)] {
            if let Some(value) = value {
                write!(f, "\n  {label}  {}", readable(value))?;
            }
        }
        if let Some(hint) = &self.hint {
            // A hint may have several lines. Those after the first are indented, so that none looks like another diagnostic.
            let masked = mask_credentials(hint);
            let lines = escape_invisible(&limit_length(&masked, MAX_FIELD_CHARS)).replace('\n', "\n  ");
            write!(f, "\nhint: {lines}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A mapped column may have any name, also of 64 MiB; its first characters identify it.
    #[test]
    fn a_long_or_hostile_name_leaves_a_short_and_harmless_message() {
        let name = "\u{1b}[2J\u{202e}".to_owned() + &"x".repeat(64 << 20);
        let diagnostic = Diagnostic {
            column: Some(name.clone()),
            text: Some(name.clone()),
            line: Some((1, 1)),
            found: Some(name.clone()),
            ..Diagnostic::new("column_missing", format!("no column `{name}`"))
                .in_file("a.parquet")
                .hint(&name)
        };
        for shown in [diagnostic.to_string(), serde_json::to_string(&diagnostic).unwrap()] {
            assert!(shown.len() < 20_000, "{} bytes", shown.len());
            assert!(shown.contains("more characters"));
        }
        let shown = diagnostic.to_string();
        assert!(shown.contains("[U+001B][2J[U+202E]xxx") && !shown.contains('\u{1b}'));
    }
}
