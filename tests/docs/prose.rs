//! Vocabulary of documentation, help, messages and comments.
//!
//! `tests/docs/vocabulary.txt` lists words to avoid, with replacements. `tests/docs/vocabulary_known.txt` counts, by
//! crate or folder, the places that still have such a word; the counts may only shrink.
//! `FREEPLAY_BLESS=1 cargo test -p cli prose` rewrites them after a fix.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use regex::Regex;

use crate::harness::top;

const KNOWN: &str = "tests/docs/vocabulary_known.txt";

/// Files with prose for users and developers.
const FILES: [&str; 8] = [
    "*.md",
    "docs/*.md",
    "crates/*/src/**/*.rs",
    "crates/*/templates/*",
    "crates/python/python/**/*.py",
    "crates/*/README.md",
    "sample-data/*.md",
    "tests/**/*.rs",
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
    // A code span names things as they are called.
    let code = Regex::new("`[^`]*`").unwrap();
    let (mut found, mut places) = (BTreeMap::<String, usize>::new(), BTreeMap::<String, String>::new());
    for pattern in FILES {
        for file in glob::glob(top().join(pattern).to_str().unwrap()).unwrap().flatten() {
            let name = file.strip_prefix(top()).unwrap().display().to_string();
            // The rules quote the words; generated measurements keep their own.
            if name == "tests/docs/prose.rs" || !file.is_file() {
                continue;
            }
            let Ok(text) = std::fs::read_to_string(&file) else { continue };
            for (at, line) in text.lines().enumerate() {
                let line = &code.replace_all(line, "");
                for (rule, word) in prose(&name, line, &parts).into_iter().flat_map(|part| {
                    rules.iter().flat_map(move |r| r.words.find_iter(part).map(move |w| (r, w)))
                }) {
                    *found.entry(name.clone()).or_default() += 1;
                    let _ = writeln!(
                        places.entry(name.clone()).or_default(),
                        "  {name}:{}: `{}`: write {} ({})",
                        at + 1,
                        word.as_str(),
                        rule.instead,
                        rule.reason
                    );
                }
            }
        }
    }
    let mut groups = BTreeMap::<String, usize>::new();
    for (name, count) in &found {
        *groups.entry(group(name)).or_default() += count;
    }
    let mut list = String::new();
    for (name, count) in &groups {
        writeln!(list, "{count} {name}").unwrap();
    }
    if std::env::var_os("FREEPLAY_BLESS").is_some() {
        std::fs::write(top().join(KNOWN), &list).unwrap();
    }
    let known = std::fs::read_to_string(top().join(KNOWN)).unwrap();
    let known: BTreeMap<&str, usize> =
        known.lines().filter_map(|l| l.split_once(' ')).map(|(n, name)| (name, n.parse().unwrap())).collect();
    for (name, count) in &groups {
        let allowed = known.get(name.as_str()).copied().unwrap_or(0);
        let listed: String =
            places.iter().filter(|(file, _)| group(file) == *name).map(|(_, lines)| lines.as_str()).collect();
        assert!(
            *count <= allowed,
            "{name}: {count} words to avoid, {allowed} known (see tests/docs/vocabulary.txt):\n{listed}"
        );
    }
}

/// Crate or folder of a file, by which known places are counted.
fn group(file: &str) -> String {
    let depth = if file.starts_with("crates/") { 2 } else { 1 };
    file.split('/').take(depth).collect::<Vec<_>>().join("/")
}
