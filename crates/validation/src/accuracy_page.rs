//! The study as a page: tables between words that stand in `accuracy.md.in`.

use std::fmt::Write as _;

use crate::gear_bench::GearBenchLog;
use crate::methods::METHODS;
use crate::metrics::{ErrorStats, Errors};
use crate::robot_logs::RobotRow;
use crate::scenarios::Kind;

/// Fills the page's places with tables.
pub fn page(tallies: &[ErrorStats], robot: &[RobotRow], gears: Option<&[GearBenchLog]>) -> String {
    let of = |kinds: fn(Kind) -> bool| tallies.iter().filter(move |t| kinds(t.kind)).collect::<Vec<_>>();
    let shown = of(|k| !matches!(k, Kind::Blind(_)));
    let text = include_str!("../accuracy.md.in");
    let gears = gears.map_or_else(|| "Not run: `--gears DIR` was not given.\n".to_owned(), geared);
    text.replace("{{errors}}", &errors(&shown))
        .replace("{{intervals}}", &intervals(&shown))
        .replace("{{refusals}}", &refusals(tallies))
        .replace("{{robot}}", &real(robot))
        .replace("{{gears}}", &gears)
}

/// Median / 95 % quantile / worst of every method.
fn errors(tallies: &[&ErrorStats]) -> String {
    let mut table = format!("| scenario | flights | unit | {} |\n|---|---|---|", METHODS.join(" | "));
    table += &"---|".repeat(METHODS.len());
    table.push('\n');
    for t in tallies {
        let _ = write!(table, "| {} | {} | {} |", t.name, t.flights, t.kind.unit());
        for errors in &t.errors {
            let _ = write!(table, " {} |", three(errors));
        }
        table.push('\n');
    }
    table
}

fn three(errors: &Errors) -> String {
    if errors.count == 0 {
        return "–".to_owned();
    }
    let digits = if errors.median < 10.0 { 2 } else { 0 };
    format!("{:.digits$} / {:.digits$} / {:.digits$}", errors.median, errors.p95, errors.worst)
}

/// How often the interval held, and which flags were raised.
fn intervals(tallies: &[&ErrorStats]) -> String {
    let mut table = "| scenario | estimated | 90 % intervals that hold | of 100, with 90 % certainty | flags |\n|---|---|---|---|---|\n".to_owned();
    for t in tallies {
        let (share, low, high) = t.coverage();
        let _ = writeln!(
            table,
            "| {} | {} | {:.1} % | {:.0} to {:.0} | {} |",
            t.name,
            t.estimated,
            100.0 * share,
            100.0 * low,
            100.0 * high,
            codes(t)
        );
    }
    table
}

fn codes(tally: &ErrorStats) -> String {
    let said: Vec<String> = tally.codes.iter().map(|(code, n)| format!("`{code}` {n}")).collect();
    if said.is_empty() { "–".to_owned() } else { said.join(", ") }
}

/// Flights that cannot show a gap, and what became of them; then the false refusals of all others.
fn refusals(tallies: &[ErrorStats]) -> String {
    let mut table =
        "| flights that cannot show a gap | flights | given a number | wanted | said |\n|---|---|---|---|---|\n".to_owned();
    for t in tallies {
        let Some(code) = t.must_refuse() else { continue };
        let _ = writeln!(
            table,
            "| {} | {} | {} | `{code}` | {} |",
            t.name,
            t.flights,
            t.missed_refusals(),
            codes(t)
        );
    }
    let (blind, sound): (Vec<&ErrorStats>, Vec<&ErrorStats>) =
        tallies.iter().partition(|t| t.must_refuse().is_some());
    let sum =
        |of: &[&ErrorStats], count: fn(&ErrorStats) -> usize| of.iter().map(|t| count(t)).sum::<usize>();
    let _ = writeln!(
        table,
        "\nMissed refusals: {} of {}. False refusals: {} of {}.",
        sum(&blind, ErrorStats::missed_refusals),
        sum(&blind, |t| t.flights),
        sum(&sound, ErrorStats::false_refusals),
        sum(&sound, |t| t.flights),
    );
    table
}

fn real(rows: &[RobotRow]) -> String {
    let mut table = "| log | contact regression ° | ± ° | skew ms | paper (29–31) ° | load lines ° | P99 − P1 ° | remarks |\n|---|---|---|---|---|---|---|---|\n".to_owned();
    let cell = |v: f64, digits: usize| if v.is_nan() { "–".to_owned() } else { format!("{v:.digits$}") };
    for r in rows {
        let _ = writeln!(
            table,
            "| {} | {} | {} | {} | {} | {} | {} | {} |",
            r.log,
            cell(r.gap_deg, 4),
            cell(r.se_deg, 4),
            cell(r.skew_ms, 2),
            cell(r.midrange_deg, 4),
            cell(r.lines_deg, 4),
            cell(r.spread_deg, 4),
            if r.remarks.is_empty() { "–" } else { &r.remarks },
        );
    }
    table
}

/// One method's answers to a log, over small ramps and over all.
type Said = fn(&GearBenchLog) -> [f64; 2];

/// Against the authors' play: correlation, mean and mean absolute difference, of each method.
fn geared(rows: &[GearBenchLog]) -> String {
    let mut table = "| method | ramps | correlation | mean difference ° | mean absolute difference ° |\n|---|---|---|---|---|\n".to_owned();
    let methods: [(&str, Said); 3] =
        [(METHODS[1], |g| g.midrange_deg), (METHODS[2], |g| g.lines_deg), (METHODS[3], |g| g.spread_deg)];
    for (name, of) in methods {
        for (k, ramps) in ["4 N·m", "4 and 40 N·m"].iter().enumerate() {
            let pairs: Vec<(f64, f64)> =
                rows.iter().map(|g| (g.authors_deg, of(g)[k])).filter(|(_, said)| said.is_finite()).collect();
            let n = pairs.len() as f64;
            let mean = |f: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(f).sum::<f64>() / n;
            let (difference, size) = (mean(&|(a, s)| s - a), mean(&|(a, s)| (s - a).abs()));
            let (a, s) = (mean(&|p| p.0), mean(&|p| p.1));
            let correlation = mean(&|p| (p.0 - a) * (p.1 - s))
                / (mean(&|p| (p.0 - a).powi(2)) * mean(&|p| (p.1 - s).powi(2))).sqrt();
            let _ = writeln!(table, "| {name} | {ramps} | {correlation:.3} | {difference:+.3} | {size:.3} |");
        }
    }
    let _ = writeln!(table, "\n{} logs.", rows.len());
    table
}
