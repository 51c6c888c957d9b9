//! Validation of `[channel]`.

use std::collections::BTreeMap;

use ingest::mapping::column_pattern::PLACEHOLDER;
use ingest::mapping::units::Dimension;
use ingest::{ChannelMapping, Channels, SampleFilter};
use records::Diagnostic;

use super::document::Document;
use super::keys::with_nearest;
use super::layers::Faults;

/// Reports every fault of the channels, each at its key.
pub(super) fn check(channels: &Channels, document: &Document, faults: &mut Faults<'_>) {
    let mut columns: BTreeMap<(&str, Option<&str>), &str> = BTreeMap::new();
    for (name, channel, wanted) in named(channels) {
        faults.within(&[name], |faults| {
            channel.choices().for_each(|choice| check_choice(name, choice, wanted, document, faults));
            if channel.alternatives.iter().any(|a| !a.alternatives.is_empty()) {
                let what = format!("an alternative of `channel.{name}` has alternatives of its own");
                faults.wrong(&["alternatives"], "bad_pattern", what, "list them all in one row, best first");
            }
            for choice in channel.choices().filter(|choice| !choice.column.is_empty()) {
                let column = &choice.column;
                let what = match columns.insert((column, choice.group.as_deref()), name) {
                    None => continue,
                    Some(other) if other == name => format!("`{column}` is mapped to {name} twice"),
                    Some(other) => format!("`{column}` is mapped to both {other} and {name}"),
                };
                faults.wrong(&["column"], "column_twice", what, "two channels cannot share a column");
            }
        });
    }
    channels.when.iter().for_each(|condition| check_condition(condition, document, faults));
    let is_locked = channels.output.is_locked() || document.part.values().any(|part| part.output.is_locked());
    match (&channels.screw_position, &channels.relative_position) {
        (None, None) if is_locked => {}
        (None, None) => {
            let what = "neither `screw_position` nor `relative_position` is mapped";
            let hint =
                "[channel.screw_position]\n# or, where the output is fixed: [part.\"…\"] output = \"locked\"";
            faults.wrong(&[], "key_missing", what, hint);
        }
        (Some(_), Some(_)) => {
            let what = "both `screw_position` and `relative_position` are mapped";
            let hint = "the relative position is screw − motor: map one of them";
            faults.wrong(&["relative_position"], "key_of_other_kind", what, hint);
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

fn check_choice(
    name: &str,
    channel: &ChannelMapping,
    wanted: [Dimension; 2],
    document: &Document,
    faults: &mut Faults<'_>,
) {
    let column = &channel.column;
    let dimension = channel.unit.dimension();
    if !wanted.contains(&dimension) {
        let [one, other] = wanted.map(Dimension::as_str);
        let needed = if one == other { one.to_owned() } else { format!("{one} or {other}") };
        let what =
            format!("`channel.{name}` is in {}, a unit of {}", channel.unit.as_str(), dimension.as_str());
        faults.wrong(&["unit"], "unit_contradicts", what, format!("it needs a unit of {needed}"));
    }
    let mut report = |key: &str, code: &str, what: String| faults.report(&[key], Diagnostic::new(code, what));
    if column.trim().is_empty() {
        report("column", "empty_name", format!("`channel.{name}` names no column"));
    }
    if column.matches(PLACEHOLDER).count() > 1 {
        report("column", "bad_pattern", format!("`{column}` holds {PLACEHOLDER} more than once"));
    }
    let has_position_column = document.layout.position_column.is_some() && channel.group.is_none();
    if has_position_column && column.contains(PLACEHOLDER) {
        let what = "but `layout.position_column` already gives the position";
        report("column", "bad_pattern", format!("`{column}` contains {PLACEHOLDER}, {what}"));
    }
    if !matches!(channel.sign, 1 | -1) {
        report("sign", "bad_sign", format!("`sign` is {}, which must be 1 or -1", channel.sign));
    }
    if channel.scale == 0.0 || !channel.scale.is_finite() {
        let what = format!("`scale` is {}, which would make every value the same", channel.scale);
        report("scale", "bad_scale", what);
    }
    if let Some(fault) = status_bits(channel) {
        faults.report(&["valid_bits"], fault);
    }
    for (key, value) in
        [("latency_s", channel.latency_s), ("instant_s", channel.instant_s), ("offset", channel.offset)]
    {
        if !value.is_finite() {
            let what = format!("`{key}` is {value}, not a number");
            faults.report(&[key], Diagnostic::new("bad_parameter", what));
        }
    }
    if let Some(fault) = unknown_group(name, channel.group.as_ref(), document) {
        faults.report(&["group"], fault);
    }
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

fn check_condition(condition: &SampleFilter, document: &Document, faults: &mut Faults<'_>) {
    let column = &condition.column;
    let mut report = |fault: Diagnostic| faults.report(&["when"], fault);
    if column.trim().is_empty() {
        report(Diagnostic::new("empty_name", "a condition of `channel.when` names no column"));
    }
    if !condition.has_condition() {
        let what = format!("the condition on `{column}` asks nothing of it");
        report(Diagnostic::new("key_missing", what).hint("equals = [1]"));
    }
    let bounds = condition.at_least.zip(condition.at_most);
    if let Some((least, most)) = bounds.filter(|(least, most)| least > most) {
        let what = format!("`at_least` {least} is above `at_most` {most}: no value of `{column}` matches");
        report(Diagnostic::new("bad_parameter", what));
    }
    if let Some(margin_s) = condition.margin_s.filter(|s| !(s.is_finite() && *s >= 0.0)) {
        let what = format!("`margin_s` of the condition on `{column}` is {margin_s}");
        report(Diagnostic::new("bad_parameter", what).hint("seconds, zero or more"));
    }
    unknown_group("when", condition.group.as_ref(), document).into_iter().for_each(report);
}

fn unknown_group(name: &str, group: Option<&String>, document: &Document) -> Option<Diagnostic> {
    let group = group.filter(|group| !document.group.contains_key(*group))?;
    let what = format!("`channel.{name}` names group `{group}`, and there is no `[group.{group}]`");
    let otherwise = format!("[group.{group}]\nfiles = [\"…\"]");
    let known = document.group.keys().map(String::as_str);
    Some(with_nearest(Diagnostic::new("unknown_key", what), group, known, otherwise))
}
