//! `check`: shows how logs are mapped, channel by channel, and what would be refused; reports no gap, writes nothing.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::sync::Arc;

use job::Config;
use job::part_identification::{IdentifiedParams, ParamComparison};
use pipeline::inspect::check::{ChannelCheck, LogCheck, RATIO, check_logs};
use pipeline::logs::discover;
use records::uncertainty::NORMAL_95;
use records::{Diagnostic, PartNumber};

use crate::args::{CheckArgs, Global};
use crate::commands::context::load_with_installations;
use crate::output::escape;
use crate::table::{self, number, text};
use crate::{Code, Failure, Output, row_output};

const MOST_WHOLE_LOGS: usize = 3;

/// Why page checksums matter, and how to write them.
const NO_CHECKSUMS: &str = "silent corruption would not be detected (`write_page_checksum=True` in pyarrow)";

/// Replaces the channel table if no actuator could be checked.
const NOTHING: &str = "  no actuator could be checked; see the errors below\n";

/// Checks logs and prints what was found.
///
/// # Errors
/// If configuration or tables are wrong. Failed logs make the exit code 1.
pub(crate) fn check(args: &CheckArgs, global: &Global, output: &Output) -> Result<Code, Failure> {
    let (config, installations) = load_with_installations(global)?;
    let selected = discover::select(&config, args.logs.as_deref(), args.limit)?;
    selected.notes.iter().for_each(|note| output.note(note));
    let count = selected.logs.len();
    let (config, installations) = (Arc::new(config), Arc::new(installations));
    let seen = check_logs(&config, &installations, selected);
    let channels = seen.channels();
    let is_short = count > MOST_WHOLE_LOGS && args.rows.output.is_none() && !output.is_verbose();
    let page =
        if is_short { overview(&seen.logs, &channels) } else { seen.logs.iter().map(log_page).collect() };
    let table = || {
        format!(
            "{page}{}{}{}",
            drift(&seen.logs),
            proposals(&seen.identified, &config),
            summary(count, &channels, &seen.diagnostics)
        )
    };
    row_output::write_rows(&args.rows, output, || row_output::batch(&channels), table)?;
    let diagnostics: Vec<Diagnostic> = seen.diagnostics.into_iter().chain(seen.mapping_faults).collect();
    output.diagnostics(&diagnostics);
    Ok(if diagnostics.is_empty() { Code::Success } else { Code::LogsInError })
}

fn overview(logs: &[LogCheck], channels: &[ChannelCheck]) -> String {
    let columns = [
        text("logs of one layout", 0),
        text("tails", 0),
        text("actuators", 0),
        text("clock", 1),
        number("with notes", 0),
        text("first log", 2),
    ];
    let mut layouts: BTreeMap<_, Vec<&LogCheck>> = BTreeMap::new();
    for log in logs {
        layouts.entry((&log.column_types, rate(log))).or_default().push(log);
    }
    let mut layouts: Vec<_> = layouts.into_iter().map(|((_, rate), logs)| (rate, logs)).collect();
    layouts.sort_by_key(|(_, logs)| std::cmp::Reverse(logs.len()));
    let line = |(rate, logs): &(String, Vec<&LogCheck>)| {
        let tails: BTreeSet<&str> = logs.iter().map(|log| log.flight[0].as_str()).collect();
        let actuators: BTreeSet<usize> = logs.iter().map(|log| positions(log).len()).collect();
        let actuators: Vec<String> = actuators.iter().map(usize::to_string).collect();
        let noted = logs.iter().filter(|log| log.channels.iter().any(ChannelCheck::is_warning)).count();
        let (logs_in_all, tails) = (table::count(logs.len(), "log"), table::count(tails.len(), "tail"));
        let first = logs.first().map_or_else(String::new, |log| log.name.clone());
        vec![logs_in_all, tails, actuators.join(", "), rate.clone(), noted.to_string(), first]
    };
    let mut page = table::layout(&columns, &layouts.iter().map(line).collect::<Vec<_>>());
    // Ratios differ from log to log, and mean the same.
    let kind = |channel: &ChannelCheck| {
        let note = channel.note.as_deref().unwrap_or_default();
        if note.starts_with(RATIO) {
            format!("{RATIO} differs from 1: check sign, unit, lead or gear ratio")
        } else {
            channel.note_and_remedy()
        }
    };
    let mut notes: BTreeMap<(&str, String), (usize, &ChannelCheck)> = BTreeMap::new();
    for channel in channels.iter().filter(|channel| channel.is_warning()) {
        notes.entry((channel.channel, kind(channel))).or_insert((0, channel)).0 += 1;
    }
    for ((channel, note), (count, first)) in notes {
        let note = format!("{count} × {channel}: {note} (first {}, {})", first.log, first.position);
        let _ = writeln!(page, "{}", escape(&note));
    }
    let without_checksums = logs.iter().filter(|log| log.has_checksums == Some(false)).count();
    if without_checksums > 0 {
        let logs = table::count(without_checksums, "log");
        let _ = writeln!(page, "{logs} without page checksums: {NO_CHECKSUMS}");
    }
    page.push_str("channels of each log: -v, --json, or name at most three logs\n\n");
    page
}

fn positions(log: &LogCheck) -> BTreeSet<&str> {
    log.channels.iter().map(|channel| channel.position.as_str()).collect()
}

/// The rate of a log, rounded: clocks of one recorder differ a little.
fn rate(log: &LogCheck) -> String {
    let rate_hz = log.clocks.first().and_then(|clock| clock.split(' ').next()?.parse::<f64>().ok());
    rate_hz.map_or_else(table::empty_cell, |rate_hz| format!("{rate_hz:.1} Hz"))
}

fn log_page(log: &LogCheck) -> String {
    let checksums = match log.has_checksums {
        Some(true) => "all pages have checksums".to_owned(),
        Some(false) => format!("no page checksums: {NO_CHECKSUMS}"),
        None => "page headers cannot be read".to_owned(),
    };
    let clocks = if log.clocks.is_empty() { String::new() } else { format!(", {}", log.clocks.join("; ")) };
    let [tail, flight, departure] = &log.flight;
    let flight = escape(&format!("{tail} flight {flight} departed {departure}"));
    let channels = if log.channels.is_empty() { NOTHING.to_owned() } else { layout(&log.channels) };
    format!("{}\n  {flight}\n  {} rows{clocks}\n  {checksums}\n{channels}\n", escape(&log.name), log.rows)
}

fn layout(channels: &[ChannelCheck]) -> String {
    let scale = |c: &ChannelCheck| if c.unit == "m" { 1e3 } else { 1.0 };
    let shown = |v: Option<f64>, places: usize| v.map_or_else(table::empty_cell, |v| format!("{v:.places$}"));
    let percent = |share: Option<f64>| shown(share.map(|share| share * 100.0), 2);
    let columns: &table::Columns<'_, ChannelCheck> = &[
        (text("position", 0), &|c| c.position.clone()),
        (text("serial", 3), &|c| table::or_dash(c.serial_number.as_deref())),
        (text("channel", 0), &|c| c.channel.to_owned()),
        (text("column", 1), &|c| c.column.clone()),
        (number("min", 0), &|c| shown(c.min.map(|v| v * scale(c)), 3)),
        (number("max", 0), &|c| shown(c.max.map(|v| v * scale(c)), 3)),
        (text("unit", 1), &|c| if c.unit == "m" { "mm".to_owned() } else { c.unit.to_owned() }),
        (number("resolution", 4), &|c| match c.resolution.filter(|_| c.unit == "m") {
            Some(m) => format!("{:.3} µm", m * 1e6),
            None => shown(c.resolution, 3),
        }),
        (number("rate [Hz]", 6), &|c| shown(c.rate_hz, 1)),
        (number("missing [%]", 2), &|c| percent(c.missing_share)),
        (number("frozen [%]", 5), &|c| percent(c.frozen_share)),
        (number("spikes", 7), &|c| c.spikes.map_or_else(table::empty_cell, |n| n.to_string())),
        (text("note", 0), &ChannelCheck::note_and_remedy),
    ];
    table::of(channels, columns)
}

/// Lists columns that are missing or have another type in some logs; each log is read with its own types.
fn drift(logs: &[LogCheck]) -> String {
    const SHOWN: usize = 12;
    // Column → type → number of logs, and the first of them.
    let mut columns = BTreeMap::<&str, BTreeMap<&str, (usize, &str)>>::new();
    for log in logs {
        for (name, kind) in &log.column_types {
            columns.entry(name).or_default().entry(kind).or_insert((0, &log.name)).0 += 1;
        }
    }
    columns.retain(|_, kinds| kinds.len() > 1 || kinds.values().any(|(count, _)| *count < logs.len()));
    let line = |(name, kinds): (&str, BTreeMap<&str, (usize, &str)>)| {
        let kind =
            |(kind, (count, first)): (&str, (usize, &str))| format!("{kind} in {count} (first {first})");
        let kinds: Vec<String> = kinds.into_iter().map(kind).collect();
        format!("  {}\n", escape(&format!("`{name}`: {}", kinds.join(", "))))
    };
    let lines: Vec<String> = columns.into_iter().map(line).collect();
    if lines.is_empty() {
        return String::new();
    }
    let more = match lines.len().saturating_sub(SHOWN) {
        0 => String::new(),
        n => format!("  and {n} more columns\n"),
    };
    let shown: String = lines.into_iter().take(SHOWN).collect();
    format!(
        "columns that are missing or whose type differs between {} logs (each log is read with its own types):\n{shown}{more}",
        logs.len()
    )
}

/// Compares the parameters identified from the logs with the configured ones, by part number.
fn proposals(facts: &BTreeMap<PartNumber, Vec<IdentifiedParams>>, config: &Config) -> String {
    let uncertainty =
        |p: &ParamComparison| p.uncertainty.map(|v| format!(" ± {:.1e}", NORMAL_95 * v)).unwrap_or_default();
    let columns: &table::Columns<'_, ParamComparison> = &[
        (text("key", 0), &|p| p.key.clone()),
        (number("identified (± 90 %)", 0), &|p| format!("{:.2e}{}", p.identified, uncertainty(p))),
        (number("configured", 0), &|p| p.configured.map_or_else(table::empty_cell, |v| format!("{v:.2e}"))),
    ];
    let mut page = String::new();
    for (number, all) in facts {
        let Some(part) = config.parts.get(number) else { continue };
        let proposals = IdentifiedParams::medians(all).comparisons(part);
        let flights = table::count(all.len(), "actuator-flight");
        let number = escape(number.as_str());
        let _ = writeln!(page, "part {number}, identified from {flights} (prefer data-sheet values)");
        page.push_str(&table::of(&proposals, columns));
        page.push('\n');
    }
    page
}

fn summary(logs: usize, channels: &[ChannelCheck], diagnostics: &[Diagnostic]) -> String {
    let mut files: Vec<&str> = diagnostics.iter().filter_map(|c| c.file.as_deref()).collect();
    files.sort_unstable();
    files.dedup();
    let warned: BTreeSet<&str> = channels.iter().filter(|c| c.is_warning()).map(|c| c.log.as_str()).collect();
    format!(
        "{} checked, {} failed, {} with warnings; no gap was computed, nothing was stored\n",
        table::count(logs, "log"),
        files.len(),
        warned.len()
    )
}
