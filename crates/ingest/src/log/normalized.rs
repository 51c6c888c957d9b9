//! The normalized log: one actuator's channels in SI on one clock, as the estimator takes them.
//!
//! `docs/columns.md` describes it. Values keep full precision, and step and segments are in
//! the footer, so the samples read back, and the gap from them, are bitwise identical.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;
use std::str::FromStr;

use records::Position;

use crate::channel::column_builder::ColumnBuilder;
use crate::channel::quality::Quality;
use crate::channel::si_conversion::Geometry;
use crate::channel::stats::ChannelStats;
use crate::error::{Error, Fault};
use crate::log::identity::{Identity, IdentityFields};
use crate::log::types::ActuatorChannels;
use crate::mapping::IdentityField;
use crate::parquet::log_file::LogFile;
use crate::parquet::writer::{Column, Encoding, write_encoded};
use crate::time::clock::TimestampRepairs;

const VERSION: &str = "1";
const KEY: &str = "freeplay.normalized";

/// The columns, in the order of [`crate::ActuatorColumns`].
pub(crate) const COLUMNS: [&str; 4] = ["motor_m", "dx_m", "load_n", "temperature_c"];

/// Which flight and which actuator a normalized log holds; none where Freeplay did not write the file.
pub(crate) fn facts(file: &LogFile) -> Result<Option<IdentityFields>, Error> {
    let Some(version) = file.metadata(KEY) else { return Ok(None) };
    if version != VERSION {
        let detail = format!("it is of form {version}, and this program knows {VERSION}");
        return Err(file.error(other_settings(&detail)));
    }
    let fact = |fact: &IdentityField| Some((*fact, noted(file, fact.as_str())?.to_owned()));
    Ok(Some(IdentityField::ALL.iter().filter_map(fact).collect()))
}

fn other_settings(detail: &str) -> Fault {
    let message = format!("normalized log was written with other settings: {detail}");
    let hint = "write it again from the recorded log: `freeplay normalize`";
    Fault::new("normalized_otherwise", message, hint)
}

/// A text of the footer that is not empty.
fn noted<'f>(file: &'f LogFile, key: &str) -> Option<&'f str> {
    file.metadata(&format!("freeplay.{key}")).filter(|text| !text.is_empty())
}

pub(crate) fn read_actuator(
    file: &LogFile,
    position: Position,
    geometry: Geometry,
) -> Result<ActuatorChannels, Error> {
    let fail = |detail: String| file.error(other_settings(&detail));
    let number = |key: &str| noted(file, key).and_then(|text| text.parse::<f64>().ok());
    let (now, then) = (geometry.metres_per_radian(), number("metres_per_radian"));
    if now != then {
        let said = |v: Option<f64>| v.map_or_else(|| "no lead".to_owned(), |v| format!("{v} m/rad"));
        return Err(fail(format!("with {}, where the part has {}", said(then), said(now))));
    }
    let step_s = number("step_s").ok_or_else(|| fail("`step_s` is missing".into()))?;
    let segments = noted(file, "segments").map_or_else(|| Some(Vec::new()), |text| pairs(text, ".."));
    let segments = segments.ok_or_else(|| fail("its stretches cannot be read".into()))?;
    let segments: Vec<Range<usize>> = segments.into_iter().map(|(start, end)| start..end).collect();
    let excluded = noted(file, "apart").and_then(|text| text.parse().ok()).unwrap_or(0);
    let [motor, dx, load] = ["motor_m", "dx_m", "load_n"].map(|name| numbers(file, name));
    let read = [motor?, dx?, load?];
    if read.iter().any(|(_, seen)| seen.is_some_and(|seen| seen.missing < excluded)) {
        return Err(fail(format!("a channel lacks fewer than the {excluded} samples that are left out")));
    }
    if segments.iter().any(|s| s.start > s.end || s.end > read[1].0.len()) {
        return Err(fail("a segment ends after the last row".into()));
    }
    let quality =
        read.each_ref().map(|(values, seen)| Quality::of(values, &segments, *seen, step_s, excluded));
    let [motor_m, dx_m, load_n] = read.map(|(values, _)| values);
    Ok(ActuatorChannels {
        position,
        step_s,
        excluded,
        output_locked: noted(file, "output_locked") == Some("true"),
        missing_share: quality[1].missing_share,
        columns: std::array::from_fn(|k| Some(COLUMNS[k].to_owned())),
        quality,
        motor_m,
        dx_m,
        load_n,
        segments,
        breaks: noted(file, "breaks").and_then(|text| pairs(text, ":")).unwrap_or_default(),
        temperature_c: number("temperature_c"),
        flags: noted(file, "flags").map(|t| t.split(' ').map(str::to_owned).collect()).unwrap_or_default(),
        repairs: TimestampRepairs::default(),
    })
}

fn numbers(file: &LogFile, name: &str) -> Result<(Vec<f64>, Option<ChannelStats>), Error> {
    let mut values = ColumnBuilder::new(file.rows().min(1 << 26), None, true);
    file.append_numbers(name, None, &mut values)?;
    Ok(values.finish())
}

/// Pairs such as `START..END` or `ROW:SECONDS`, separated by blanks.
fn pairs<A: FromStr, B: FromStr>(text: &str, between: &str) -> Option<Vec<(A, B)>> {
    let one = |text: &str| {
        let (first, second) = text.split_once(between)?;
        Some((first.parse().ok()?, second.parse().ok()?))
    };
    text.split(' ').map(one).collect()
}

/// Name and digest of the log that a normalized log was written from; none where the file is no such log.
pub fn source(file: &Path) -> Option<(String, String)> {
    let opened = LogFile::open(file).ok()?;
    opened.metadata(KEY)?;
    let text = |key: &str| opened.metadata(key).unwrap_or_default().to_owned();
    Some((text("freeplay.source_log"), text("freeplay.source_digest")))
}

/// Writes one actuator's flight as a normalized log, with its `provenance`.
///
/// # Errors
/// When the file cannot be written.
pub fn write(
    file: &Path,
    channels: &ActuatorChannels,
    identity: &Identity,
    geometry: Geometry,
    provenance: &BTreeMap<String, String>,
    encoding: Encoding,
) -> Result<(), Error> {
    let time_s = (0..channels.dx_m.len()).map(|k| channels.time_s(k)).collect();
    let [motor_m, dx_m, load_n] = [&channels.motor_m, &channels.dx_m, &channels.load_n].map(Clone::clone);
    let columns = [("time_s", time_s), ("motor_m", motor_m), ("dx_m", dx_m), ("load_n", load_n)];
    let columns = columns.map(|(name, values)| (name.to_owned(), Column::Real(values)));
    let number = |value: Option<f64>| value.map_or_else(String::new, |v| v.to_string());
    let segments: Vec<String> = channels.segments.iter().map(|s| format!("{}..{}", s.start, s.end)).collect();
    let breaks: Vec<String> = channels.breaks.iter().map(|(row, s)| format!("{row}:{s}")).collect();
    let own = [
        ("tail_number", identity.flight.tail_number.to_string()),
        ("flight_id", identity.flight.flight_id.to_string()),
        ("departure_utc", identity.flight.departure_utc.to_string()),
        ("position", channels.position.to_string()),
        ("flight_hours", number(identity.flight.flight_hours)),
        ("tail_hours_end", number(identity.flight.tail_hours_end)),
        ("step_s", channels.step_s.to_string()),
        ("segments", segments.join(" ")),
        ("breaks", breaks.join(" ")),
        ("metres_per_radian", number(geometry.metres_per_radian())),
        ("temperature_c", number(channels.temperature_c)),
        ("apart", channels.excluded.to_string()),
        ("output_locked", channels.output_locked.to_string()),
        ("flags", channels.flags.join(" ")),
        ("units", "time_s: s since the first sample; motor_m, dx_m: m at the screw; load_n: N".to_owned()),
    ];
    let own = own.into_iter().map(|(key, value)| (format!("freeplay.{key}"), value));
    let source = provenance.iter().map(|(key, value)| (format!("freeplay.{key}"), value.clone()));
    let version = std::iter::once((KEY.to_owned(), VERSION.to_owned()));
    write_encoded(file, &columns, &version.chain(own).chain(source).collect::<Vec<_>>(), encoding)
}
