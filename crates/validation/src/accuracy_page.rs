//! The accuracy page: tables in the template `accuracy.md.in`.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use crate::gear_bench::{GEAR_METHODS, GearBenchLog};
use crate::methods::METHODS;
use crate::metrics::{ErrorStats, FALSE_ALARMS};
use crate::robot_logs::RobotRow;

const ROBOT_HEAD: &str =
    "log | contact regression ° | ± ° | skew ms | paper (29–31) ° | load lines ° | P99 − P1 ° | remarks";

/// A template with its places `{{NAME}}` filled.
pub(crate) fn fill(template: &str, values: &[(&str, String)]) -> String {
    values
        .iter()
        .fold(template.to_owned(), |text, (name, value)| text.replace(&format!("{{{{{name}}}}}"), value))
}

/// Fills the template's places with tables.
pub(crate) fn page(stats: &[ErrorStats], robot: &[RobotRow], gears: Option<&[GearBenchLog]>) -> String {
    let gears = gears.map_or_else(|| "Not run: `--gears DIR` was not given.\n".to_owned(), gear_bench_table);
    let visible: Vec<&ErrorStats> = visible(stats).collect();
    // The page lists a class whose P95 error is at least one per cent or one micrometre, of whose intervals fewer than 90 % hold
    // the true value, or of which a flight was refused.
    let is_notable = |t: &&ErrorStats| t.errors[0].p95 >= 1.0 || t.coverage().0 < 0.9 || t.refused() > 0;
    let (notable, quiet): (Vec<&ErrorStats>, Vec<&ErrorStats>) =
        visible.iter().copied().partition(is_notable);
    fill(
        include_str!("../accuracy.md.in"),
        &[
            ("method", job::METHOD_VERSION.to_string()),
            ("classes", classes(&notable)),
            ("quiet", quiet.len().to_string()),
            ("methods", methods(&visible)),
            ("alarms", alarms(&visible)),
            ("refusals", refusals(stats)),
            ("robot", table(ROBOT_HEAD, robot.iter().map(|row| row.join(" | ")))),
            ("gears", gears),
        ],
    )
}

/// The tables of simulated flights, for a reduced run.
pub(crate) fn tables(stats: &[ErrorStats]) -> String {
    let visible: Vec<&ErrorStats> = visible(stats).collect();
    [classes(&visible), methods(&visible), alarms(&visible), refusals(stats)].join("\n")
}

/// The classes whose gap can be seen.
fn visible(stats: &[ErrorStats]) -> impl Iterator<Item = &ErrorStats> {
    stats.iter().filter(|t| t.must_refuse().is_none())
}

/// A table of Markdown; a row holds its cells between bars.
fn table(head: &str, rows: impl Iterator<Item = String>) -> String {
    let bars = "|---".repeat(head.split(" | ").count());
    let rows: Vec<String> = rows.map(|row| format!("| {row} |\n")).collect();
    format!("| {head} |\n{bars}|\n{}", rows.concat())
}

/// Contact regression: errors, coverage and refusals of every class.
fn classes(stats: &[&ErrorStats]) -> String {
    let row = |t: &&ErrorStats| {
        let (share, _, _) = t.coverage();
        let coverage = if t.estimated == 0 { "–".to_owned() } else { format!("{:.0}", 100.0 * share) };
        let errors = [t.errors[0].median, t.errors[0].p95, t.errors[0].worst].map(digits).join(" | ");
        format!("{} | {} | {errors} | {coverage} | {}", t.name, t.unit(), t.refused())
    };
    table("scenario | unit | median | P95 | worst | 90 % coverage [%] | refused", stats.iter().map(row))
}

/// Every number of the study as a table of comma-separated values: a row for each class and method.
pub(crate) fn csv(stats: &[ErrorStats]) -> String {
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
                t.unit(),
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
    let row = |(k, method): (usize, &&str)| {
        let ratio = |t: &&ErrorStats| t.errors[k].p95 / t.errors[0].p95;
        let mut ratios: Vec<f64> = stats.iter().map(ratio).filter(|ratio| ratio.is_finite()).collect();
        ratios.sort_by(f64::total_cmp);
        let better = ratios.iter().filter(|ratio| **ratio < 1.0).count();
        let (middle, most) = (ratios.get(ratios.len() / 2).copied(), ratios.last().copied());
        let [middle, most] = [middle, most].map(|ratio| digits(ratio.unwrap_or(f64::NAN)));
        format!("{method} | {middle} | {most} | {better} of {}", ratios.len())
    };
    let head = "method | median ratio of P95 | largest | scenarios with a smaller P95";
    table(head, METHODS.iter().enumerate().skip(1).map(row))
}

/// Flags raised without cause, over all classes, and the class with the most of them.
fn alarms(stats: &[&ErrorStats]) -> String {
    let counted = || stats.iter().filter_map(|t| Some((t, t.false_alarms?)));
    let estimates: usize = counted().map(|(t, _)| t.estimated).sum();
    let row = |(k, flag): (usize, &&str)| {
        let all: usize = counted().map(|(_, alarms)| alarms[k]).sum();
        let most = counted().max_by_key(|(_, alarms)| alarms[k]).filter(|(_, alarms)| alarms[k] > 0);
        let most = most
            .map_or("–".to_owned(), |(t, alarms)| format!("{} of {}: {}", alarms[k], t.estimated, t.name));
        format!("`{flag}` | {all} of {estimates} | {most}")
    };
    table("flag | false alarms | most in one scenario", FALSE_ALARMS.iter().enumerate().map(row))
}

/// Flights that cannot show a gap with the codes given, and the false refusals of all others.
fn refusals(stats: &[ErrorStats]) -> String {
    let (blind, sound): (Vec<&ErrorStats>, Vec<&ErrorStats>) =
        stats.iter().partition(|t| t.must_refuse().is_some());
    let row = |t: &&ErrorStats| {
        let mut codes: Vec<_> = t.codes.iter().collect();
        codes.sort_by_key(|(code, _)| Some(code.as_str()) != t.must_refuse());
        let codes: Vec<String> = codes.iter().map(|(code, n)| format!("`{code}` {n}")).collect();
        format!("{} | {} of {} | {}", t.name, t.estimated, t.flights, codes.join(", "))
    };
    let head = "flights that cannot show a gap | estimated | codes given, the expected one first";
    let table = if blind.is_empty() { String::new() } else { table(head, blind.iter().map(row)) };
    let sum =
        |of: &[&ErrorStats], count: fn(&ErrorStats) -> usize| of.iter().map(|t| count(t)).sum::<usize>();
    format!(
        "{table}\nMissed refusals: {} of {}. False refusals: {} of {}.\n",
        sum(&blind, |t| t.estimated),
        sum(&blind, |t| t.flights),
        sum(&sound, ErrorStats::refused),
        sum(&sound, |t| t.flights),
    )
}

/// Against the authors' play: correlation, mean and mean absolute difference, of each method.
fn gear_bench_table(logs: &[GearBenchLog]) -> String {
    let ramps = [(0, "4 N·m"), (1, "4 and 40 N·m")];
    let rows = (0..GEAR_METHODS.len()).flat_map(|method| ramps.map(|(ramps, shown)| (method, ramps, shown)));
    let row = |(method, ramps, shown): (usize, usize, &str)| {
        // The play of a phase was measured over three places of the output, each of which has a log.
        let mut phases: BTreeMap<u64, Vec<f64>> = BTreeMap::new();
        for log in logs.iter().filter(|log| log.found_deg[ramps][method].is_finite()) {
            phases.entry(log.authors_deg.to_bits()).or_default().push(log.found_deg[ramps][method]);
        }
        let logs: usize = phases.values().map(Vec::len).sum();
        let of_phase = |(play, found): (u64, Vec<f64>)| {
            (f64::from_bits(play), found.iter().sum::<f64>() / found.len() as f64)
        };
        let pairs: Vec<(f64, f64)> = phases.into_iter().map(of_phase).collect();
        let n = pairs.len() as f64;
        let mean = |f: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(f).sum::<f64>() / n;
        let (difference, size) = (mean(&|(a, s)| s - a), mean(&|(a, s)| (s - a).abs()));
        let (a, s) = (mean(&|p| p.0), mean(&|p| p.1));
        let correlation = mean(&|p| (p.0 - a) * (p.1 - s))
            / (mean(&|p| (p.0 - a).powi(2)) * mean(&|p| (p.1 - s).powi(2))).sqrt();
        let numbers = format!("{correlation:.3} | {difference:+.3} | {size:.3}");
        (logs > 0).then(|| format!("{} | {shown} | {logs} | {n} | {numbers}", GEAR_METHODS[method]))
    };
    let head =
        "method | ramps | logs | phases | correlation | mean difference ° | mean absolute difference °";
    table(head, rows.filter_map(row))
}
