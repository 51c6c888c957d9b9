//! Unknown keys: all of them at once, each with the key that was probably meant.
//!
//! The known keys come from the JSON Schema of the types, so no second list exists.

use ingest::mapping::column_pattern::nearest;
use records::Diagnostic;
use serde_json::Value;
use toml::de::{DeTable, DeValue};

use super::layers::Source;

/// Every unknown key of the source.
pub(super) fn keys(source: &Source<'_>, schema: &Value) -> Vec<Diagnostic> {
    let mut found = Vec::new();
    let types = Types(schema);
    types.walk(source, source.table(), schema, "", &mut found);
    found.sort_by_key(|c| c.line);
    found
}

/// The whole schema; a type that contains its own kind is given by reference.
struct Types<'s>(&'s Value);

impl Types<'_> {
    fn walk(
        &self,
        source: &Source<'_>,
        table: &DeTable<'_>,
        schema: &Value,
        above: &str,
        found: &mut Vec<Diagnostic>,
    ) {
        let Some(shape) = self.object_shape(schema) else { return };
        let known = shape.get("properties").and_then(Value::as_object);
        let others = shape.get("additionalProperties").filter(|v| v.is_object());
        for (key, value) in table {
            let name: &str = key.get_ref();
            let path = if above.is_empty() { name.to_owned() } else { format!("{above}.{name}") };
            match known.and_then(|k| k.get(name)).or(others) {
                Some(inner) => {
                    each_table(value.get_ref(), &mut |t| self.walk(source, t, inner, &path, found));
                }
                None => {
                    let names = known.into_iter().flat_map(|k| k.keys().map(String::as_str));
                    found.push(source.at_span(key.span(), diagnostic(name, above, names)));
                }
            }
        }
    }

    /// The object in a schema, also where it is optional or an element of a list.
    fn object_shape<'v>(&'v self, schema: &'v Value) -> Option<&'v Value> {
        if let Some(reference) = schema.get("$ref").and_then(Value::as_str) {
            return self.object_shape(self.0.pointer(reference.trim_start_matches('#'))?);
        }
        if schema.get("properties").is_some()
            || schema.get("additionalProperties").is_some_and(Value::is_object)
        {
            return Some(schema);
        }
        let choices = ["anyOf", "oneOf", "allOf"].iter().filter_map(|k| schema.get(*k)?.as_array()).flatten();
        choices.chain(schema.get("items")).find_map(|s| self.object_shape(s))
    }
}

fn each_table<'t, 'i>(value: &'t DeValue<'i>, visit: &mut impl FnMut(&'t DeTable<'i>)) {
    match value {
        DeValue::Table(table) => visit(table),
        DeValue::Array(values) => values.iter().for_each(|v| each_table(v.get_ref(), visit)),
        _ => {}
    }
}

fn diagnostic<'n>(name: &str, above: &str, known: impl Iterator<Item = &'n str> + Clone) -> Diagnostic {
    let place = if above.is_empty() { "the configuration".to_owned() } else { format!("`[{above}]`") };
    let diagnostic = Diagnostic::new("unknown_key", format!("`{name}` is not a key of {place}"));
    match nearest(name, known.clone()) {
        Some(near) => diagnostic.hint(format!("`{near}`?")),
        None => {
            let names: Vec<&str> = known.collect();
            diagnostic.hint(format!("its keys are {}", names.join(", ")))
        }
    }
}
