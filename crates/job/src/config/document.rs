//! Structure of `pipeline.toml`.

use std::collections::BTreeMap;
use std::time::Duration;

use glob::Pattern;
use ingest::log::flight_rows::flight_columns;
use ingest::log::identity::zone;
use ingest::mapping::IdentityField;
use ingest::mapping::column_pattern::nearest;
use ingest::mapping::units::TimeUnit;
use ingest::{Channels, ClockMapping, GroupMapping, IdentityMapping, Layout, Mapping};
use records::time::DAY_S;
use records::{Diagnostic, TailNumber};
use schemars::transform::transform_subschemas;
use schemars::{JsonSchema, Schema};
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;

use super::alerts::AlertChannel;
use super::keys::with_nearest;
use super::layers::{Faults, fits};
use crate::config::part::{PartSettings, QuantityLimits, WearAxis};

/// The whole file.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Document {
    /// Log files, and the tables that belong to them.
    pub logs: LogSettings,
    /// Where results are kept.
    #[serde(default)]
    pub store: StoreSettings,
    /// Limits of a run: time, rows and memory.
    #[serde(default)]
    pub run: RunSettings,
    /// Timeouts and retries of object stores.
    #[serde(default)]
    pub objects: ObjectSettings,
    /// How the flight of a log is identified.
    #[serde(default)]
    pub identity: IdentityMapping,
    /// The clock of the logs.
    #[serde(default)]
    pub clock: ClockMapping,
    /// How rows are laid out, where a row is not one sample of every channel.
    #[serde(default)]
    pub layout: Layout,
    /// The channels of an actuator.
    pub channel: Channels,
    /// Files of other kinds that belong to the same flight, by a name of your choice.
    #[serde(default)]
    pub group: BTreeMap<String, GroupMapping>,
    /// Settings that differ on some aircraft or for some parts; a later one wins.
    #[serde(default, rename = "override")]
    pub overrides: Vec<Override>,
    /// Column names of your tables.
    #[serde(default)]
    pub columns: TableNames,
    /// How the gap is estimated.
    #[serde(default)]
    pub estimate: EstimateSettings,
    /// The part designs, by part number.
    pub part: BTreeMap<String, PartSettings>,
    /// How the trend of a unit is assessed.
    #[serde(default)]
    pub trend: TrendSettings,
    /// Where changes of state are sent, by a name of your choice.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub alerts: BTreeMap<String, AlertChannel>,
}

/// `[logs]`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LogSettings {
    /// Patterns of log files, in folders or buckets (`s3://`): `*` within a name, `**` across folders.
    pub files: Vec<String>,
    /// The installations table.
    pub installations: String,
    /// Table of units that were modified or re-identified and keep their history: `former_serial_number`,
    /// `serial_number`; optional `former_part_number`, `part_number`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub aliases: Option<String>,
    /// The flights table: facts that the logs do not hold.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flights: Option<String>,
    /// Tails that logs of a path may name, such as `"incoming/supplier/**" = ["N41?FP"]`; another tail is an error.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub tails: BTreeMap<String, Vec<String>>,
    /// Whether files of one flight are its consecutive pieces. Without it, a second file is a copy or an error.
    /// `false`: logs with one flight id and different departures are different flights.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pieces: Option<bool>,
    /// Patterns of logs whose errors are known: they no longer make the exit code of later runs 1.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub acknowledged_errors: Vec<String>,
    /// The maintenance table.
    #[serde(default)]
    pub maintenance: Option<String>,
    /// The table of hangar free-play checks.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[serde(default)]
    pub inspections: Option<String>,
}

impl LogSettings {
    /// Every table that belongs to the logs, as its setting names it.
    pub fn tables(&self) -> impl Iterator<Item = &String> {
        let optional = [&self.aliases, &self.flights, &self.maintenance, &self.inspections];
        std::iter::once(&self.installations).chain(optional.into_iter().flatten())
    }

    /// Whether files of one flight are declared to be its pieces.
    pub fn has_pieces(&self) -> bool {
        self.pieces == Some(true)
    }

    /// The pattern of `tails` that a log fits without being of one of its tails.
    pub fn forbidden_by(&self, log_path: &str, tail: &TailNumber) -> Option<&str> {
        let forbids = |(pattern, tails): &(&String, &Vec<String>)| {
            fits(pattern, log_path) && !tails.iter().any(|allowed| fits(allowed, tail.as_str()))
        };
        self.tails.iter().find(forbids).map(|(pattern, _)| pattern.as_str())
    }
}

/// `[columns]`: our name → what the table calls it.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TableNames {
    /// Of the installations table.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub installations: BTreeMap<String, String>,
    /// Of the flights table.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub flights: BTreeMap<String, String>,
}

/// `[[override]]`: settings of logs that differ on some aircraft, or for some parts.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Override {
    /// Tail numbers, with `*` and `?`. Default: all.
    pub tails: Vec<String>,
    /// Part numbers, with `*` and `?`. Default: all.
    pub parts: Vec<String>,
    /// Keys of `[clock]` that differ; not for single parts.
    #[schemars(with = "Option<ClockMapping>", transform = require_nothing)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clock: Option<toml::Table>,
    /// Keys of `[channel]` that differ.
    #[schemars(with = "Option<Channels>", transform = require_nothing)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub channel: Option<toml::Table>,
}

/// Makes every key of a schema optional, at any depth: an override holds the keys that differ, and needs none of the others.
fn require_nothing(schema: &mut Schema) {
    schema.remove("required");
    transform_subschemas(&mut require_nothing, schema);
}

/// `[store]`.
#[derive(Debug, Clone, PartialEq, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StoreSettings {
    /// Folder, or bucket address and prefix, of the results. Default `results`.
    #[default = "results"]
    pub path: String,
}

/// `[run]`.
#[derive(Debug, Clone, PartialEq, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RunSettings {
    /// Memory of all actuators in progress, MiB. No limit by default.
    pub memory_mib: Option<u64>,
    /// A log that takes longer, s, ends as an error of that log. Default 600.
    #[default = 600.0]
    pub log_timeout_s: f64,
    /// A log or table that claims more rows is refused. Default 200,000,000.
    #[default(ingest::bounds::DEFAULT_MAX_ROWS)]
    pub max_rows: u64,
}

/// `[objects]`.
#[derive(Debug, Clone, PartialEq, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ObjectSettings {
    /// A request without a complete answer is repeated after this time, s. Default 30.
    #[default(object_io::Settings::DEFAULT.timeout.as_secs_f64())]
    pub timeout_s: f64,
    /// A request is not repeated after this time, s. Default 180.
    #[default(object_io::Settings::DEFAULT.give_up.as_secs_f64())]
    pub give_up_s: f64,
}

impl ObjectSettings {
    /// As settings of an object store. No timeout is longer than a day.
    pub(super) fn retry_settings(&self) -> object_io::Settings {
        let [timeout, give_up] =
            [self.timeout_s, self.give_up_s].map(|s| Duration::from_secs_f64(s.clamp(1e-3, DAY_S)));
        object_io::Settings { timeout, give_up }
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

impl Method {
    /// Its name in the configuration.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Contact => "contact",
            Self::Midrange => "midrange",
        }
    }
}

/// `[estimate]`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct EstimateSettings {
    /// What goes into `gap_m`.
    pub method: Method,
}

/// `[trend]`: hours are flight hours.
#[derive(Debug, Clone, PartialEq, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TrendSettings {
    /// A limit that may be reached within these flight hours makes state `plan`. Default 500.
    #[default(defaults().planning_horizon_hours)]
    pub planning_horizon_hours: f64,
    /// A later crossing of the limit is not reported, flight hours. Default 20 000.
    #[default(defaults().horizon_hours)]
    pub horizon_hours: f64,
    /// Days without a sound record after which a unit is `unassessed`. Default 30.
    #[default(defaults().stale_after_days)]
    pub stale_after_days: f64,
    /// Flight hours until the next check, for `check_probability`. Default 300.
    #[default(defaults().check_interval_hours)]
    pub next_check_hours: f64,
    /// Without effect; accepted so that older files load.
    #[serde(skip_serializing)]
    pub inspection_risk: Option<f64>,
    /// Date of assessments without `--as-of`. Default `now`.
    pub as_of: AsOf,
    /// What wear follows. Default: what fits the histories of each part number best.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub axis: Option<WearAxis>,
    /// Removal limit of parts without a `limit_m` of their own, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub limit_m: Option<f64>,
    /// Limits of the other followed quantities.
    pub quantity_limits: QuantityLimits,
}

/// Date of assessments.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AsOf {
    /// The time of the run.
    #[default]
    Now,
    /// The newest departure of all records.
    NewestRecord,
}

/// Defaults of an assessment; their limit is not used.
fn defaults() -> trend::Settings {
    trend::Settings::for_limit(1.0)
}

/// Groups of `identity.path` that hold the departure in two parts.
const DEPARTURE_PARTS: [&str; 2] = ["departure_date", "departure_time"];

impl Document {
    /// The JSON Schema of the file, every definition in its place.
    pub fn schema() -> serde_json::Value {
        let settings = schemars::generate::SchemaSettings::draft2020_12()
            .for_deserialize()
            .with(|s| s.inline_subschemas = true);
        settings.into_generator().into_root_schema_for::<Self>().to_value()
    }

    /// The mapping without overrides.
    pub(super) fn mapping(&self) -> Mapping {
        let bare = |group: &GroupMapping| GroupMapping { files: Vec::new(), ..group.clone() };
        Mapping {
            identity: self.identity.clone(),
            clock: self.clock.clone(),
            channels: self.channel.clone(),
            layout: self.layout.clone(),
            // Where a group's files lie moves no number.
            groups: self.group.iter().map(|(name, group)| (name.clone(), bare(group))).collect(),
        }
    }

    /// Reports each value that can be read but makes no sense, faults of channels excepted. `implausible` holds those of
    /// numbers, which are reported in their place among the others.
    pub(super) fn check(&self, implausible: Vec<Diagnostic>, faults: &mut Faults<'_>) {
        if self.logs.files.is_empty() {
            let hint = "files = [\"logs/**/*.parquet\"]";
            faults.wrong(&["logs", "files"], "no_logs", "`logs.files` has no pattern", hint);
        }
        if matches!(self.store.path.trim(), "" | ".") {
            let what = "`store.path` is not a folder of its own";
            faults.wrong(&["store", "path"], "empty_name", what, "path = \"results\"");
        }
        faults.within(&["clock"], |faults| check_clock(&self.clock, faults));
        faults.within(&["layout"], |faults| check_layout(&self.layout, faults));
        self.check_groups(faults);
        for text in self.logs.tails.iter().flat_map(|(pattern, tails)| tails.iter().chain([pattern])) {
            faults.pattern(&["logs", "tails"], text, "pattern");
        }
        faults.within(&["identity"], |faults| self.check_identity(faults));
        faults.found.extend(implausible);
        for (name, channel) in &self.alerts {
            faults.within(&["alerts", name], |faults| channel.check(name, faults));
        }
        self.check_parts(faults);
    }

    /// Settings of parts that would have no effect: a watch limit without a limit, an override for a part that is not there.
    fn check_parts(&self, faults: &mut Faults<'_>) {
        for (number, part) in &self.part {
            if part.watch_m.is_some() && part.limit_m.or(self.trend.limit_m).is_none() {
                let what = "`watch_m` has no effect without a `limit_m`";
                let hint = "add `limit_m = …` to the part, or `[trend] limit_m` for all parts";
                faults.wrong(&["part", number, "watch_m"], "key_missing", what, hint);
            }
        }
        let numbers = || self.part.keys().map(String::as_str);
        for name in self.overrides.iter().flat_map(|one| &one.parts) {
            let Ok(pattern) = Pattern::new(name) else { continue };
            if !self.part.is_empty() && !numbers().any(|number| pattern.matches(number)) {
                let near = nearest(name, numbers());
                let near = near.map(|near| format!("nearest: `{near}`; ")).unwrap_or_default();
                let what = format!("this override is for part `{name}`, which is not configured");
                let hint = format!("{near}compare `parts` with the `[part.\"…\"]` tables");
                faults.wrong(&["override"], "part_unknown", what, hint);
            }
        }
    }

    fn check_identity(&self, faults: &mut Faults<'_>) {
        match self.identity.path.as_ref().map(|p| regex::Regex::new(p)) {
            Some(Err(e)) => {
                // The parser prints the expression over several lines; the last one holds the error.
                let e = e.to_string();
                let why = e.lines().last().unwrap_or_default().trim_start_matches("error: ");
                let what = format!("`identity.path` is not a valid regular expression: {why}");
                let hint = "such as '(?<tail_number>N\\w+)/(?<departure_utc>\\d{8}T\\d{6}Z)\\.parquet$'";
                faults.wrong(&["path"], "bad_pattern", what, hint);
            }
            Some(Ok(regex)) => {
                let facts: Vec<&str> = IdentityField::ALL.iter().map(|fact| fact.as_str()).collect();
                let is_known = |group: &&str| facts.contains(group) || DEPARTURE_PARTS.contains(group);
                for group in regex.capture_names().flatten().filter(|group| !is_known(group)) {
                    let what = format!("`{group}` in `identity.path` is no fact of a flight");
                    let all = format!("its facts are {}", facts.join(", "));
                    let fault =
                        with_nearest(Diagnostic::new("unknown_key", what), group, facts.iter().copied(), all);
                    faults.report(&["path"], fault);
                }
            }
            None => {}
        }
        if self.identity.by_row && flight_columns(&self.identity).is_empty() {
            let what = "`identity.by_row` needs the columns in which rows name their flight";
            let hint = "such as columns = { tail_number = \"tail\", flight_id = \"flight\" }";
            faults.wrong(&["by_row"], "key_missing", what, hint);
        }
        if let Some(name) = self.identity.time_zone.as_deref().filter(|name| zone(name).is_err()) {
            let known: Vec<String> = jiff::tz::db().available().map(|zone| zone.to_string()).collect();
            let fault = Diagnostic::new("bad_zone", format!("unknown time zone `{name}`"));
            let otherwise = "names such as `UTC`, `Europe/Istanbul`, `America/New_York`";
            let known = known.iter().map(String::as_str);
            faults.report(&["time_zone"], with_nearest(fault, name, known, otherwise));
        }
    }

    fn check_groups(&self, faults: &mut Faults<'_>) {
        for (name, group) in &self.group {
            faults.within(&["group", name], |faults| {
                if group.files.is_empty() {
                    let what = format!("`group.{name}.files` names no file");
                    faults.wrong(&[], "no_logs", what, "files = [\"loads/**/*.parquet\"]");
                }
                check_layout(&group.layout, faults);
                if let Some(clock) = &group.clock {
                    faults.within(&["clock"], |faults| check_clock(clock, faults));
                }
            });
        }
    }
}

fn check_layout(layout: &Layout, faults: &mut Faults<'_>) {
    if layout.name_column.is_some() != layout.value_column.is_some() {
        let hint = "name_column = \"parameter\"\nvalue_column = \"value\"";
        faults.wrong(&[], "key_missing", "`name_column` and `value_column` go together", hint);
    }
}

/// Reports each key of a clock whose value makes no sense.
pub(super) fn check_clock(clock: &ClockMapping, faults: &mut Faults<'_>) {
    if clock.column.as_deref() == Some("") {
        let hint = "name it, or delete the key and give `rate_hz`, the rate of evenly spaced rows";
        faults.wrong(&["column"], "empty_name", "`clock.column` names no column", hint);
    }
    if clock.column.is_none() && clock.rate_hz.is_none() {
        let what = "neither `clock.column` nor `clock.rate_hz` is given";
        faults.wrong(&[], "no_clock", what, "[clock]\ncolumn = \"time_s\"\nunit = \"s\"");
    }
    if clock.unit == Some(TimeUnit::Count) && clock.rate_hz.is_none() {
        let what = "a clock in `count` needs `rate_hz`: how fast does it count?";
        faults.report(&["unit"], Diagnostic::new("no_clock", what));
    }
}
