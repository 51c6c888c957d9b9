//! Tables for people: as wide as the terminal, the least important columns left out first.

use comfy_table::{CellAlignment, ContentArrangement, Table as Grid};

use crate::talk::escape;

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
    let mut text = grid(columns, rows, &kept, width);
    text.push('\n');
    if kept.len() < columns.len() {
        let note = format!("{} of {} columns fit; `--format csv` has all\n", kept.len(), columns.len());
        text.push_str(&note);
    }
    text
}

fn grid(columns: &[Column], rows: &[Vec<String>], kept: &[usize], width: usize) -> String {
    let mut grid = Grid::new();
    grid.load_style(comfy_table::presets::NOTHING).set_header(kept.iter().map(|&i| columns[i].heading));
    for row in rows {
        grid.add_row(kept.iter().map(|&i| escape(&row[i])));
    }
    for (at, &i) in kept.iter().enumerate() {
        if let Some(column) = grid.column_mut(at) {
            column.set_padding((0, 2));
            if columns[i].right {
                column.set_cell_alignment(CellAlignment::Right);
            }
        }
    }
    if width < usize::MAX {
        grid.set_content_arrangement(ContentArrangement::Dynamic)
            .set_width(u16::try_from(width).unwrap_or(u16::MAX));
        grid.set_truncation_indicator("…");
    }
    let lines: Vec<String> = grid.lines().map(|line| line.trim_end().to_owned()).collect();
    lines.join("\n")
}

fn needed(columns: &[Column], rows: &[Vec<String>], kept: &[usize]) -> usize {
    let wide = |i: usize| {
        let cells = rows.iter().map(|row| row[i].chars().count());
        cells.chain([columns[i].heading.chars().count()]).max().unwrap_or(0) + 2
    };
    kept.iter().map(|&i| wide(i)).sum()
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
