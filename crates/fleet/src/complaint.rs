//! A complaint: what went wrong, where, what was found, what was wanted and what to do about it.
//!
//! Every crate has its own error enum; this is the one form in which an error reaches a person, the
//! account of a run and a script, so that all three tell the same story.

use std::fmt;

use serde::{Deserialize, Serialize};

/// One thing wrong with one file, in words its owner can act on.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Complaint {
    /// Stable, lower case; scripts match on it.
    pub code: String,
    /// One sentence without blame and without a full stop.
    pub what: String,
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
    /// What stands there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub found: Option<String>,
    /// What should stand there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wanted: Option<String>,
    /// What to do.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hint: Option<String>,
}

impl Complaint {
    /// A complaint with nothing but its code and its sentence.
    pub fn new(code: impl Into<String>, what: impl fmt::Display) -> Self {
        Self { code: code.into(), what: what.to_string(), ..Self::default() }
    }

    /// Names the file.
    #[must_use]
    pub fn in_file(mut self, file: impl fmt::Display) -> Self {
        self.file = Some(file.to_string());
        self
    }

    /// Says what to do.
    #[must_use]
    pub fn hint(mut self, hint: impl fmt::Display) -> Self {
        self.hint = Some(hint.to_string());
        self
    }

    /// Column, row and row group in one phrase; nothing when none is known.
    pub fn place(&self) -> Option<String> {
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

/// The anatomy of `docs/errors.md`, without colour: the first line is the error, the rest is indented.
impl fmt::Display for Complaint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "error[{}]: {}", self.code, self.what)?;
        if let (Some(file), Some((line, column))) = (&self.file, self.line) {
            write!(f, "\n  {file}:{line}:{column}")?;
            if let Some(text) = &self.text {
                write!(f, "   {}", text.trim())?;
            }
        } else if let Some(file) = &self.file {
            write!(f, "\n  file    {file}")?;
        }
        if let Some(place) = self.place() {
            write!(f, "\n  at      {place}")?;
        }
        for (label, value) in [("found ", &self.found), ("wanted", &self.wanted)] {
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
        let c = Complaint {
            column: Some("t_ns".into()),
            row: Some(9),
            found: Some("12:04:07 after 12:04:09".into()),
            ..Complaint::new("time_goes_back", "the clock runs backwards")
                .in_file("a.parquet")
                .hint("sort it")
        };
        let text = "error[time_goes_back]: the clock runs backwards\n  file    a.parquet\n  at      column `t_ns`, row 9\n  found   12:04:07 after 12:04:09\nhint: sort it";
        assert_eq!(c.to_string(), text);
    }
}
