//! The page `docs/paper.md`: the paper's figures and a number for each claim, in the template `paper.md.in`.

use crate::accuracy_page::fill;
use crate::paper::claims::{Change, Claims, Convergence};

pub(crate) fn page(claims: &Claims) -> String {
    let um = |m: f64| format!("{:.1}", 1e6 * m);
    let [least, _, most] = claims.known.percent;
    let tuning = |factor| mean(&claims.tuning, factor);
    let deviations = claims.varying.iter().map(|w| (w.gap_m / w.true_m - 1.0).abs());
    fill(
        include_str!("../../paper.md.in"),
        &[
            ("upper", um(claims.gap.upper_m)),
            ("lower", um(claims.gap.lower_m)),
            ("gap", um(claims.gap.gap_m)),
            ("least", format!("{least:+.1}")),
            ("most", format!("{most:+.1}")),
            ("starts_ms", slowest_ms(&claims.starts)),
            ("spreads_ms", slowest_ms(&claims.spreads)),
            ("noise_10", format!("{:+.1}", mean(&claims.noise, 10.0))),
            ("noise_30", format!("{:+.1}", mean(&claims.noise, 30.0))),
            ("tuning_1000", format!("{:+.1}", tuning(1e3))),
            ("tuning_0.1", format!("{:+.1}", tuning(1e-1))),
            ("tuning_0.001", format!("{:+.0}", tuning(1e-3))),
            ("damping", largest(&claims.damping)),
            ("mass", largest(&claims.mass)),
            ("stiffness_0.9", format!("{:+.0}", mean(&claims.stiffness, 0.9))),
            ("stiffness_1.1", format!("{:+.0}", mean(&claims.stiffness, 1.1))),
            ("window", format!("{:.0}", 100.0 * deviations.fold(0.0, f64::max))),
            ("starts", times(&claims.starts)),
            ("spreads", times(&claims.spreads)),
        ],
    )
}

/// Mean change of the gap by a parameter times `factor`, %.
fn mean(changes: &[Change], factor: f64) -> f64 {
    let found = changes.iter().find(|change| (change.factor / factor - 1.0).abs() < 1e-9);
    found.map_or(f64::NAN, |change| change.percent[1])
}

fn largest(changes: &[Change]) -> String {
    format!("{:.2}", changes.iter().map(Change::largest).fold(0.0, f64::max))
}

fn slowest_ms(all: &[Convergence]) -> String {
    format!("{:.0}", 1e3 * all.iter().map(|one| one.time_s).fold(0.0, f64::max))
}

/// A row for each start: the time until S has converged.
fn times(all: &[Convergence]) -> String {
    let row = |one: &Convergence| format!("| {} | {:.0} |\n", one.name, 1e3 * one.time_s);
    all.iter().map(row).collect()
}
