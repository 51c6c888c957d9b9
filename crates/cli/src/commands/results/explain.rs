//! `explain`: traces one estimate to its inputs and settings, and recomputes it.

use std::fmt::Write as _;

use ingest::{ActuatorChannels, Quality};
use job::Config;
use pipeline::inspect::explain::{Explanation, Recomputation, remedy};
use records::uncertainty::NORMAL_95;
use serde_json::Value;
use store::Query;

use crate::args::{DepartureArgs, ExplainArgs, Global};
use crate::exit::{Code, Failure};
use crate::output::{Output, escape};
use crate::table::{self, number, text};

use crate::commands::context::{KnownNames, check_range, load_with_installations};

/// Explains one record.
///
/// # Errors
/// If configuration or store cannot be read, or there is no such record. A record that cannot be reproduced
/// makes the exit code 1.
pub(crate) fn explain(args: &ExplainArgs, global: &Global, output: &Output) -> Result<Code, Failure> {
    let (config, installations) = load_with_installations(global)?;
    let DepartureArgs { since, until } = args.departures;
    check_range(since, until)?;
    let query = Query {
        flight_id: Some(args.flight.clone()),
        position: Some(args.position.clone()),
        tail_number: args.tail.clone(),
        since_utc: since,
        until_utc: until,
        ..Query::default()
    };
    let store = pipeline::open_store(&config, &installations)?;
    let found = match pipeline::inspect::explain::explain(&config, &installations, &store, &query) {
        Ok(found) => found,
        Err(error) => {
            let known = KnownNames::of(&config);
            known.check(&["flight_id"], Some(&args.flight))?;
            known.check(&["position"], Some(&args.position))?;
            known.check(&["tail_number"], args.tail.as_deref())?;
            return Err(error.into());
        }
    };
    if args.json {
        output.write_exact(&format!("{:#}\n", found.to_json(&config)))?;
    } else {
        output.write_result(&page(&found, &config))?;
    }
    if let Err(diagnostic) = &found.replayed {
        output.diagnostic(diagnostic);
    }
    Ok(if found.is_sound() { Code::Success } else { Code::LogsInError })
}

fn page(found: &Explanation, config: &Config) -> String {
    let record = &found.record;
    let (flight, p, e) = (&record.flight, &record.provenance, &record.estimate);
    let head = format!(
        "{} / {} in {} of {}, flight {}, departed {}",
        record.part_number,
        record.serial_number,
        record.position,
        flight.tail_number,
        flight.flight_id,
        flight.departure_utc
    );
    let mut page = escape(&head) + "\n";
    let mut line = |label: &str, text: &str| {
        let _ = writeln!(page, "  {label:<11} {}", escape(text));
    };
    let [gap, se, p05, p95, midrange] =
        [e.gap_m, e.gap_se_m, e.gap_p05_m, e.gap_p95_m, e.gap_midrange_m].map(table::micrometres);
    let interval = format!("standard error {se} µm, 90 % interval {p05} to {p95}");
    line("gap", &format!("{gap} µm, {interval}; mid-range {midrange} µm"));
    let flags = super::query::flags_text(e);
    line("flags", if flags.is_empty() { "none" } else { &flags });
    if let Some(remedy) = remedy(e) {
        line("remedy", remedy);
    }
    let two_digits = |v: Option<f64>| v.map_or_else(table::empty_cell, |v| format!("{v:.2e}"));
    let [k, k_half_width] =
        [e.stiffness_n_per_m, e.stiffness_se_n_per_m.map(|se| NORMAL_95 * se)].map(two_digits);
    let skew_ms = e.skew_s.map_or_else(table::empty_cell, |s| format!("{:.2}", s * 1e3));
    let [loop_um, lost_um] = [e.loop_width_m, e.lost_motion_m].map(table::micrometres);
    let motion = format!("skew {skew_ms} ms, loop {loop_um} µm, lost motion {lost_um} µm");
    line("fitted", &format!("stiffness {k} ± {k_half_width} N/m (90 %), {motion}"));
    let load = crate::commands::results::query::load(e);
    line("data", &format!("{} samples, {} load reversals, load {load} N", e.samples, e.load_reversals));
    line("log", &format!("{} ({})", p.log_path, short(&p.log_digest)));
    let (file, method) = (config.file.display(), config.document.estimate.method.as_str());
    let settings = if found.has_current_settings() {
        format!("{file} ({}), method {method}", short(&p.config_digest))
    } else {
        format!(
            "not the present ones of {file} ({}); the part's values below are the present ones",
            short(&p.config_digest)
        )
    };
    line("settings", &settings);
    let processed = p.processed_utc.strftime("%Y-%m-%d %H:%M UTC");
    line("computed by", &format!("Freeplay {} in run {} on {processed}", p.program_version, p.run_id));
    line("replay", &found.verdict.to_string());
    line("reproduce", &format!("freeplay estimate {}", config.path(&p.log_path).display()));
    if let Some(part) = config.document.part.get(record.part_number.as_str()) {
        let settings = serde_json::to_value(part).unwrap_or_default();
        for (at, (key, value)) in flat("", &settings).into_iter().enumerate() {
            line(if at == 0 { "part" } else { "" }, &format!("{key} = {value}"));
        }
    }
    if let Ok(Recomputation { channels: Some(channels), .. }) = &found.replayed {
        page.push('\n');
        page.push_str(&quality(channels));
    }
    page
}

fn short(digest: &str) -> &str {
    digest.get(..12).unwrap_or(digest)
}

/// Keys and values of nested tables, with their full names.
fn flat(above: &str, value: &Value) -> Vec<(String, String)> {
    let Value::Object(table) = value else { return vec![(above.to_owned(), value.to_string())] };
    let named = |key: &str| if above.is_empty() { key.to_owned() } else { format!("{above}.{key}") };
    table.iter().flat_map(|(key, value)| flat(&named(key), value)).collect()
}

fn quality(channels: &ActuatorChannels) -> String {
    let rows: Vec<_> = ["motor [m]", "screw [m]", "load [N]"].into_iter().zip(&channels.quality).collect();
    let value = |v: Option<f64>| v.map_or_else(table::empty_cell, |v| format!("{v:.6}"));
    let columns: &table::Columns<'_, (&str, &Quality)> = &[
        (text("channel", 0), &|(name, _)| (*name).to_owned()),
        (number("min", 0), &|(_, q)| value(q.span().map(|span| span.0))),
        (number("max", 0), &|(_, q)| value(q.span().map(|span| span.1))),
        (number("resolution", 3), &|(_, q)| {
            q.resolution.map_or_else(table::empty_cell, |r| format!("{r:.2e}"))
        }),
        (number("rate [Hz]", 2), &|(_, q)| format!("{:.1}", q.rate_hz)),
        (number("missing [%]", 1), &|(_, q)| format!("{:.2}", q.missing_share * 100.0)),
        (number("spikes", 4), &|(_, q)| q.spikes.to_string()),
    ];
    table::of(&rows, columns)
}
