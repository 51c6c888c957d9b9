//! Keys of the file: those that are unknown, each with the key that was probably meant, and numbers that are not plausible.
//!
//! The known keys come from the JSON Schema of the types, so no second list exists.

use ingest::mapping::column_pattern::nearest;
use records::Diagnostic;
use serde_json::Value;
use toml::de::{DeTable, DeValue};

use super::layers::{Source, at_span};
use super::limits::implausible;

/// Every number of the source that no actuator, sensor, recorder or machine can have, at its key; as an error, every
/// unknown key.
pub(super) fn check(source: &Source<'_>, schema: &Value) -> Result<Vec<Diagnostic>, Vec<Diagnostic>> {
    let mut walk = Walk { source, schema, unknown: Vec::new(), implausible: Vec::new() };
    walk.table(source.table(), schema, "");
    walk.unknown.sort_by_key(|c| c.line);
    if walk.unknown.is_empty() { Ok(walk.implausible) } else { Err(walk.unknown) }
}

struct Walk<'s> {
    source: &'s Source<'s>,
    /// The whole schema; a type that contains its own kind is given by reference.
    schema: &'s Value,
    unknown: Vec<Diagnostic>,
    implausible: Vec<Diagnostic>,
}

impl<'s> Walk<'s> {
    fn table(&mut self, table: &DeTable<'_>, schema: &'s Value, above: &str) {
        let Some(shape) = self.object_shape(schema) else { return };
        let known = shape.get("properties").and_then(Value::as_object);
        let others = shape.get("additionalProperties").filter(|v| v.is_object());
        for (key, value) in table {
            let name: &str = key.get_ref();
            let path = if above.is_empty() { name.to_owned() } else { format!("{above}.{name}") };
            let Some(inner) = known.and_then(|k| k.get(name)).or(others) else {
                let place =
                    if above.is_empty() { "the configuration".to_owned() } else { format!("`[{above}]`") };
                let names: Vec<&str> = known.into_iter().flat_map(|k| k.keys().map(String::as_str)).collect();
                let keys = format!("its keys are {}", names.join(", "));
                let fault = Diagnostic::new("unknown_key", format!("`{name}` is not a key of {place}"));
                let fault = with_nearest(fault, name, names, keys);
                self.unknown.push(at_span(self.source.layers, &key.span(), fault));
                continue;
            };
            each(value.get_ref(), &mut |value| match value {
                DeValue::Table(table) => self.table(table, inner, &path),
                value => {
                    let found = number(value).and_then(|number| implausible(name, number));
                    self.implausible.extend(found.map(|c| at_span(self.source.layers, &key.span(), c)));
                }
            });
        }
    }

    /// The object in a schema, also where it is optional or an element of a list.
    fn object_shape(&self, schema: &'s Value) -> Option<&'s Value> {
        if let Some(reference) = schema.get("$ref").and_then(Value::as_str) {
            return self.object_shape(self.schema.pointer(reference.trim_start_matches('#'))?);
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

fn each<'t, 'i>(value: &'t DeValue<'i>, visit: &mut impl FnMut(&'t DeValue<'i>)) {
    match value {
        DeValue::Array(values) => values.iter().for_each(|v| each(v.get_ref(), visit)),
        value => visit(value),
    }
}

fn number(value: &DeValue<'_>) -> Option<f64> {
    match value {
        DeValue::Float(number) => number.as_str().parse().ok(),
        DeValue::Integer(number) => {
            i128::from_str_radix(number.as_str(), number.radix()).ok().map(|number| number as f64)
        }
        _ => None,
    }
}

/// The diagnostic of an unknown name with a hint: the known name that was probably meant, or another text if none is near.
pub(super) fn with_nearest<'n>(
    diagnostic: Diagnostic,
    name: &str,
    known: impl IntoIterator<Item = &'n str>,
    otherwise: impl Into<String>,
) -> Diagnostic {
    diagnostic.hint(nearest(name, known).map_or_else(|| otherwise.into(), |near| format!("`{near}`?")))
}
