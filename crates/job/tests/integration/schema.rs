//! The JSON Schema that editors read, held against an outside validator.

use std::path::Path;

use job::config::Document;
use serde_json::Value;

/// Every configuration of the project.
const GOOD: [&str; 4] = [
    include_str!("../../../../pipeline.toml"),
    include_str!("../../../cli/templates/pipeline.toml"),
    include_str!("../../../../tests/data/flights/pipeline.toml"),
    include_str!("../../../../tests/data/kr300/pipeline.toml"),
];

fn as_json(text: &str) -> Value {
    serde_json::to_value(toml::from_str::<toml::Table>(text).unwrap()).unwrap()
}

#[test]
fn every_configuration_of_ours_fits_the_schema() {
    let schema = jsonschema::validator_for(&Document::schema()).unwrap();
    for text in GOOD {
        let errors: Vec<String> = schema.iter_errors(&as_json(text)).map(|e| e.to_string()).collect();
        assert!(errors.is_empty(), "{errors:?}\n{text}");
    }
}

/// What the schema refuses the program refuses, and the other way round.
#[test]
fn schema_and_program_refuse_the_same_mistakes() {
    let schema = jsonschema::validator_for(&Document::schema()).unwrap();
    let mistakes = [
        ("unit = \"s\"", "unitt = \"s\""),
        ("unit = \"s\"", "unit = \"seconds of arc\""),
        ("[clock]", "[clokc]"),
        ("[part.A]", "[part.A]\nlimit_m = \"wide\""),
        ("[part.A]", "[[channel.when]]\nequals = [1]\n[part.A]"),
        ("files = [\"*.parquet\"]", "files = \"*.parquet\""),
        ("bandwidth_hz = 10.0", "bandwidth_hz = true"),
    ];
    for (from, to) in mistakes {
        let text = GOOD[2].replacen(from, to, 1);
        assert_ne!(text, GOOD[2], "{from} is not in the text");
        let program = job::Config::parse(&text, Path::new("pipeline.toml"), Path::new("."));
        assert!(program.is_err() && !schema.is_valid(&as_json(&text)), "{to}");
    }
}
