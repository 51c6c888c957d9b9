//! The book in `docs/`: every page is in its contents, and every link leads somewhere.

use std::collections::BTreeSet;
use std::path::Path;

use regex::Regex;

use crate::gate::is_gate;
use crate::harness::top;
use crate::markdown::{Page, all};

/// A reader who follows a link inside the repository meets the file, and the heading it names.
#[test]
fn every_link_leads_to_a_file_and_a_heading_that_are_there() {
    let pages = all();
    let broken: Vec<String> = pages
        .iter()
        .flat_map(|page| page.links.iter().filter_map(|link| broken(page, link, &pages)))
        .collect();
    let links: usize = pages.iter().map(|page| page.links.len()).sum();
    assert!(links > 50, "links were not found: {links}");
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

/// Why a link leads nowhere; those into the world are not followed.
fn broken(page: &Page, link: &str, pages: &[Page]) -> Option<String> {
    if link.contains("://") || link.starts_with("mailto:") {
        return None;
    }
    let (file, heading) = link.split_once('#').unwrap_or((link, ""));
    let here = top().join(&page.name);
    let target = if file.is_empty() { here } else { here.parent()?.join(file) };
    let Ok(target) = target.canonicalize() else {
        return Some(format!("{}: `{link}` leads to no file", page.name));
    };
    let is_target = |page: &&Page| top().join(&page.name).canonicalize().is_ok_and(|path| path == target);
    let has_heading = |page: &Page| page.anchors.iter().any(|anchor| anchor == heading);
    let is_found = heading.is_empty() || pages.iter().find(is_target).is_none_or(has_heading);
    (!is_found).then(|| format!("{}: `{link}` names no heading there", page.name))
}

/// Readers do not find a page that is missing from the contents. Pages in folders below are those of other programs.
#[test]
fn every_page_is_in_the_contents_once() {
    let pages = all();
    let contents = pages.iter().find(|page| page.name == "docs/SUMMARY.md").unwrap();
    let listed: BTreeSet<String> = contents.links.iter().map(|link| format!("docs/{link}")).collect();
    let written: BTreeSet<String> = pages
        .iter()
        .filter(|page| {
            Path::new(&page.name).parent() == Some(Path::new("docs")) && page.name != contents.name
        })
        .map(|page| page.name.clone())
        .collect();
    assert_eq!(listed, written, "docs/SUMMARY.md against the pages of docs/");
    assert_eq!(listed.len(), contents.links.len(), "a page is listed twice in docs/SUMMARY.md");
}

/// A page names the constants that it quotes, with their values, in a comment.
#[test]
fn constants_that_pages_quote_are_those_of_the_code() {
    let files = glob::glob(top().join("crates/*/src/**/*.rs").to_str().unwrap()).unwrap().flatten();
    let sources: String = files.map(|file| std::fs::read_to_string(file).unwrap()).collect();
    let comment = Regex::new("<!-- constants: (.*) -->").unwrap();
    let pages = all();
    let mut constants = Vec::new();
    for page in &pages {
        for quoted in comment.captures_iter(&page.text) {
            constants.extend(quoted[1].split("; ").map(|one| (page.name.clone(), one.to_owned())));
        }
    }
    let is_of_code = |quoted: &str| {
        let (name, value) = quoted.split_once(" = ").unwrap();
        let value = regex::escape(value);
        Regex::new(&format!("const {name}: [^=]+ = {value};")).unwrap().is_match(&sources)
    };
    let wrong: Vec<_> = constants.iter().filter(|(_, quoted)| !is_of_code(quoted)).collect();
    assert!(constants.len() > 50 && wrong.is_empty(), "{} constants, wrong: {wrong:?}", constants.len());
}

/// Errors of another method are not those of the program. Only the gate asks: the study is repeated once, after the last
/// change of a method.
#[test]
fn pages_of_errors_are_of_the_present_method() {
    for name in ["docs/accuracy.md", "docs/limits.md"] {
        let page = std::fs::read_to_string(top().join(name)).unwrap();
        let version = format!("method version {}", job::METHOD_VERSION);
        assert!(
            !is_gate() || page.contains(&version),
            "{name}: `cargo run --release -p validation` has its figures"
        );
    }
}

/// A page with the walk-through of a mapping and an example of every layout.
const LONG: (&str, usize) = ("docs/map-my-logs.md", 2500);

/// A reference is searched; every other page is read.
#[test]
fn a_page_that_is_read_has_at_most_1500_words() {
    let contents = std::fs::read_to_string(top().join("docs/SUMMARY.md")).unwrap();
    let (mut group, mut long, mut pages) = (String::new(), Vec::new(), 0);
    for line in contents.lines() {
        if let Some(heading) = line.strip_prefix("# ") {
            heading.clone_into(&mut group);
        }
        let Some((_, link)) = line.rsplit_once('(') else { continue };
        let file = format!("docs/{}", link.trim_end_matches(')'));
        let words = std::fs::read_to_string(top().join(&file)).unwrap().split_whitespace().count();
        pages += 1;
        let most = if file == LONG.0 { LONG.1 } else { 1500 };
        if words > most && !["Reference", "Measurements"].contains(&group.as_str()) {
            long.push(format!("{file}: {words} words"));
        }
    }
    for file in ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "SECURITY.md"] {
        let words = std::fs::read_to_string(top().join(file)).unwrap().split_whitespace().count();
        long.extend((words > 1500).then(|| format!("{file}: {words} words")));
    }
    assert!((26..=29).contains(&pages) && long.is_empty(), "{pages} pages, {long:?}");
}
