//! Settings that differ on some aircraft or for some parts: overrides of the common settings.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, PoisonError};

use ingest::{Channels, ClockMapping, Mapping};
use records::{Diagnostic, PartNumber, TailNumber};
use serde::de::DeserializeOwned;

use super::document::{Document, Override, check_clock};
use super::layers::Faults;
use super::validate_channels;

#[derive(Debug, Default)]
pub(super) struct Overrides {
    /// The mapping without overrides.
    pub(super) base: Arc<Mapping>,
    overrides: Vec<ValidatedOverride>,
    cached: Mutex<MappingCache>,
}

type MappingCache = BTreeMap<(Vec<usize>, Option<PartNumber>), Arc<str>>;

impl Clone for Overrides {
    fn clone(&self) -> Self {
        Self { base: Arc::clone(&self.base), overrides: self.overrides.clone(), ..Self::default() }
    }
}

#[derive(Debug, Clone, Default)]
struct ValidatedOverride {
    tails: Vec<glob::Pattern>,
    parts: Vec<glob::Pattern>,
    /// Part numbers that are not patterns: there may be many, so they are a set.
    exact_parts: BTreeSet<PartNumber>,
    clock: toml::Table,
    channel: toml::Table,
}

impl ValidatedOverride {
    fn is_for(&self, tail: &TailNumber, part: Option<&PartNumber>) -> bool {
        let tail_fits = self.tails.is_empty() || self.tails.iter().any(|p| p.matches(tail.as_str()));
        let is_for_all = self.parts.is_empty() && self.exact_parts.is_empty();
        tail_fits && (is_for_all || part.is_some_and(|part| self.names_part(part)))
    }

    fn names_part(&self, part: &PartNumber) -> bool {
        self.exact_parts.contains(part) || self.parts.iter().any(|p| p.matches(part.as_str()))
    }
}

impl Overrides {
    /// Reads the overrides, and reports the faults of each alone on the rest of the configuration.
    pub(super) fn check(document: &Document, faults: &mut Faults<'_>) -> Self {
        let base = document.mapping();
        let mut overrides: Vec<_> = faults.within(&["override"], |faults| {
            let numbered = document.overrides.iter().enumerate();
            numbered.map(|(number, own)| validate(own, number, document, &base, faults)).collect()
        });
        overrides.extend(locked_parts(document));
        Self { base: Arc::new(base), overrides, ..Self::default() }
    }

    /// How the logs of an aircraft are read, or the channels of a part on it.
    pub(super) fn mapping(&self, tail: &TailNumber, part: Option<&PartNumber>) -> Arc<Mapping> {
        let numbers = self.numbers(tail, part);
        let mut mapping = Arc::clone(&self.base);
        for one in numbers.iter().map(|&number| &self.overrides[number]) {
            // Each was tried alone; two that only clash together leave what was before.
            let changed = Arc::make_mut(&mut mapping);
            if let Ok(clock) = merge_into(&changed.clock, &one.clock) {
                changed.clock = clock;
            }
            if let Ok(channels) = merge_into(&changed.channels, &one.channel) {
                changed.channels = channels;
            }
        }
        mapping
    }

    /// The text for the same key, made once: a run needs it once per log.
    pub(super) fn cached(
        &self,
        tail: &TailNumber,
        part: Option<&PartNumber>,
        make: impl FnOnce(&Mapping) -> String,
    ) -> Arc<str> {
        let key = (self.numbers(tail, part), part.cloned());
        let cached = || self.cached.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = cached().get(&key) {
            return Arc::clone(known);
        }
        let text: Arc<str> = make(&self.mapping(tail, part)).into();
        cached().insert(key, Arc::clone(&text));
        text
    }

    fn numbers(&self, tail: &TailNumber, part: Option<&PartNumber>) -> Vec<usize> {
        let applies = |(number, one): (usize, &ValidatedOverride)| one.is_for(tail, part).then_some(number);
        self.overrides.iter().enumerate().filter_map(applies).collect()
    }

    pub(super) fn applies_to_part(&self, part: &PartNumber) -> bool {
        self.overrides.iter().any(|one| one.names_part(part))
    }
}

/// What `output = "locked"` changes in the channels of the parts that have it.
fn locked_parts(document: &Document) -> Option<ValidatedOverride> {
    let locked = document.part.iter().filter(|(_, settings)| settings.output.is_locked());
    let exact_parts: BTreeSet<PartNumber> =
        locked.filter_map(|(number, _)| PartNumber::new(number).ok()).collect();
    let channel = toml::Table::from_iter([("output".to_owned(), toml::Value::from("locked"))]);
    let one = ValidatedOverride { exact_parts, channel, ..ValidatedOverride::default() };
    (!one.exact_parts.is_empty()).then_some(one)
}

/// Applies one override alone to the document, and reports the faults that it causes.
fn validate(
    settings: &Override,
    number: usize,
    document: &Document,
    base: &Mapping,
    faults: &mut Faults<'_>,
) -> ValidatedOverride {
    let mut patterns = |texts: &[String]| {
        texts.iter().filter_map(|text| faults.pattern(&[], text, "name pattern")).collect()
    };
    let one = ValidatedOverride {
        tails: patterns(&settings.tails),
        parts: patterns(&settings.parts),
        clock: settings.clock.clone().unwrap_or_default(),
        channel: settings.channel.clone().unwrap_or_default(),
        ..ValidatedOverride::default()
    };
    if settings.clock.is_some() && !settings.parts.is_empty() {
        let what = "an override for parts gives a `clock`, but a log has one clock for all its actuators";
        faults.wrong(&[], "key_of_other_kind", what, "give it under `tails` alone");
    }
    if settings.clock.is_none() && settings.channel.is_none() {
        faults.wrong(&[], "key_missing", "an override changes nothing", "[override.channel.load]\nsign = -1");
        return one;
    }
    let failed = |key: &str, e: String| {
        let what = format!("`{key}` of override {} cannot override `[{key}]`: {e}", number + 1);
        Diagnostic::new("bad_toml", what)
    };
    match merge_into::<Channels>(&base.channels, &one.channel) {
        Ok(channels) => validate_channels::check(&channels, document, faults),
        Err(e) => faults.report(&[], failed("channel", e)),
    }
    match merge_into::<ClockMapping>(&base.clock, &one.clock) {
        Ok(clock) => check_clock(&clock, faults),
        Err(e) => faults.report(&[], failed("clock", e)),
    }
    one
}

/// Given keys replace those below; tables are merged key by key.
fn merge_into<T: serde::Serialize + DeserializeOwned>(base: &T, over: &toml::Table) -> Result<T, String> {
    let mut table = toml::Table::try_from(base).map_err(|e| e.to_string())?;
    merge(&mut table, over);
    table.try_into().map_err(|e: toml::de::Error| e.message().to_owned())
}

fn merge(below: &mut toml::Table, over: &toml::Table) {
    for (key, value) in over {
        match (below.get_mut(key), value) {
            (Some(toml::Value::Table(inner)), toml::Value::Table(value)) => merge(inner, value),
            _ => drop(below.insert(key.clone(), value.clone())),
        }
    }
}
