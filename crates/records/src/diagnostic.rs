//! Structured error for users: code, message, location, found and expected value, and a hint.
//!
//! Every crate has its own error enum. [`Diagnostic`] is the one form in which an error reaches the terminal,
//! the run summary and a script, so that all three report the same.

use std::fmt;

use serde::{Deserialize, Serialize};

/// One error in one file, with a hint that its owner can act on.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Diagnostic {
    /// Stable, lower case; scripts match on it.
    pub code: String,
    /// One sentence without blame and without a full stop.
    #[serde(rename = "what")]
    pub message: String,
    /// The file: a log, a table, the configuration.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// Line and column in a text file, from 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub line: Option<(usize, usize)>,
    /// The text of that line.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub text: Option<String>,
    /// The column of a table or log.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub column: Option<String>,
    /// The row: of a log from 0, of a table from 1, header excluded.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub row: Option<u64>,
    /// The row group of a Parquet file, from 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub row_group: Option<u64>,
    /// The value that was found.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub found: Option<String>,
    /// The value that was expected.
    #[serde(rename = "wanted", skip_serializing_if = "Option::is_none")]
    pub expected: Option<String>,
    /// Instruction that resolves the error.
    #[serde(skip_serializing_if = "Option::is_none")]
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
        let parts: Vec<String> = [
            self.column.as_ref().map(|c| format!("column `{c}`")),
            self.row.map(|r| format!("row {r}")),
            self.row_group.map(|g| format!("row group {g}")),
        ]
        .into_iter()
        .flatten()
        .collect();
        (!parts.is_empty()).then(|| parts.join(", "))
    }
}

/// The layout of `docs/errors.md`, without colour: the first line is the error, the other lines are indented.
impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "error[{}]: {}", self.code, self.message)?;
        if let (Some(file), Some((line, column))) = (&self.file, self.line) {
            write!(f, "\n  {file}:{line}:{column}")?;
            if let Some(text) = &self.text {
                write!(f, "   {}", text.trim())?;
            }
        } else if let Some(file) = &self.file {
            write!(f, "\n  file    {file}")?;
        }
        if let Some(location) = self.location() {
            write!(f, "\n  at      {location}")?;
        }
        for (label, value) in [("found ", &self.found), ("wanted", &self.expected)] {
            if let Some(value) = value {
                write!(f, "\n  {label}  {value}")?;
            }
        }
        if let Some(hint) = &self.hint {
            write!(f, "\nhint: {hint}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_complaint_reads_from_what_to_remedy() {
        let c = Diagnostic {
            column: Some("t_ns".into()),
            row: Some(9),
            found: Some("12:04:07 after 12:04:09".into()),
            ..Diagnostic::new("time_goes_back", "the clock runs backwards")
                .in_file("a.parquet")
                .hint("sort it")
        };
        let text = "error[time_goes_back]: the clock runs backwards\n  file    a.parquet\n  at      column `t_ns`, row 9\n  found   12:04:07 after 12:04:09\nhint: sort it";
        assert_eq!(c.to_string(), text);
    }
}
