//! Vocabulary of documentation, help, messages and comments.
//!
//! `tests/docs/vocabulary.txt` lists words to avoid, with replacements and reasons.

use std::fmt::Write as _;
use std::path::Path;

use regex::Regex;

use crate::harness::top;

/// Files with prose for users and developers.
const FILES: [&str; 11] = [
    "*.md",
    "docs/*.md",
    "crates/*/src/**/*.rs",
    "crates/*/tests/**/*.rs",
    "crates/*/examples/**/*.rs",
    "crates/*/templates/*",
    "crates/python/python/**/*.py",
    "crates/*/README.md",
    "sample-data/*.md",
    "tests/**/*.rs",
    "benches/**/*.rs",
];

/// A rule of the vocabulary.
struct Rule {
    words: Regex,
    instead: String,
    reason: String,
}

fn rules() -> Vec<Rule> {
    let text = std::fs::read_to_string(top().join("tests/docs/vocabulary.txt")).unwrap();
    let rule = |line: &str| {
        let mut parts = line.split(" | ").map(str::trim);
        let words = parts.next().unwrap();
        let (instead, reason) = (parts.next().unwrap().to_owned(), parts.next().unwrap().to_owned());
        Rule { words: Regex::new(&format!(r"(?i)\b(?:{words})\b")).unwrap(), instead, reason }
    };
    text.lines().filter(|line| !line.starts_with('#') && !line.is_empty()).map(rule).collect()
}

/// Prose of a line: all of a page; of code, comments and string literals that are not keys.
fn prose<'l>(file: &str, line: &'l str, parts: &Regex) -> Vec<&'l str> {
    if Path::new(file).extension().is_some_and(|e| e == "rs") {
        let is_key = |part: &str| part.starts_with('"') && !part.contains(' ');
        parts.find_iter(line).map(|part| part.as_str()).filter(|part| !is_key(part)).collect()
    } else {
        vec![line]
    }
}

#[test]
fn prose_uses_the_words_of_the_vocabulary() {
    let rules = rules();
    // A string literal, or a comment up to the end of the line.
    let parts = Regex::new(r#""(?:[^"\\]|\\.)*"|//.*"#).unwrap();
    // A code span, a definition or a key in Python quotes a name.
    let code = Regex::new(r#"`[^`]*`|\bdef \w+|\["\w+"\]"#).unwrap();
    let mut places = String::new();
    for pattern in FILES {
        for file in glob::glob(top().join(pattern).to_str().unwrap()).unwrap().flatten() {
            let name = file.strip_prefix(top()).unwrap().display().to_string();
            let Ok(text) = std::fs::read_to_string(&file) else { continue };
            for (at, line) in text.lines().enumerate() {
                let line = &code.replace_all(line, "");
                for (rule, word) in prose(&name, line, &parts).into_iter().flat_map(|part| {
                    rules.iter().flat_map(move |r| r.words.find_iter(part).map(move |w| (r, w)))
                }) {
                    let (word, Rule { instead, reason, .. }) = (word.as_str(), rule);
                    writeln!(places, "{name}:{}: `{word}`: write {instead} ({reason})", at + 1).unwrap();
                }
            }
        }
    }
    assert!(places.is_empty(), "words to avoid (tests/docs/vocabulary.txt):\n{places}");
}
