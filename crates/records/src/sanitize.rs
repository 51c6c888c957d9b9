//! Text of strangers made harmless: names in logs and tables reach terminals, tables, pages and spreadsheets.
//!
//! A serial number may hold an escape sequence that moves the cursor, a right-to-left override that shows 47 µm as
//! 74, or a formula that a spreadsheet executes. Every surface uses these functions, so that no surface forgets one.

use std::borrow::Cow;
use std::fmt::Write;

pub(crate) const MAX_FIELD_CHARS: usize = 2000;

/// Whether a character has an effect without being seen: controls, direction marks and overrides, zero widths, fillers,
/// variation selectors and tags (Unicode Standard Annex 9; UTR 36; `Default_Ignorable_Code_Point`).
fn is_invisible(c: char) -> bool {
    (c.is_control() && !matches!(c, '\n' | '\t'))
        || matches!(c, '\u{ad}' | '\u{34f}' | '\u{61c}' | '\u{115f}' | '\u{1160}' | '\u{17b4}' | '\u{17b5}')
        || matches!(c, '\u{180b}'..='\u{180f}' | '\u{200b}'..='\u{200f}' | '\u{3164}' | '\u{feff}' | '\u{ffa0}')
        || matches!(c, '\u{fe00}'..='\u{fe0f}' | '\u{e0000}'..='\u{e0fff}')
        || ('\u{2028}'..='\u{202e}').contains(&c)
        || ('\u{2060}'..='\u{206f}').contains(&c)
}

fn escape(text: &str, is_hidden: impl Fn(char) -> bool) -> Cow<'_, str> {
    if !text.chars().any(&is_hidden) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if is_hidden(c) {
            // Writing into a string does not fail.
            let _ = write!(shown, "[U+{:04X}]", u32::from(c));
        } else {
            shown.push(c);
        }
    }
    Cow::Owned(shown)
}

/// Replaces invisible characters by their code points, such as `[U+202E]`; line feeds and tabs stay.
pub fn escape_invisible(text: &str) -> Cow<'_, str> {
    escape(text, is_invisible)
}

/// As [`escape_invisible`], of text that must stay on its line: a cell of a table, or a name in a sentence.
pub fn escape_cell(text: &str) -> Cow<'_, str> {
    escape(text, |c| is_invisible(c) || matches!(c, '\n' | '\t'))
}

/// Truncates a text to a number of characters, and appends how many were omitted.
pub(crate) fn limit_length(text: &str, max_chars: usize) -> Cow<'_, str> {
    match text.char_indices().nth(max_chars) {
        None => Cow::Borrowed(text),
        Some((end, _)) => {
            let left_out = text[end..].chars().count();
            Cow::Owned(format!("{}… ({left_out} more characters)", &text[..end]))
        }
    }
}

/// A text cell of a CSV file that no spreadsheet takes for a formula (OWASP, *CSV Injection*): an apostrophe stands before
/// a first `=`, `+`, `-`, `@` (full-width too), tab or carriage return, unless the whole cell is a number. Control
/// characters and direction overrides are replaced by their code points.
///
/// ```
/// # use records::sanitize::csv_cell;
/// assert_eq!(csv_cell("=cmd|'/c calc'!A1"), "'=cmd|'/c calc'!A1");
/// assert_eq!(csv_cell("-1.5e-5"), "-1.5e-5");
/// ```
pub fn csv_cell(text: &str) -> Cow<'_, str> {
    let is_hidden = |c: char| is_invisible(c) && c != '\r';
    let is_formula = text.starts_with(['=', '+', '-', '@', '\t', '\r', '＝', '＋', '－', '＠'])
        && text.parse::<f64>().is_err();
    match (is_formula, escape(text, is_hidden)) {
        (false, shown) => shown,
        (true, shown) => Cow::Owned(format!("'{shown}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// U+202E is RIGHT-TO-LEFT OVERRIDE, U+2066 LEFT-TO-RIGHT ISOLATE (Unicode Standard Annex 9).
    #[test]
    fn a_name_cannot_reverse_or_overwrite_the_text_beside_it() {
        assert_eq!(escape_invisible("S1\u{202e} (47.1)\n"), "S1[U+202E] (47.1)\n");
        assert_eq!(escape_cell("S1\n\u{2066}\u{1b}[31m\u{7}"), "S1[U+000A][U+2066][U+001B][31m[U+0007]");
        assert!(matches!(escape_invisible("1\u{202f}205 µm 🛩"), Cow::Borrowed(_)));
    }

    /// The first characters of the OWASP page *CSV Injection*.
    #[test]
    fn a_cell_is_no_formula_and_a_number_stays_a_number() {
        for formula in ["=1+1", "+1+1", "-1+1", "@SUM(1)", "\t=1", "\r=1"] {
            assert_eq!(csv_cell(formula), format!("'{formula}"));
        }
        for plain in ["-12.5", "+3", "N412FP", "", "2026-03-01T00:00:00Z", "inf", "-inf", "-0"] {
            assert!(matches!(csv_cell(plain), Cow::Borrowed(_)), "{plain}");
        }
        assert_eq!(csv_cell("a\u{1b}[2Jb\u{202e}"), "a[U+001B][2Jb[U+202E]");
    }

    #[test]
    fn a_long_text_is_cut_between_characters() {
        assert_eq!(limit_length("µµµµ", 4), "µµµµ");
        assert_eq!(limit_length("µµµµ", 3), "µµµ… (1 more characters)");
    }
}
