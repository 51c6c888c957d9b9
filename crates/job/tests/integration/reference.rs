//! `docs/keys.md`, the reference of every key, is written from the types: this test keeps it so.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use job::config::Document;
use job::config::limits::PLAUSIBLE;
use serde_json::Value;

#[test]
fn the_reference_of_keys_is_what_the_types_say() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/keys.md");
    let mut page = "# Every key of `pipeline.toml`\n\nWritten from the types by a test. \
                    [Configuration](configuration.md) explains; this page lists. A number\noutside its range is \
                    refused (`out_of_range`): it is usually in another unit. The range of a signed key is that of \
                    its amount.\n"
        .to_owned();
    let mut tables = Tables::default();
    section(&mut page, "", "", &Document::schema(), &mut tables);
    page.push_str("\n## Tables with the keys of another\n\n| table | keys as in |\n|---|---|\n");
    page.push_str(&tables.repeated);
    if std::env::var_os("FREEPLAY_BLESS").is_some() {
        std::fs::write(&file, &page).unwrap();
    }
    for (key, ..) in PLAUSIBLE {
        assert!(page.contains(&format!("\n| `{key}` |")), "the range of {key} is that of no key");
    }
    let found = std::fs::read_to_string(&file).unwrap();
    assert!(
        found == page,
        "docs/keys.md differs from the types: FREEPLAY_BLESS=1 cargo test -p job reference"
    );
}

/// Tables so far: where each is written, by its rows, and the tables with rows that are written already.
#[derive(Default)]
struct Tables {
    first: BTreeMap<String, String>,
    repeated: String,
}

/// A table of the keys of one object, then a section for each object below it. `said` is what the table above says of it.
fn section(page: &mut String, path: &str, said: &str, schema: &Value, tables: &mut Tables) {
    let Some(keys) = schema.get("properties").and_then(Value::as_object) else { return };
    let required: Vec<&str> =
        schema["required"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
    let (mut table, mut keys_only) = (String::new(), String::new());
    let mut below = Vec::new();
    for (key, value) in keys {
        // Overrides need no key, and their keys are those of the tables that they override.
        let needed = if required.contains(&key.as_str()) { ", needed" } else { "" };
        let range = PLAUSIBLE.iter().find(|(name, ..)| *name == key);
        let range = range.map(|(_, least, most)| format!(" Range {least:e}…{most:e}.")).unwrap_or_default();
        let row = |needed: &str| format!("| `{key}` | {}{needed} | {}{range} |\n", kind(value), text(value));
        table.push_str(&row(needed));
        keys_only.push_str(&row(""));
        below.extend(inner(key, value, path).map(|(path, schema)| (path, text(value), schema)));
    }
    if let Some(first) = tables.first.get(&keys_only) {
        let _ = writeln!(tables.repeated, "| `{path}` | `{first}` |");
        return;
    }
    if !path.is_empty() {
        let _ = write!(page, "\n## `{path}`\n");
        if text(schema) != said {
            let _ = write!(page, "\n{}\n", text(schema));
        }
    }
    let _ = write!(page, "\n| key | is | meaning |\n|---|---|---|\n{table}");
    tables.first.insert(keys_only, path.to_owned());
    for (path, said, schema) in below {
        section(page, &path, &said, schema, tables);
    }
}

/// The object in a value, and what its table is called; alternatives of a channel are channels again.
fn inner<'v>(key: &str, value: &'v Value, path: &str) -> Option<(String, &'v Value)> {
    let name =
        if path.is_empty() { key.to_owned() } else { format!("{}.{key}", path.trim_matches(['[', ']'])) };
    let is_object = |value: &&Value| value.get("properties").is_some();
    choices(value, "anyOf").find_map(|value| {
        let of_map = value.get("additionalProperties").filter(is_object);
        let of_list = || value.get("items").filter(is_object);
        of_map
            .map(|object| (format!("[{name}.NAME]"), object))
            .or_else(|| of_list().map(|object| (format!("[[{name}]]"), object)))
            .or_else(|| is_object(&value).then(|| (format!("[{name}]"), value)))
    })
}

/// The schemas of a list of which one must fit, or the schema itself.
fn choices<'v>(value: &'v Value, list: &str) -> impl Iterator<Item = &'v Value> {
    let listed = value.get(list).and_then(Value::as_array);
    listed.into_iter().flatten().chain(listed.is_none().then_some(value))
}

fn kind(value: &Value) -> String {
    let one = |v: &Value| -> Option<String> {
        if let Some(words) = words(v) {
            return Some(words);
        }
        if let Some(items) = v.get("items") {
            return Some(format!("list of {}", kind(items)));
        }
        let name = match v.get("type")? {
            Value::Array(names) => names.iter().filter_map(Value::as_str).find(|name| *name != "null"),
            name => name.as_str().filter(|name| *name != "null"),
        };
        let name = match name? {
            "object" => "table",
            "boolean" => "true or false",
            "string" => "text",
            "integer" => "whole number",
            other => other,
        };
        Some(name.to_owned())
    };
    let kinds: Vec<String> = choices(value, "anyOf").filter_map(one).collect();
    if kinds.is_empty() { "table".to_owned() } else { kinds.join(" or ") }
}

fn words(value: &Value) -> Option<String> {
    let listed = |value: &Value| -> Vec<String> {
        let many = value.get("enum").and_then(Value::as_array).into_iter().flatten();
        let words = many.chain(value.get("const")).filter_map(Value::as_str);
        words.map(|word| format!("`{word}`")).collect()
    };
    let words: Vec<String> = choices(value, "oneOf").flat_map(listed).collect();
    (!words.is_empty()).then(|| words.join(", "))
}

fn text(value: &Value) -> String {
    let text = value.get("description").and_then(Value::as_str).unwrap_or_default();
    text.split_whitespace().collect::<Vec<_>>().join(" ").replace('|', "\\|")
}
