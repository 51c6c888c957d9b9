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
use crate::error::{Error, ErrorKind};
use crate::log::identity::{Identity, IdentityFields};
use crate::log::types::ActuatorChannels;
use crate::mapping::IdentityField;
use crate::parquet::log_file::LogFile;
use crate::parquet::writer::{Column, Encoding, write_encoded};
use crate::time::clock::TimestampRepairs;

const VERSION: &str = "1";
const KEY: &str = "freeplay.normalized";

/// Content of the footer of a normalized log.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Normalized {
    /// Which flight it is, and which actuator.
    pub(crate) facts: IdentityFields,
    step_s: f64,
    segments: Vec<Range<usize>>,
    breaks: Vec<(usize, f64)>,
    metres_per_radian: Option<f64>,
    temperature_c: Option<f64>,
    flags: Vec<String>,
    /// Samples that no condition left.
    apart: usize,
    output_locked: bool,
}

impl Normalized {
    /// The columns, in the order of [`crate::ActuatorColumns`].
    pub(crate) const COLUMNS: [&'static str; 4] = ["motor_m", "dx_m", "load_n", "temperature_c"];

    /// The footer content of a file, if Freeplay normalized it.
    pub(crate) fn of(file: &LogFile) -> Result<Option<Self>, Error> {
        let Some(version) = file.metadata(KEY) else { return Ok(None) };
        let fail = |detail: String| file.error(ErrorKind::Normalized { detail });
        if version != VERSION {
            return Err(fail(format!("it is of form {version}, and this program knows {VERSION}")));
        }
        let text = |key: &str| file.metadata(&format!("freeplay.{key}")).filter(|t| !t.is_empty());
        let number = |key: &str| text(key).and_then(|t| t.parse::<f64>().ok());
        let step_s = number("step_s").ok_or_else(|| fail("`step_s` is missing".into()))?;
        let segments = text("segments").map_or_else(|| Some(Vec::new()), |text| pairs(text, ".."));
        let segments = segments.ok_or_else(|| fail("its stretches cannot be read".into()))?;
        let fact = |fact: &IdentityField| Some((*fact, text(fact.as_str())?.to_owned()));
        Ok(Some(Self {
            facts: IdentityField::ALL.iter().filter_map(fact).collect(),
            step_s,
            segments: segments.into_iter().map(|(start, end)| start..end).collect(),
            breaks: text("breaks").and_then(|text| pairs(text, ":")).unwrap_or_default(),
            metres_per_radian: number("metres_per_radian"),
            temperature_c: number("temperature_c"),
            output_locked: text("output_locked") == Some("true"),
            apart: text("apart").and_then(|t| t.parse().ok()).unwrap_or(0),
            flags: text("flags").map(|t| t.split(' ').map(str::to_owned).collect()).unwrap_or_default(),
        }))
    }

    /// The channels as they were written.
    pub(crate) fn read_actuator(
        &self,
        file: &LogFile,
        position: Position,
        geometry: Geometry,
    ) -> Result<ActuatorChannels, Error> {
        let fail = |detail: String| file.error(ErrorKind::Normalized { detail });
        let (now, then) = (geometry.metres_per_radian(), self.metres_per_radian);
        if now != then {
            let said = |v: Option<f64>| v.map_or_else(|| "no lead".to_owned(), |v| format!("{v} m/rad"));
            return Err(fail(format!("with {}, where the part has {}", said(then), said(now))));
        }
        let [motor, dx, load] = ["motor_m", "dx_m", "load_n"].map(|name| numbers(file, name));
        let read = [motor?, dx?, load?];
        if read.iter().any(|(_, seen)| seen.missing < self.apart) {
            let fewer = format!("a channel lacks fewer than the {} samples that are left out", self.apart);
            return Err(fail(fewer));
        }
        if self.segments.iter().any(|s| s.start > s.end || s.end > read[1].0.len()) {
            return Err(fail("a segment ends after the last row".into()));
        }
        let quality = read
            .each_ref()
            .map(|(values, seen)| Quality::of(values, &self.segments, Some(*seen), self.step_s, self.apart));
        let [motor_m, dx_m, load_n] = read.map(|(values, _)| values);
        Ok(ActuatorChannels {
            position,
            step_s: self.step_s,
            apart: self.apart,
            output_locked: self.output_locked,
            missing_share: quality[1].missing_share,
            columns: std::array::from_fn(|k| Some(Self::COLUMNS[k].to_owned())),
            quality,
            motor_m,
            dx_m,
            load_n,
            segments: self.segments.clone(),
            breaks: self.breaks.clone(),
            temperature_c: self.temperature_c,
            flags: self.flags.clone(),
            repairs: TimestampRepairs::default(),
        })
    }
}

fn numbers(file: &LogFile, name: &str) -> Result<(Vec<f64>, ChannelStats), Error> {
    let mut values = ColumnBuilder::with_capacity(file.rows().min(1 << 26), None).with_stats();
    file.append_numbers(name, None, &mut values)?;
    let (values, seen) = values.finish();
    let seen = seen.unwrap_or_else(|| ChannelStats::of(&values));
    Ok((values, seen))
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
    write_encoded(file, &columns, &footer(channels, identity, geometry, provenance), encoding)
}

fn footer(
    channels: &ActuatorChannels,
    identity: &Identity,
    geometry: Geometry,
    provenance: &BTreeMap<String, String>,
) -> Vec<(String, String)> {
    let number = |value: Option<f64>| value.map_or_else(String::new, |v| v.to_string());
    let segments: Vec<String> = channels.segments.iter().map(|s| format!("{}..{}", s.start, s.end)).collect();
    let breaks: Vec<String> = channels.breaks.iter().map(|(row, s)| format!("{row}:{s}")).collect();
    let own = [
        ("tail_number", identity.tail_number.to_string()),
        ("flight_id", identity.flight_id.to_string()),
        ("departure_utc", identity.departure_utc.to_string()),
        ("position", channels.position.to_string()),
        ("flight_hours", number(identity.flight_hours)),
        ("tail_hours_end", number(identity.tail_hours_end)),
        ("step_s", channels.step_s.to_string()),
        ("segments", segments.join(" ")),
        ("breaks", breaks.join(" ")),
        ("metres_per_radian", number(geometry.metres_per_radian())),
        ("temperature_c", number(channels.temperature_c)),
        ("apart", channels.apart.to_string()),
        ("output_locked", channels.output_locked.to_string()),
        ("flags", channels.flags.join(" ")),
        ("units", "time_s: s since the first sample; motor_m, dx_m: m at the screw; load_n: N".to_owned()),
    ];
    let own = own.into_iter().map(|(key, value)| (format!("freeplay.{key}"), value));
    let told = provenance.iter().map(|(key, value)| (format!("freeplay.{key}"), value.clone()));
    std::iter::once((KEY.to_owned(), VERSION.to_owned())).chain(own).chain(told).collect()
}
