//! Text tables: fitted to the terminal by hiding the least important columns first. The text of the last column stands
//! beside the others where there is room, else below its row; it is broken between words and never cut.

use std::fmt::Write as _;

use report::StateBadge;

use crate::output::escape;

const GAP: usize = 2;
/// Minimum width to which text is cut.
const LEAST_TEXT: usize = 6;
/// Width of the last text column below which its text stands below the row.
const LEAST_BESIDE: usize = 60;
const INDENT: usize = 4;

#[derive(Debug, Clone, Copy)]
pub(crate) struct Column {
    /// Heading, with the unit in brackets.
    pub heading: &'static str,
    pub right: bool,
    /// Rank: 0 is never hidden, the others from the highest down.
    pub rank: u8,
}

pub(crate) const fn text(heading: &'static str, rank: u8) -> Column {
    Column { heading, right: false, rank }
}

pub(crate) const fn number(heading: &'static str, rank: u8) -> Column {
    Column { heading, right: true, rank }
}

/// Columns of rows: each with the text of its cells.
pub(crate) type Columns<'c, R> = [(Column, &'c dyn Fn(&R) -> String)];

/// A table of rows within the width of the terminal; a pipe gets all columns. Without rows it is empty.
pub(crate) fn of<'r, R: 'r>(rows: impl IntoIterator<Item = &'r R>, columns: &Columns<'_, R>) -> String {
    let cells = |row: &'r R| columns.iter().map(|(_, cell)| cell(row)).collect();
    let rows: Vec<Vec<String>> = rows.into_iter().map(cells).collect();
    if rows.is_empty() {
        return String::new();
    }
    layout(&columns.iter().map(|(column, _)| *column).collect::<Vec<_>>(), &rows)
}

/// The same for cells that are text already.
pub(crate) fn layout(columns: &[Column], rows: &[Vec<String>]) -> String {
    within(columns, rows, terminal_width())
}

fn within(columns: &[Column], rows: &[Vec<String>], width: usize) -> String {
    let escaped = |row: &Vec<String>| row.iter().map(|cell| escape(cell)).collect();
    let rows: Vec<Vec<String>> = rows.iter().map(escaped).collect();
    let mut kept: Vec<usize> = (0..columns.len()).collect();
    let is_least = |i: &usize| columns[*i].rank == 0;
    let least: Vec<usize> = kept.iter().copied().filter(is_least).collect();
    let below = kept.last().copied().filter(|&last| is_prose(columns, last));
    let below = below.filter(|_| needed(columns, &rows, &least) > width);
    kept.retain(|&i| Some(i) != below);
    let mut order = kept.clone();
    order.sort_by_key(|&i| std::cmp::Reverse(columns[i].rank));
    let mut hidden = 0;
    for out in order {
        if needed(columns, &rows, &kept) <= width || columns[out].rank == 0 {
            break;
        }
        kept.retain(|&i| i != out);
        hidden += 1;
    }
    let widths = widths(columns, &rows, &kept, width);
    let headings: Vec<String> = columns.iter().map(|column| column.heading.to_owned()).collect();
    let mut page = lines(columns, &kept, &widths, &headings);
    for row in &rows {
        page.push_str(&lines(columns, &kept, &widths, row));
        if let Some(below) = below.filter(|&below| row[below] != empty_cell()) {
            page.push_str(&indented(&row[below], INDENT, width));
        }
    }
    if hidden > 0 {
        let _ = writeln!(page, "{} hidden; `| less -S` shows all", count(hidden, "column"));
    }
    page
}

/// The lines of one row: the text of the last column continues below itself.
fn lines(columns: &[Column], kept: &[usize], widths: &[usize], row: &[String]) -> String {
    let mut line = String::new();
    for (&i, &width) in kept.iter().zip(widths) {
        let start = line.chars().count();
        let text = match &row[i] {
            prose if is_prose(columns, i) && !is_path(prose) => {
                wrapped(prose, width).join(&format!("\n{}", " ".repeat(start)))
            }
            text => shortened(text, width),
        };
        let blanks = " ".repeat(width.saturating_sub(text.chars().count()));
        let (before, after) =
            if columns[i].right { (blanks, String::new()) } else { (String::new(), blanks) };
        line.extend([before, text, after, " ".repeat(GAP)]);
    }
    line.truncate(line.trim_end().len());
    line + "\n"
}

/// Whether a column holds sentences: the last one, if it is text.
fn is_prose(columns: &[Column], i: usize) -> bool {
    i + 1 == columns.len() && !columns[i].right
}

/// A text in lines of a width, broken between words. A longer word has a line of its own.
fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split(' ') {
        let used = lines.last().map_or(0, |line| line.chars().count());
        match lines.last_mut() {
            Some(line) if used == 0 => line.push_str(word),
            Some(line) if used + 1 + word.chars().count() <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// A text in indented lines of a width, each with its end.
fn indented(text: &str, indent: usize, width: usize) -> String {
    let lines = wrapped(text, width.saturating_sub(indent).max(LEAST_TEXT));
    let blanks = " ".repeat(indent);
    let lines: Vec<&str> = lines.iter().map(|line| line.trim_end()).collect();
    format!("{blanks}{}\n", lines.join(&format!("\n{blanks}")))
}

/// A label and its text in lines of the terminal's width; further lines begin below the text.
pub(crate) fn labelled(label: &str, text: &str) -> String {
    let indent = label.chars().count();
    let lines = indented(&escape(text), indent, terminal_width());
    format!("{label}{}", lines.get(indent..).unwrap_or_default())
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
    if is_prose(columns, i) {
        return LEAST_BESIDE;
    }
    let digits = |text: &str| text.chars().collect::<Vec<_>>().iter().rposition(char::is_ascii_digit);
    let cells = rows.iter().map(|row| row[i].as_str()).filter(|text| !is_path(text));
    cells.filter_map(digits).map(|last| last + 2).max().unwrap_or(0).max(LEAST_TEXT)
}

fn is_path(text: &str) -> bool {
    text.contains('/') && !text.contains(' ')
}

fn wide(columns: &[Column], rows: &[Vec<String>], i: usize) -> usize {
    let cells = rows.iter().map(|row| row[i].chars().count());
    cells.chain([columns[i].heading.chars().count()]).max().unwrap_or(0)
}

fn needed(columns: &[Column], rows: &[Vec<String>], kept: &[usize]) -> usize {
    let width = |i: usize| {
        let width = wide(columns, rows, i);
        if is_prose(columns, i) { width.min(LEAST_BESIDE) } else { width }
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

pub(crate) fn hours(h: Option<f64>) -> String {
    h.map_or_else(empty_cell, |h| format!("{h:.0}"))
}

pub(crate) fn empty_cell() -> String {
    "–".to_owned()
}

pub(crate) fn or_dash(text: Option<&str>) -> String {
    text.map_or_else(empty_cell, str::to_owned)
}

pub(crate) fn unit_name(part: Option<&str>, serial: &str) -> String {
    format!("{} / {serial}", part.unwrap_or("–"))
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
            assert_eq!(table.lines().count() > 3, table.contains(" hidden; "), "{table}");
        }
    }

    #[test]
    fn the_last_column_stands_beside_the_others_or_below_and_nothing_of_it_is_lost() {
        let columns = [text("unit", 0), number("gap µm", 0), text("flights", 1), text("reason", 0)];
        let reason = "could reach the limit within 348 FH (5 % point); planning horizon 500 FH";
        let rows = [["1040-0009", "110.2 ± 3.9", "322", reason].map(str::to_owned).to_vec()];
        for (width, has_heading) in [(50, false), (90, true), (200, true)] {
            let table = within(&columns, &rows, width);
            assert!(table.lines().all(|line| line.chars().count() <= width), "{table}");
            let words: Vec<&str> = table.split_whitespace().collect();
            assert!(reason.split(' ').all(|word| words.contains(&word)), "{table}");
            assert_eq!(table.contains("reason"), has_heading, "{table}");
        }
        assert!(within(&columns, &rows, 28).contains("1 column hidden;"));
    }
}
