//! Tables for people: as wide as the terminal, the least important columns left out first.

use comfy_table::{CellAlignment, Table as Grid};

use crate::talk::escape;

/// Blanks between two columns.
const GAP: usize = 2;
/// Text is not cut to less than this.
const LEAST_TEXT: usize = 8;

/// A column of a table.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Column {
    /// Its heading, with its unit.
    pub heading: &'static str,
    /// Numbers stand to the right.
    pub right: bool,
    /// 0 stays longest.
    pub rank: u8,
}

/// Text to the left.
pub(crate) const fn text(heading: &'static str, rank: u8) -> Column {
    Column { heading, right: false, rank }
}

/// Numbers to the right.
pub(crate) const fn number(heading: &'static str, rank: u8) -> Column {
    Column { heading, right: true, rank }
}

/// Lays out rows within the width of the terminal; a pipe gets everything.
pub(crate) fn layout(columns: &[Column], rows: &[Vec<String>]) -> String {
    let width = terminal_width();
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
        let note = format!("{} of {} columns fit; `--format csv` has all\n", kept.len(), columns.len());
        text.push_str(&note);
    }
    text
}

fn grid(columns: &[Column], rows: &[Vec<String>], kept: &[usize], widths: &[usize]) -> String {
    let mut grid = Grid::new();
    let line = |cell: &dyn Fn(usize) -> String| -> Vec<String> {
        kept.iter().zip(widths).map(|(&i, &width)| shortened(&cell(i), width)).collect()
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

/// Text that is too long for its column: a path keeps its end, a sentence its beginning.
fn shortened(text: &str, width: usize) -> String {
    let length = text.chars().count();
    if length <= width {
        text.to_owned()
    } else if text.contains('/') && !text.contains(' ') {
        std::iter::once('…').chain(text.chars().skip(length + 1 - width)).collect()
    } else {
        text.chars().take(width - 1).chain(std::iter::once('…')).collect()
    }
}

/// How wide each column may be: text gives way, the widest first; a number is never cut.
fn widths(columns: &[Column], rows: &[Vec<String>], kept: &[usize], width: usize) -> Vec<usize> {
    let mut widths: Vec<usize> = kept.iter().map(|&i| wide(columns, rows, i)).collect();
    while widths.iter().map(|w| w + GAP).sum::<usize>() > width.saturating_add(GAP) {
        let text = (0..kept.len()).filter(|&at| widths[at] > LEAST_TEXT && is_words(columns, rows, kept[at]));
        let Some(widest) = text.max_by_key(|&at| widths[at]) else { break };
        widths[widest] -= 1;
    }
    widths
}

/// Whether a column may be cut: neither numbers nor dates.
fn is_words(columns: &[Column], rows: &[Vec<String>], i: usize) -> bool {
    let date = |row: &Vec<String>| row[i].starts_with(|c: char| c.is_ascii_digit() || c == '–');
    !columns[i].right && !rows.iter().all(date)
}

fn wide(columns: &[Column], rows: &[Vec<String>], i: usize) -> usize {
    let cells = rows.iter().map(|row| escape(&row[i]).chars().count());
    cells.chain([columns[i].heading.chars().count()]).max().unwrap_or(0)
}

fn needed(columns: &[Column], rows: &[Vec<String>], kept: &[usize]) -> usize {
    kept.iter().map(|&i| wide(columns, rows, i) + GAP).sum::<usize>().saturating_sub(GAP)
}

/// Columns of the terminal on stdout; a pipe has no edge.
fn terminal_width() -> usize {
    let columns = console::Term::stdout().size_checked().map(|(_, columns)| usize::from(columns));
    columns.unwrap_or(usize::MAX)
}

/// Micrometres with one decimal, or a dash.
pub(crate) fn micrometres(m: Option<f64>) -> String {
    m.map_or_else(dash, |m| format!("{:.1}", m * 1e6))
}

/// Whole hours, or a dash.
pub(crate) fn hours(h: Option<f64>) -> String {
    h.map_or_else(dash, |h| format!("{h:.0}"))
}

/// What stands where nothing is known.
pub(crate) fn dash() -> String {
    "–".to_owned()
}

/// `1 log`, `2 logs`.
pub(crate) fn count(n: usize, what: &str) -> String {
    format!("{n} {what}{}", if n == 1 { "" } else { "s" })
}

/// A state as word and shape, told apart without colour.
pub(crate) fn state_mark(state: Option<&str>) -> String {
    let shape = match state {
        Some("act") => "◆",
        Some("plan") => "▲",
        Some("watch") => "●",
        Some("normal") => "○",
        _ => "–",
    };
    state.map_or_else(|| shape.to_owned(), |word| format!("{shape} {word}"))
}
