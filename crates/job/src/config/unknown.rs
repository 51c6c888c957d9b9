//! Keys that no type knows: all of them at once, each with the key that was probably meant.
//!
//! The types themselves say which keys exist, through their JSON Schema, so this list cannot drift.

use fleet::Complaint;
use ingest::pattern::nearest;
use serde_json::Value;
use toml::de::{DeTable, DeValue};

use super::source::Source;

/// Every unknown key of the source.
pub(super) fn keys(source: &Source<'_>, schema: &Value) -> Vec<Complaint> {
    let mut found = Vec::new();
    walk(source, source.table(), schema, "", &mut found);
    found.sort_by_key(|c| c.line);
    found
}

fn walk(source: &Source<'_>, table: &DeTable<'_>, schema: &Value, above: &str, found: &mut Vec<Complaint>) {
    let Some(shape) = object_shape(schema) else { return };
    let known = shape.get("properties").and_then(Value::as_object);
    let others = shape.get("additionalProperties").filter(|v| v.is_object());
    for (key, value) in table {
        let name: &str = key.get_ref();
        let path = if above.is_empty() { name.to_owned() } else { format!("{above}.{name}") };
        match known.and_then(|k| k.get(name)).or(others) {
            Some(inner) => each_table(value.get_ref(), &mut |t| walk(source, t, inner, &path, found)),
            None => {
                let names = known.into_iter().flat_map(|k| k.keys().map(String::as_str));
                found.push(source.at_span(key.span(), complaint(name, above, names)));
            }
        }
    }
}

fn each_table<'t, 'i>(value: &'t DeValue<'i>, visit: &mut impl FnMut(&'t DeTable<'i>)) {
    match value {
        DeValue::Table(table) => visit(table),
        DeValue::Array(values) => values.iter().for_each(|v| each_table(v.get_ref(), visit)),
        _ => {}
    }
}

/// The object in a schema, also where it may be absent or stands in a list.
fn object_shape(schema: &Value) -> Option<&Value> {
    if schema.get("properties").is_some() || schema.get("additionalProperties").is_some_and(Value::is_object)
    {
        return Some(schema);
    }
    let choices = ["anyOf", "oneOf", "allOf"].iter().filter_map(|k| schema.get(*k)?.as_array()).flatten();
    choices.chain(schema.get("items")).find_map(object_shape)
}

fn complaint<'n>(name: &str, above: &str, known: impl Iterator<Item = &'n str> + Clone) -> Complaint {
    let place = if above.is_empty() { "the configuration".to_owned() } else { format!("`[{above}]`") };
    let complaint = Complaint::new("unknown_key", format!("`{name}` is no key of {place}"));
    match nearest(name, known.clone()) {
        Some(near) => complaint.hint(format!("`{near}`?")),
        None => {
            let names: Vec<&str> = known.collect();
            complaint.hint(format!("its keys are {}", names.join(", ")))
        }
    }
}
