//! Validation of `[channel]`.

use std::collections::BTreeMap;

use ingest::mapping::column_pattern::PLACEHOLDER;
use ingest::mapping::units::Dimension;
use ingest::{ChannelMapping, Channels, GroupMapping, Layout, SampleFilter};
use records::Diagnostic;

use super::keys::with_nearest;
use super::layers::Source;

/// Every diagnostic about the channels, each at its key.
pub(super) fn check(
    channels: &Channels,
    has_locked_part: bool,
    layout: &Layout,
    groups: &BTreeMap<String, GroupMapping>,
    path: &[&str],
    source: &Source<'_>,
    found: &mut Vec<Diagnostic>,
) {
    let mut report = |keys: &[&str], c: Diagnostic| {
        let whole: Vec<&str> = path.iter().chain(keys).copied().collect();
        found.push(source.at(&whole, c));
    };
    let mut columns: BTreeMap<(&str, Option<&str>), &str> = BTreeMap::new();
    for (name, channel, wanted) in named(channels) {
        for (key, c) in diagnostics(name, channel, wanted, layout, groups) {
            report(&[name, key], c);
        }
        for choice in channel.choices().filter(|choice| !choice.column.is_empty()) {
            if let Some(other) = columns.insert((&choice.column, choice.group.as_deref()), name) {
                let what = format!("`{}` is mapped to both {other} and {name}", choice.column);
                let what = if other == name {
                    format!("`{}` is mapped to {name} twice", choice.column)
                } else {
                    what
                };
                let c = Diagnostic::new("column_twice", what).hint("two channels cannot share a column");
                report(&[name, "column"], c);
            }
        }
    }
    for condition in &channels.when {
        for c in conditions(condition, groups) {
            report(&["when"], c);
        }
    }
    match (&channels.screw_position, &channels.relative_position) {
        (None, None) if has_locked_part || channels.output.is_locked() => {}
        (None, None) => {
            let what = "neither `screw_position` nor `relative_position` is mapped";
            report(&[], Diagnostic::new("key_missing", what).hint("[channel.screw_position]\n# or, where the output is fixed: [part.\"…\"] output = \"locked\""));
        }
        (Some(_), Some(_)) => {
            let what = "both `screw_position` and `relative_position` are mapped";
            let c = Diagnostic::new("key_of_other_kind", what)
                .hint("the relative position is screw − motor: map one of them");
            report(&["relative_position"], c);
        }
        _ => {}
    }
}

fn named(channels: &Channels) -> impl Iterator<Item = (&'static str, &ChannelMapping, [Dimension; 2])> {
    let position = [Dimension::Length, Dimension::Angle];
    [
        ("motor_position", Some(&channels.motor_position), position),
        ("screw_position", channels.screw_position.as_ref(), position),
        ("relative_position", channels.relative_position.as_ref(), position),
        ("load", Some(&channels.load), [Dimension::Force, Dimension::Torque]),
        ("temperature", channels.temperature.as_ref(), [Dimension::Temperature; 2]),
    ]
    .into_iter()
    .filter_map(|(name, channel, wanted)| Some((name, channel?, wanted)))
}

fn diagnostics(
    name: &str,
    channel: &ChannelMapping,
    wanted: [Dimension; 2],
    layout: &Layout,
    groups: &BTreeMap<String, GroupMapping>,
) -> Vec<(&'static str, Diagnostic)> {
    let mut found: Vec<_> =
        channel.choices().flat_map(|choice| one(name, choice, wanted, layout, groups)).collect();
    if channel.alternatives.iter().any(|a| !a.alternatives.is_empty()) {
        let what = format!("an alternative of `channel.{name}` has alternatives of its own");
        found.push((
            "alternatives",
            Diagnostic::new("bad_pattern", what).hint("list them all in one row, best first"),
        ));
    }
    found
}

fn one(
    name: &str,
    channel: &ChannelMapping,
    wanted: [Dimension; 2],
    layout: &Layout,
    groups: &BTreeMap<String, GroupMapping>,
) -> Vec<(&'static str, Diagnostic)> {
    let mut found = Vec::new();
    found.extend(wrong_unit(name, channel, wanted).map(|c| ("unit", c)));
    if channel.column.trim().is_empty() {
        found.push(("column", Diagnostic::new("empty_name", format!("`channel.{name}` names no column"))));
    }
    if channel.column.matches(PLACEHOLDER).count() > 1 {
        let what = format!("`{}` holds {PLACEHOLDER} more than once", channel.column);
        found.push(("column", Diagnostic::new("bad_pattern", what)));
    }
    if layout.position_column.is_some() && channel.group.is_none() && channel.column.contains(PLACEHOLDER) {
        let what = format!(
            "`{}` contains {PLACEHOLDER}, but `layout.position_column` already gives the position",
            channel.column
        );
        found.push(("column", Diagnostic::new("bad_pattern", what)));
    }
    if !matches!(channel.sign, 1 | -1) {
        let what = format!("`sign` is {}, which must be 1 or -1", channel.sign);
        found.push(("sign", Diagnostic::new("bad_sign", what)));
    }
    if channel.scale == 0.0 || !channel.scale.is_finite() {
        let what = format!("`scale` is {}, which would make every value the same", channel.scale);
        found.push(("scale", Diagnostic::new("bad_scale", what)));
    }
    found.extend(status_bits(channel).map(|c| ("valid_bits", c)));
    for (key, value) in
        [("latency_s", channel.latency_s), ("instant_s", channel.instant_s), ("offset", channel.offset)]
    {
        if !value.is_finite() {
            found.push((key, Diagnostic::new("bad_parameter", format!("`{key}` is {value}, not a number"))));
        }
    }
    found.extend(unknown_group(name, channel, groups).map(|c| ("group", c)));
    found
}

/// Bits of a status word that no word can have, or that no column holds.
fn status_bits(channel: &ChannelMapping) -> Option<Diagnostic> {
    let (set, clear) = (channel.valid_bits.unwrap_or(0), channel.invalid_bits.unwrap_or(0));
    channel.valid_bits.or(channel.invalid_bits)?;
    let (what, hint) = if channel.valid_column.is_none() {
        ("`valid_bits` names bits of no column".to_owned(), "valid_column = \"…\"")
    } else if set & clear != 0 {
        let what = format!("bits {:#x} are in both `valid_bits` and `invalid_bits`", set & clear);
        (what, "a bit is set or clear in a valid sample, not both")
    } else if channel.valid_values != ChannelMapping::default().valid_values {
        (
            "both `valid_bits` and `valid_values` are given".to_owned(),
            "name the bits, or the values of the whole word",
        )
    } else {
        return None;
    };
    Some(Diagnostic::new("bad_parameter", what).hint(hint))
}

fn wrong_unit(name: &str, channel: &ChannelMapping, wanted: [Dimension; 2]) -> Option<Diagnostic> {
    let dimension = channel.unit.dimension();
    if wanted.contains(&dimension) {
        return None;
    }
    let words: Vec<&str> = if wanted[0] == wanted[1] {
        vec![wanted[0].as_str()]
    } else {
        wanted.map(Dimension::as_str).to_vec()
    };
    let what = format!("`channel.{name}` is in {}, a unit of {}", channel.unit.as_str(), dimension.as_str());
    Some(Diagnostic::new("unit_contradicts", what).hint(format!("it needs a unit of {}", words.join(" or "))))
}

/// What a condition asks and cannot mean.
fn conditions(condition: &SampleFilter, groups: &BTreeMap<String, GroupMapping>) -> Vec<Diagnostic> {
    let column = &condition.column;
    let mut found = Vec::new();
    if column.trim().is_empty() {
        found.push(Diagnostic::new("empty_name", "a condition of `channel.when` names no column"));
    }
    if !condition.has_condition() {
        let what = format!("the condition on `{column}` asks nothing of it");
        found.push(Diagnostic::new("key_missing", what).hint("equals = [1]"));
    }
    if let Some((least, most)) =
        condition.at_least.zip(condition.at_most).filter(|(least, most)| least > most)
    {
        let what = format!("`at_least` {least} is above `at_most` {most}: no value of `{column}` matches");
        found.push(Diagnostic::new("bad_parameter", what));
    }
    if let Some(margin_s) = condition.margin_s.filter(|s| !(s.is_finite() && *s >= 0.0)) {
        let what = format!("`margin_s` of the condition on `{column}` is {margin_s}");
        found.push(Diagnostic::new("bad_parameter", what).hint("seconds, zero or more"));
    }
    let map = ChannelMapping { group: condition.group.clone(), ..ChannelMapping::default() };
    found.extend(unknown_group("when", &map, groups));
    found
}

fn unknown_group(
    name: &str,
    channel: &ChannelMapping,
    groups: &BTreeMap<String, GroupMapping>,
) -> Option<Diagnostic> {
    let group = channel.group.as_ref().filter(|group| !groups.contains_key(*group))?;
    let c = Diagnostic::new(
        "unknown_key",
        format!("`channel.{name}` names group `{group}`, and there is no `[group.{group}]`"),
    );
    let otherwise = format!("[group.{group}]\nfiles = [\"…\"]");
    Some(with_nearest(c, group, groups.keys().map(String::as_str), otherwise))
}
