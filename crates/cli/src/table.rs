//! Text tables: fitted to the terminal by hiding the least important columns first; the text of the last column wraps.

use comfy_table::{CellAlignment, Table as Grid};
use report::StateBadge;

use crate::output::escape;

/// Blanks between two columns.
const GAP: usize = 2;
/// Minimum width to which text is cut.
const LEAST_TEXT: usize = 6;
/// Width of the last column from which columns are hidden instead of wrapping it more.
const LEAST_WRAPPED: usize = 20;

/// A column of a table.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Column {
    /// Heading, with the unit in brackets.
    pub heading: &'static str,
    /// Whether the column is right-aligned.
    pub right: bool,
    /// Rank: 0 is hidden last.
    pub rank: u8,
}

/// Left-aligned text column.
pub(crate) const fn text(heading: &'static str, rank: u8) -> Column {
    Column { heading, right: false, rank }
}

/// Right-aligned number column.
pub(crate) const fn number(heading: &'static str, rank: u8) -> Column {
    Column { heading, right: true, rank }
}

/// Lays out rows within the width of the terminal; a pipe gets all columns.
pub(crate) fn layout(columns: &[Column], rows: &[Vec<String>]) -> String {
    within(columns, rows, terminal_width())
}

fn within(columns: &[Column], rows: &[Vec<String>], width: usize) -> String {
    let mut kept: Vec<usize> = (0..columns.len()).collect();
    let mut order: Vec<usize> = kept.clone();
    order.sort_by_key(|&i| std::cmp::Reverse(columns[i].rank));
    for out in order {
        if needed(columns, rows, &kept) <= width || columns[out].rank == 0 {
            break;
        }
        kept.retain(|&i| i != out);
    }
    let mut text = grid(columns, rows, &kept, &widths(columns, rows, &kept, width));
    text.push('\n');
    if kept.len() < columns.len() {
        let hidden = (0..columns.len()).filter(|i| !kept.contains(i)).map(|i| columns[i].heading);
        let note = format!(
            "hidden: {}; see all in a wider terminal or with `| less -S`",
            hidden.collect::<Vec<_>>().join(", ")
        );
        text.push_str(&wrapped(&note, width));
        text.push('\n');
    }
    text
}

fn grid(columns: &[Column], rows: &[Vec<String>], kept: &[usize], widths: &[usize]) -> String {
    let mut grid = Grid::new();
    let fitted = |i: usize, text: &str, width: usize| {
        if wraps(columns, i) { wrapped(text, width) } else { shortened(text, width) }
    };
    let line = |cell: &dyn Fn(usize) -> String| -> Vec<String> {
        kept.iter().zip(widths).map(|(&i, &width)| fitted(i, &cell(i), width)).collect()
    };
    grid.load_style(comfy_table::presets::NOTHING).set_header(line(&|i| columns[i].heading.to_owned()));
    for row in rows {
        grid.add_row(line(&|i| escape(&row[i])));
    }
    for (at, &i) in kept.iter().enumerate() {
        if let Some(column) = grid.column_mut(at) {
            column.set_padding((0, GAP as u16));
            if columns[i].right {
                column.set_cell_alignment(CellAlignment::Right);
            }
        }
    }
    let lines: Vec<String> = grid.lines().map(|line| line.trim_end().to_owned()).collect();
    lines.join("\n")
}

/// Whether a column wraps: the last one, if it is text.
fn wraps(columns: &[Column], i: usize) -> bool {
    i + 1 == columns.len() && !columns[i].right
}

/// Text in lines of a width, broken between words; a longer word is shortened.
fn wrapped(text: &str, width: usize) -> String {
    if text.chars().count() <= width || is_path(text) {
        return shortened(text, width);
    }
    let mut lines = vec![String::new()];
    for word in text.split(' ').map(|word| shortened(word, width)) {
        let used = lines.last().map_or(0, |line| line.chars().count());
        match lines.last_mut() {
            Some(line) if used == 0 => line.push_str(&word),
            Some(line) if used + 1 + word.chars().count() <= width => {
                line.push(' ');
                line.push_str(&word);
            }
            _ => lines.push(word),
        }
    }
    lines.join("\n")
}

/// Shortens text to a width: a path keeps its end, other text its beginning.
fn shortened(text: &str, width: usize) -> String {
    let length = text.chars().count();
    if length <= width {
        text.to_owned()
    } else if is_path(text) {
        std::iter::once('…').chain(text.chars().skip(length + 1 - width)).collect()
    } else {
        text.chars().take(width - 1).chain(std::iter::once('…')).collect()
    }
}

/// Column widths: text columns are narrowed, the widest first; numbers are never cut.
fn widths(columns: &[Column], rows: &[Vec<String>], kept: &[usize], width: usize) -> Vec<usize> {
    let mut widths: Vec<usize> = kept.iter().map(|&i| wide(columns, rows, i)).collect();
    let least: Vec<usize> = kept.iter().map(|&i| min_width(columns, rows, i)).collect();
    while widths.iter().map(|w| w + GAP).sum::<usize>() > width.saturating_add(GAP) {
        let text = (0..kept.len()).filter(|&at| widths[at] > least[at]);
        let Some(widest) = text.max_by_key(|&at| widths[at]) else { break };
        widths[widest] -= 1;
    }
    widths
}

/// Minimum width of a column: the last digit of every cell stays visible, except in paths, which keep their end.
fn min_width(columns: &[Column], rows: &[Vec<String>], i: usize) -> usize {
    if columns[i].right {
        return usize::MAX;
    }
    if wraps(columns, i) {
        return LEAST_WRAPPED;
    }
    let digits = |text: &str| text.chars().collect::<Vec<_>>().iter().rposition(char::is_ascii_digit);
    let cells = rows.iter().map(|row| row[i].as_str()).filter(|text| !is_path(text));
    cells.filter_map(digits).map(|last| last + 2).max().unwrap_or(0).max(LEAST_TEXT)
}

fn is_path(text: &str) -> bool {
    text.contains('/') && !text.contains(' ')
}

fn wide(columns: &[Column], rows: &[Vec<String>], i: usize) -> usize {
    let cells = rows.iter().map(|row| escape(&row[i]).chars().count());
    cells.chain([columns[i].heading.chars().count()]).max().unwrap_or(0)
}

fn needed(columns: &[Column], rows: &[Vec<String>], kept: &[usize]) -> usize {
    let width = |i: usize| {
        let width = wide(columns, rows, i);
        if wraps(columns, i) { width.min(LEAST_WRAPPED) } else { width }
    };
    kept.iter().map(|&i| width(i) + GAP).sum::<usize>().saturating_sub(GAP)
}

/// Width for tables: the environment's `COLUMNS`, the terminal's on stdout, or unlimited for a pipe.
fn terminal_width() -> usize {
    let stated = std::env::var("COLUMNS").ok().and_then(|columns| columns.parse().ok());
    let terminal = || console::Term::stdout().size_checked().map(|(_, columns)| usize::from(columns));
    stated.filter(|&columns| columns > 0).or_else(terminal).unwrap_or(usize::MAX)
}

/// Micrometres with one decimal, or a dash.
pub(crate) fn micrometres(m: Option<f64>) -> String {
    m.map_or_else(empty_cell, |m| format!("{:.1}", m * 1e6))
}

/// Micrometres with half the width of the 90 % interval, `152.7 ± 3.9`, or a dash.
pub(crate) fn gap(gap_m: Option<f64>, half_width_m: Option<f64>) -> String {
    match half_width_m {
        Some(half_m) if gap_m.is_some() => format!("{} ± {:.1}", micrometres(gap_m), half_m * 1e6),
        _ => micrometres(gap_m),
    }
}

/// Whole hours, or a dash.
pub(crate) fn hours(h: Option<f64>) -> String {
    h.map_or_else(empty_cell, |h| format!("{h:.0}"))
}

/// Text of an empty cell.
pub(crate) fn empty_cell() -> String {
    "–".to_owned()
}

/// `1 log`, `2 logs`.
pub(crate) fn count(n: usize, what: &str) -> String {
    format!("{n} {what}{}", if n == 1 { "" } else { "s" })
}

/// State as shape and word, distinguishable without colour.
pub(crate) fn state_mark(state: Option<&str>) -> String {
    let shape = StateBadge::from_state(state).shape();
    state.map_or_else(|| shape.to_owned(), |word| format!("{shape} {word}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const COLUMNS: [Column; 5] =
        [text("log", 0), text("unit", 0), number("gap µm", 0), text("seen", 0), number("load N", 1)];

    fn rows() -> Vec<Vec<String>> {
        let row = |log: &str, unit: &str, gap: &str, seen: &str| {
            [log, unit, gap, seen, "-4800"].map(str::to_owned).to_vec()
        };
        vec![
            row("logs/N412FP/20261119_0413.parquet", "elevator left", "103.25", "moves 0.99856 for 1"),
            row("logs/N412FP/20261120_0822.parquet", "aileron", "9.5", "–"),
        ]
    }

    #[test]
    fn a_table_keeps_to_the_terminal_and_cuts_no_number() {
        for width in [56, 60, 80, 100] {
            let table = within(&COLUMNS, &rows(), width);
            assert!(table.lines().all(|line| line.chars().count() <= width), "{width}:\n{table}");
            assert!(table.contains("103.25") && table.contains("0.99856") && table.contains("0413.parquet"));
            assert_eq!(table.lines().count() > 3, table.contains("hidden: "), "{table}");
        }
    }

    #[test]
    fn the_last_column_wraps_between_words_and_nothing_of_it_is_lost() {
        let columns = [text("unit", 0), number("gap µm", 0), text("flights", 1), text("reason", 0)];
        let reason = "could reach the limit within 348 FH (5 % point); planning horizon 500 FH";
        let rows = [["1040-0009", "110.2 ± 3.9", "322", reason].map(str::to_owned).to_vec()];
        let table = within(&columns, &rows, 50);
        assert!(table.lines().all(|line| line.chars().count() <= 50), "{table}");
        let words: Vec<&str> = table.split_whitespace().collect();
        assert!(reason.split(' ').all(|word| words.contains(&word)), "{table}");
        assert!(table.contains("hidden: flights;"), "{table}");
    }

    #[test]
    fn a_pipe_gets_everything() {
        let table = within(&COLUMNS, &rows(), usize::MAX);
        assert!(table.contains("logs/N412FP/20261119_0413.parquet") && table.contains("-4800"), "{table}");
        assert!(!table.contains('…'), "{table}");
    }
}
