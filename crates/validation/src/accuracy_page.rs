//! The accuracy page: tables in the template `accuracy.md.in`.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use crate::gear_bench::GearBenchLog;
use crate::methods::METHODS;
use crate::metrics::{ErrorStats, FALSE_ALARMS};
use crate::robot_logs::RobotRow;
use crate::scenarios::Kind;

/// Fills the template's places with tables.
pub fn page(stats: &[ErrorStats], robot: &[RobotRow], gears: Option<&[GearBenchLog]>) -> String {
    let text = include_str!("../accuracy.md.in");
    let gears = gears.map_or_else(|| "Not run: `--gears DIR` was not given.\n".to_owned(), gear_bench_table);
    let visible: Vec<&ErrorStats> = visible(stats).collect();
    let (notable, quiet): (Vec<_>, Vec<_>) = visible.iter().partition(|t| is_notable(t));
    text.replace("{{method}}", &job::METHOD_VERSION.to_string())
        .replace("{{classes}}", &classes(&notable))
        .replace("{{quiet}}", &quiet.len().to_string())
        .replace("{{methods}}", &methods(&visible))
        .replace("{{alarms}}", &alarms(&visible))
        .replace("{{refusals}}", &refusals(stats))
        .replace("{{robot}}", &robot_table(robot))
        .replace("{{gears}}", &gears)
}

/// The tables of simulated flights, for a reduced run.
pub fn tables(stats: &[ErrorStats]) -> String {
    let visible: Vec<&ErrorStats> = visible(stats).collect();
    [classes(&visible), methods(&visible), alarms(&visible), refusals(stats)].join("\n")
}

/// The classes whose gap can be seen.
fn visible(stats: &[ErrorStats]) -> impl Iterator<Item = &ErrorStats> {
    stats.iter().filter(|t| !matches!(t.kind, Kind::Blind(_)))
}

/// Whether the page lists a class: its P95 error is at least one per cent or one micrometre, fewer than 90 % of its
/// intervals hold the true value, or a flight was refused that shows its gap.
fn is_notable(t: &ErrorStats) -> bool {
    t.errors[0].p95 >= 1.0 || t.coverage().0 < 0.9 || t.false_refusals() > 0
}

/// Contact regression: errors, coverage and refusals of every class.
fn classes(stats: &[&ErrorStats]) -> String {
    let mut table = "| scenario | unit | median | P95 | worst | 90 % coverage [%] | refused |\n|---|---|---|---|---|---|---|\n".to_owned();
    for t in stats {
        let errors = &t.errors[0];
        let (share, _, _) = t.coverage();
        let coverage = if t.estimated == 0 { "–".to_owned() } else { format!("{:.0}", 100.0 * share) };
        let _ = writeln!(
            table,
            "| {} | {} | {} | {} | {} | {coverage} | {} |",
            t.name,
            t.kind.unit(),
            digits(errors.median),
            digits(errors.p95),
            digits(errors.worst),
            t.false_refusals(),
        );
    }
    table
}

/// Every number of the study as a table of comma-separated values: a row for each class and method.
pub fn csv(stats: &[ErrorStats]) -> String {
    let alarms = FALSE_ALARMS.map(|flag| format!("false_{flag}")).join(",");
    let mut table = format!(
        "scenario,method,unit,flights,estimated,median,p95,worst,coverage,coverage_low,coverage_high,codes,{alarms}\n"
    );
    for t in stats {
        for (k, (method, errors)) in METHODS.iter().zip(&t.errors).enumerate() {
            let number = |value: f64| if value.is_finite() { format!("{value:.4}") } else { String::new() };
            let errors = [errors.median, errors.p95, errors.worst].map(number).join(",");
            let (share, low, high) = t.coverage();
            let is_known = k == 0 && t.estimated > 0;
            let held = [share, low, high].map(|share| number(if is_known { share } else { f64::NAN }));
            let codes: Vec<String> = t.codes.iter().map(|(code, n)| format!("{code} {n}")).collect();
            let alarms = t.false_alarms.map_or_else(
                || ",".repeat(FALSE_ALARMS.len() - 1),
                |alarms| alarms.map(|count| count.to_string()).join(","),
            );
            let own =
                if k == 0 { format!("{},{alarms}", codes.join(" ")) } else { ",".repeat(FALSE_ALARMS.len()) };
            let _ = writeln!(
                table,
                "\"{}\",{method},{},{},{},{errors},{},{own}",
                t.name,
                t.kind.unit(),
                t.flights,
                t.estimated,
                held.join(",")
            );
        }
    }
    table
}

/// Two digits after the point for small numbers, none for large ones.
fn digits(value: f64) -> String {
    match value {
        v if v.is_nan() => "–".to_owned(),
        v if v < 10.0 => format!("{v:.2}"),
        v => format!("{v:.0}"),
    }
}

/// P95 error of every other method over that of the contact regression, over all classes.
fn methods(stats: &[&ErrorStats]) -> String {
    let mut table =
        "| method | median ratio of P95 | largest | scenarios with a smaller P95 |\n|---|---|---|---|\n"
            .to_owned();
    for (k, method) in METHODS.iter().enumerate().skip(1) {
        let ratio = |t: &&ErrorStats| t.errors[k].p95 / t.errors[0].p95;
        let mut ratios: Vec<f64> = stats.iter().map(ratio).filter(|ratio| ratio.is_finite()).collect();
        ratios.sort_by(f64::total_cmp);
        let better = ratios.iter().filter(|ratio| **ratio < 1.0).count();
        let (middle, most) = (ratios.get(ratios.len() / 2).copied(), ratios.last().copied());
        let [middle, most] = [middle, most].map(|ratio| digits(ratio.unwrap_or(f64::NAN)));
        let _ = writeln!(table, "| {method} | {middle} | {most} | {better} of {} |", ratios.len());
    }
    table
}

/// Flags raised without cause, over all classes, and the class with the most of them.
fn alarms(stats: &[&ErrorStats]) -> String {
    let mut table = "| flag | false alarms | most in one scenario |\n|---|---|---|\n".to_owned();
    let counted = || stats.iter().filter_map(|t| Some((t, t.false_alarms?)));
    let estimates: usize = counted().map(|(t, _)| t.estimated).sum();
    for (k, flag) in FALSE_ALARMS.iter().enumerate() {
        let all: usize = counted().map(|(_, alarms)| alarms[k]).sum();
        let most = counted().max_by_key(|(_, alarms)| alarms[k]).filter(|(_, alarms)| alarms[k] > 0);
        let most = most
            .map_or("–".to_owned(), |(t, alarms)| format!("{} of {}: {}", alarms[k], t.estimated, t.name));
        let _ = writeln!(table, "| `{flag}` | {all} of {estimates} | {most} |");
    }
    table
}

/// The codes of estimates and refusals, with how often each was given, `expected` first.
fn flags(stats: &ErrorStats, expected: &str) -> String {
    let mut codes: Vec<_> = stats.codes.iter().collect();
    codes.sort_by_key(|(code, _)| code.as_str() != expected);
    codes.iter().map(|(code, n)| format!("`{code}` {n}")).collect::<Vec<_>>().join(", ")
}

/// Flights that cannot show a gap with the codes given, and the false refusals of all others.
fn refusals(stats: &[ErrorStats]) -> String {
    let mut table =
        "| flights that cannot show a gap | estimated | codes given, the expected one first |\n|---|---|---|\n".to_owned();
    let (blind, sound): (Vec<&ErrorStats>, Vec<&ErrorStats>) =
        stats.iter().partition(|t| t.must_refuse().is_some());
    if blind.is_empty() {
        table.clear();
    }
    for t in &blind {
        let Some(code) = t.must_refuse() else { continue };
        let _ =
            writeln!(table, "| {} | {} of {} | {} |", t.name, t.missed_refusals(), t.flights, flags(t, code));
    }
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

fn robot_table(rows: &[RobotRow]) -> String {
    let mut table = "| log | contact regression ° | ± ° | skew ms | paper (29–31) ° | load lines ° | P99 − P1 ° | remarks |\n|---|---|---|---|---|---|---|---|\n".to_owned();
    for row in rows {
        let _ = writeln!(table, "| {} |", row.join(" | "));
    }
    table
}

/// One method's results for a log, over small ramps and over all.
type Results = fn(&GearBenchLog) -> [f64; 2];

/// Against the authors' play: correlation, mean and mean absolute difference, of each method.
fn gear_bench_table(rows: &[GearBenchLog]) -> String {
    let mut table = "| method | ramps | logs | phases | correlation | mean difference ° | mean absolute difference ° |\n|---|---|---|---|---|---|---|\n".to_owned();
    let methods: [(&str, Results); 5] = [
        (METHODS[0], |g| g.contact_deg),
        ("its loop width", |g| g.loop_deg),
        (METHODS[1], |g| g.midrange_deg),
        (METHODS[2], |g| g.lines_deg),
        (METHODS[3], |g| g.spread_deg),
    ];
    for (name, of) in methods {
        for (k, ramps) in ["4 N·m", "4 and 40 N·m"].iter().enumerate() {
            // The play of a phase was measured over three places of the output, each of which has a log.
            let mut phases: BTreeMap<u64, (f64, Vec<f64>)> = BTreeMap::new();
            for gear in rows.iter().filter(|gear| of(gear)[k].is_finite()) {
                let phase =
                    phases.entry(gear.authors_deg.to_bits()).or_insert((gear.authors_deg, Vec::new()));
                phase.1.push(of(gear)[k]);
            }
            let logs: usize = phases.values().map(|(_, found)| found.len()).sum();
            if logs == 0 {
                continue;
            }
            let pairs: Vec<(f64, f64)> = phases
                .into_values()
                .map(|(play, found)| (play, found.iter().sum::<f64>() / found.len() as f64))
                .collect();
            let n = pairs.len() as f64;
            let mean = |f: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(f).sum::<f64>() / n;
            let (difference, size) = (mean(&|(a, s)| s - a), mean(&|(a, s)| (s - a).abs()));
            let (a, s) = (mean(&|p| p.0), mean(&|p| p.1));
            let correlation = mean(&|p| (p.0 - a) * (p.1 - s))
                / (mean(&|p| (p.0 - a).powi(2)) * mean(&|p| (p.1 - s).powi(2))).sqrt();
            let _ = writeln!(
                table,
                "| {name} | {ramps} | {logs} | {n} | {correlation:.3} | {difference:+.3} | {size:.3} |"
            );
        }
    }
    table
}
