//! `pipeline.toml`: read once, checked whole, and its digest carried by every record.

pub mod alerts;
mod document;
mod keys;
mod layers;
pub mod limits;
mod overrides;
pub mod part;
mod toml_errors;
mod validate_channels;

use std::collections::{BTreeMap, BTreeSet};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use ingest::{Flights, Mapping};
use records::{Diagnostic, PartNumber, TailNumber};
use serde::Serialize;

pub use alerts::AlertChannel;
pub use document::{AsOf, Document, EstimateSettings, Method, Override};
use layers::{ConfigLayer, Faults, Source};
use overrides::Overrides;
pub use part::QuantityLimits;

use crate::METHOD_VERSION;
use crate::config::part::{LimitedGap, Part};

/// A checked configuration. Its default has no logs and assesses tables that other programs made.
#[derive(Debug, Clone, Default)]
pub struct Config {
    /// The file as it was named by the user; several stand with ` + ` between them.
    pub file: PathBuf,
    /// The folder that relative paths in it start from.
    pub folder: PathBuf,
    /// The parsed document.
    pub document: Document,
    /// Its parts, checked.
    pub parts: BTreeMap<PartNumber, Part>,
    /// The flights table; empty when there is none.
    pub flights: Arc<Flights>,
    overrides: Overrides,
    layers: Arc<[ConfigLayer]>,
}

impl Config {
    /// Removal limit of a part, m: its own, or that of `[trend]`.
    pub fn limit_m(&self, part: Option<&PartNumber>) -> Option<f64> {
        let own = part.and_then(|part| self.parts.get(part)?.settings.limit_m);
        own.or(self.document.trend.limit_m)
    }

    /// The parts whose limits apply to the largest gap along the stroke.
    pub fn parts_by_largest_gap(&self) -> BTreeSet<String> {
        let is_largest = |part: &Part| part.settings.limit_applies_to == Some(LimitedGap::Largest);
        self.parts.iter().filter(|(_, part)| is_largest(part)).map(|(number, _)| number.to_string()).collect()
    }

    /// Reads the configuration as [`Config::read_settings`], and the flights table that it names.
    ///
    /// # Errors
    /// As [`Config::read_settings`], and the faults of the table.
    pub fn read_layers(files: &[PathBuf]) -> Result<Self, Vec<Diagnostic>> {
        let mut config = Self::read_settings(files)?;
        // Before the first table is read: it may lie in an object store.
        object_io::configure(config.document.objects.retry_settings());
        ingest::bounds::set_max_rows(config.document.run.max_rows);
        if let Some(table) = &config.document.logs.flights {
            let names = &config.document.columns.flights;
            let read = Flights::read(&config.path(table), names, &config.document.identity);
            let read = read.map_err(|e| e.iter().map(ingest::Error::diagnostic).collect::<Vec<_>>())?;
            config.flights = Arc::new(read);
        }
        Ok(config)
    }

    /// Reads files, each of which overrides those before it, and checks the result, without any table that it names.
    /// Relative paths start from the first file's folder.
    ///
    /// # Errors
    /// All diagnostics at once: an unreadable file or broken TOML alone, else every unknown key, else
    /// the first key of a wrong type, else every value that makes no sense.
    pub fn read_settings(files: &[PathBuf]) -> Result<Self, Vec<Diagnostic>> {
        let read = |file: &PathBuf| {
            const OTHER: &str =
                "create one with `freeplay init`, or select another with `--config FILE` or FREEPLAY_CONFIG";
            const AS_UTF_8: &str = "save the file as UTF-8";
            let file_name = file.display().to_string();
            let unreadable = |why: &str, hint: &str| {
                let what = format!("the configuration cannot be read: {why}");
                vec![Diagnostic::new("config_unreadable", what).in_file(&file_name).hint(hint)]
            };
            let text = std::fs::read_to_string(file).map_err(|e| match e.kind() {
                ErrorKind::NotFound => unreadable("no such file", OTHER),
                ErrorKind::IsADirectory => unreadable("this is a folder, not a file", OTHER),
                ErrorKind::InvalidData => unreadable("it is no UTF-8 text", AS_UTF_8),
                ErrorKind::PermissionDenied => {
                    unreadable("permission denied", "run as a user with read access, or change the file mode")
                }
                _ => unreadable(&e.to_string(), OTHER),
            })?;
            if text.contains('\0') {
                return Err(unreadable("it holds NUL bytes, as text in UTF-16 does", AS_UTF_8));
            }
            Ok((file_name, text))
        };
        let texts = files.iter().map(read).collect::<Result<Vec<_>, Vec<Diagnostic>>>()?;
        let folder = files.first().and_then(|f| f.parent()).map_or_else(PathBuf::new, Path::to_path_buf);
        let file_name: Vec<&str> = texts.iter().map(|(file_name, _)| file_name.as_str()).collect();
        let file = PathBuf::from(file_name.join(" + "));
        Self::from_layers(ConfigLayer::stack(texts), &file, &folder)
    }

    /// Reads and checks the text of a configuration whose relative paths start from `folder`.
    ///
    /// # Errors
    /// As [`Config::read_settings`].
    pub fn parse(text: &str, file: &Path, folder: &Path) -> Result<Self, Vec<Diagnostic>> {
        let file_name = file.display().to_string();
        Self::from_layers(ConfigLayer::stack([(file_name, text.to_owned())]), file, folder)
    }

    fn from_layers(layers: Vec<ConfigLayer>, file: &Path, folder: &Path) -> Result<Self, Vec<Diagnostic>> {
        let source = Source::parse(&layers).map_err(|diagnostic| vec![*diagnostic])?;
        let implausible = keys::check(&source, &Document::schema())?;
        let document: Document = source.document().map_err(|diagnostic| vec![diagnostic])?;
        let mut faults = Faults::new(&source);
        // Here, since the check of channels reads the document.
        faults.within(&["channel"], |faults| validate_channels::check(&document.channel, &document, faults));
        document.check(implausible, &mut faults);
        let mut parts = BTreeMap::new();
        for (number, settings) in &document.part {
            let part = faults.within(&["part", number], |faults| settings.check(faults));
            match PartNumber::new(number) {
                Ok(number) => parts.extend(part.map(|part| (number, part))),
                Err(e) => faults.report(&["part"], Diagnostic::new("empty_name", e)),
            }
        }
        let overrides = Overrides::check(&document, &mut faults);
        if !faults.found.is_empty() {
            return Err(faults.found);
        }
        let (file, folder, flights) = (file.to_owned(), folder.to_owned(), Arc::default());
        Ok(Self { file, folder, document, parts, flights, overrides, layers: layers.into() })
    }

    /// Adds to a diagnostic the line of the configuration that holds a text.
    pub fn at(&self, text: &str, diagnostic: Diagnostic) -> Diagnostic {
        layers::at_text(&self.layers, text, diagnostic)
    }

    /// File and line of the limit of a part, as text.
    pub fn limit_place(&self, part: Option<&str>) -> String {
        let Ok(source) = Source::parse(&self.layers) else { return self.file.display().to_string() };
        let own =
            part.filter(|part| self.document.part.get(*part).is_some_and(|part| part.limit_m.is_some()));
        let path = match own {
            Some(part) => vec!["part", part, "limit_m"],
            None => vec!["trend", "limit_m"],
        };
        let place = source.at(&path, Diagnostic::new("limit", ""));
        let line = place.line.map(|(line, _)| format!(" line {line}")).unwrap_or_default();
        format!("{}{line}", place.file.unwrap_or_default())
    }

    /// A path of the configuration, seen from the current folder.
    pub fn path(&self, relative: &str) -> PathBuf {
        if object_io::is_address(relative) { relative.into() } else { self.folder.join(relative) }
    }

    /// Where the results are.
    pub fn store(&self) -> PathBuf {
        self.path(&self.document.store.path)
    }

    /// The mapping without overrides.
    pub(crate) fn base_mapping(&self) -> &Arc<Mapping> {
        &self.overrides.base
    }

    /// The mapping of an aircraft's logs; with a part, of the channels of its actuators.
    pub fn mapping(&self, tail: &TailNumber, part: Option<&PartNumber>) -> Arc<Mapping> {
        self.overrides.mapping(tail, part)
    }

    /// Whether a part is configured and has an override.
    pub(crate) fn has_overrides(&self, part: &PartNumber) -> bool {
        self.parts.contains_key(part) && self.overrides.applies_to_part(part)
    }

    /// blake3 of every setting that can move a number of this part on this aircraft: the mapping, the method, the part and
    /// the version of the method. Limits and schedules are left out, since they move none.
    pub fn digest(&self, tail: &TailNumber, part: &PartNumber) -> Arc<str> {
        self.overrides.cached(tail, Some(part), |mapping| self.digest_with(mapping, part))
    }

    /// The mapping of an aircraft's logs, as JSON.
    pub(crate) fn mapping_text(&self, tail: &TailNumber) -> Arc<str> {
        self.overrides.cached(tail, None, |mapping| serde_json::to_string(mapping).unwrap_or_default())
    }

    /// The same for a log whose aircraft is unknown.
    pub fn digest_of_part(&self, part: &PartNumber) -> String {
        self.digest_with(self.base_mapping(), part)
    }

    fn digest_with(&self, mapping: &Mapping, part: &PartNumber) -> String {
        #[derive(Serialize)]
        struct DigestInput<'a> {
            method_version: u32,
            mapping: &'a Mapping,
            estimate: &'a EstimateSettings,
            part: Option<part::PartSettings>,
        }
        let settings = self.document.part.get(part.as_str()).map(part::PartSettings::without_limits);
        let input = DigestInput {
            method_version: METHOD_VERSION,
            mapping,
            estimate: &self.document.estimate,
            part: settings,
        };
        // Structs and sorted maps of numbers and text always have a JSON form.
        let text = serde_json::to_vec(&input).unwrap_or_default();
        blake3::hash(&text).to_hex().to_string()
    }
}
