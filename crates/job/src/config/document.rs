//! What `pipeline.toml` may say, as it is written.

use std::collections::BTreeMap;

use fleet::Complaint;
use ingest::identity::zone;
use ingest::pattern::{PLACEHOLDER, nearest};
use ingest::schema::Fact;
use ingest::unit::Dimension;
use ingest::{ChannelMapping, Channels, ClockMapping, IdentityMapping, Mapping};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::source::Source;
use crate::part::PartSettings;
use crate::value::positive;

/// The whole file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Document {
    /// Which logs, and which tables beside them.
    pub logs: LogSettings,
    /// Where results are kept.
    #[serde(default)]
    pub store: StoreSettings,
    /// Where a log says which flight it is.
    #[serde(default)]
    pub identity: IdentityMapping,
    /// The clock of the logs.
    #[serde(default)]
    pub clock: ClockMapping,
    /// The channels of an actuator.
    pub channel: Channels,
    /// How the gap is estimated.
    #[serde(default)]
    pub estimate: EstimateSettings,
    /// The designs, by part number.
    pub part: BTreeMap<String, PartSettings>,
    /// How gaps become statements about a unit.
    #[serde(default)]
    pub trend: TrendSettings,
}

/// `[logs]`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LogSettings {
    /// Patterns of log files, from the folder of this file: `*` within a name, `**` across folders.
    pub files: Vec<String>,
    /// The installations table, CSV or Parquet.
    pub installations: String,
}

/// `[store]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StoreSettings {
    /// Folder of the results. Default `results`.
    pub path: String,
}

impl Default for StoreSettings {
    fn default() -> Self {
        Self { path: "results".into() }
    }
}

/// Which estimator fills `gap_m`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Contact regression: finds stiffness, skew and friction in the flight, and carries an interval.
    #[default]
    Contact,
    /// The paper's statistic, equations 29–31, as it is.
    Midrange,
}

/// `[estimate]`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct EstimateSettings {
    /// What goes into `gap_m`.
    pub method: Method,
}

/// `[trend]`: hours are flight hours.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TrendSettings {
    /// A limit that may be met within these hours makes state `plan`. Default 500.
    pub planning_horizon_hours: f64,
    /// Beyond these hours a crossing is not stated. Default 20 000.
    pub horizon_hours: f64,
    /// Without an estimate for so many days there is no state. Default 30.
    pub stale_after_days: f64,
}

impl Default for TrendSettings {
    fn default() -> Self {
        Self { planning_horizon_hours: 500.0, horizon_hours: 20_000.0, stale_after_days: 30.0 }
    }
}

impl Document {
    /// The JSON Schema of the file, every definition in its place.
    pub fn schema() -> serde_json::Value {
        let settings = schemars::generate::SchemaSettings::draft2020_12()
            .for_deserialize()
            .with(|s| s.inline_subschemas = true);
        settings.into_generator().into_root_schema_for::<Self>().to_value()
    }

    pub(super) fn mapping(&self) -> Mapping {
        Mapping { identity: self.identity.clone(), clock: self.clock.clone(), channels: self.channel.clone() }
    }

    /// Everything that reads well but cannot be meant.
    pub(super) fn check(&self, source: &Source<'_>) -> Vec<Complaint> {
        let mut found = Vec::new();
        if self.logs.files.is_empty() {
            let c = Complaint::new("no_logs", "`logs.files` names no log")
                .hint("files = [\"logs/**/*.parquet\"]");
            found.push(source.at(&["logs", "files"], c));
        }
        self.check_channels(source, &mut found);
        self.check_clock(source, &mut found);
        self.check_identity(source, &mut found);
        for (key, hours) in [
            ("planning_horizon_hours", self.trend.planning_horizon_hours),
            ("horizon_hours", self.trend.horizon_hours),
            ("stale_after_days", self.trend.stale_after_days),
        ] {
            found.extend(positive(key, Some(hours)).map(|c| source.at(&["trend", key], c)));
        }
        found
    }

    fn check_identity(&self, source: &Source<'_>, found: &mut Vec<Complaint>) {
        match self.identity.path.as_ref().map(|p| regex::Regex::new(p)) {
            Some(Err(e)) => {
                let c =
                    Complaint::new("bad_pattern", format!("`identity.path` is no regular expression: {e}"));
                found.push(source.at(&["identity", "path"], c));
            }
            Some(Ok(regex)) => {
                let facts = || Fact::ALL.iter().map(|fact| fact.as_str());
                for group in
                    regex.capture_names().flatten().filter(|group| !facts().any(|fact| fact == *group))
                {
                    let c = Complaint::new(
                        "unknown_key",
                        format!("`{group}` in `identity.path` is no fact of a flight"),
                    );
                    let c = match nearest(group, facts()) {
                        Some(near) => c.hint(format!("`{near}`?")),
                        None => c.hint(format!("its facts are {}", facts().collect::<Vec<_>>().join(", "))),
                    };
                    found.push(source.at(&["identity", "path"], c));
                }
            }
            None => {}
        }
        if let Some(Err(e)) = self.identity.time_zone.as_deref().map(zone) {
            found.push(source.at(&["identity", "time_zone"], Complaint::new("bad_zone", e)));
        }
    }

    fn check_channels(&self, source: &Source<'_>, found: &mut Vec<Complaint>) {
        let c = &self.channel;
        let position = [Dimension::Length, Dimension::Angle];
        let load = [Dimension::Force, Dimension::Torque];
        let temperature = [Dimension::Temperature; 2];
        let needed = [
            ("motor_position", &c.motor_position, position),
            ("screw_position", &c.screw_position, position),
            ("load", &c.load, load),
        ];
        let all = needed.into_iter().chain(c.temperature.iter().map(|t| ("temperature", t, temperature)));
        let mut columns: BTreeMap<&str, &str> = BTreeMap::new();
        for (name, channel, wanted) in all {
            found.extend(
                channel_complaints(name, channel, wanted)
                    .into_iter()
                    .map(|(key, c)| source.at(&["channel", name, key], c)),
            );
            if let Some(other) = columns.insert(&channel.column, name) {
                let c = Complaint::new(
                    "column_twice",
                    format!("`{}` is mapped to both {other} and {name}", channel.column),
                )
                .hint("two channels cannot share a column");
                found.push(source.at(&["channel", name, "column"], c));
            }
        }
    }

    fn check_clock(&self, source: &Source<'_>, found: &mut Vec<Complaint>) {
        let clock = &self.clock;
        if clock.column.is_none() && clock.rate_hz.is_none() {
            let c = Complaint::new("no_clock", "neither `clock.column` nor `clock.rate_hz` is given")
                .hint("[clock]\ncolumn = \"time_s\"\nunit = \"s\"");
            found.push(source.at(&["clock"], c));
        }
        for (key, value) in [("rate_hz", clock.rate_hz), ("max_back_s", clock.max_back_s)] {
            found.extend(positive(key, value).map(|c| source.at(&["clock", key], c)));
        }
    }
}

fn channel_complaints(
    name: &str,
    channel: &ChannelMapping,
    wanted: [Dimension; 2],
) -> Vec<(&'static str, Complaint)> {
    let mut found = Vec::new();
    let dimension = channel.unit.dimension();
    if !wanted.contains(&dimension) {
        let words: Vec<&str> = if wanted[0] == wanted[1] {
            vec![wanted[0].as_str()]
        } else {
            wanted.map(Dimension::as_str).to_vec()
        };
        let what =
            format!("`channel.{name}` is in {}, a unit of {}", channel.unit.as_str(), dimension.as_str());
        found.push((
            "unit",
            Complaint::new("unit_contradicts", what)
                .hint(format!("it needs a unit of {}", words.join(" or "))),
        ));
    }
    if channel.column.matches(PLACEHOLDER).count() > 1 {
        let what = format!("`{}` holds {PLACEHOLDER} more than once", channel.column);
        found.push(("column", Complaint::new("bad_pattern", what)));
    }
    if !matches!(channel.sign, 1 | -1) {
        let what = format!("`sign` is {}, which must be 1 or -1", channel.sign);
        found.push(("sign", Complaint::new("bad_sign", what)));
    }
    if channel.scale == 0.0 || !channel.scale.is_finite() {
        let what = format!("`scale` is {}, which would make every value the same", channel.scale);
        found.push(("scale", Complaint::new("bad_scale", what)));
    }
    found.extend(positive("gear_ratio", Some(channel.gear_ratio)).map(|c| ("gear_ratio", c)));
    found.extend(positive("wraps_at", channel.wraps_at).map(|c| ("wraps_at", c)));
    found
}
