//! Architecture test: crate layers, import cycles between the files of a crate, and folder sizes.
//!
//! The test reads `Cargo.toml` and the `mod` and `use` declarations of every crate. It needs no compiler, so it runs
//! in a second and covers all targets and features. Test modules (`#[cfg(test)]`) are not checked.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Layer of each crate: a crate may depend on crates of lower layers only.
const LAYERS: [(&str, u32); 13] = [
    ("records", 0),
    ("object_io", 0),
    ("estimator", 0),
    ("trend", 0),
    ("simulator", 0),
    ("ingest", 1),
    ("store", 1),
    ("report", 1),
    ("job", 2),
    ("pipeline", 3),
    ("cli", 4),
    ("python", 4),
    // The accuracy study is above all other crates; no crate depends on it.
    ("validation", 5),
];

/// Maximum number of source files in a folder, `lib.rs`, `main.rs` and `mod.rs` not counted.
const MAX_FILES: usize = 12;

/// Violations that are still to be removed: kind, and how the violation begins. An entry that no longer occurs fails
/// the test, so the list only shrinks.
const KNOWN: &[(&str, &str)] = &[];

#[test]
fn crates_depend_on_lower_layers_only() {
    let crates = crates();
    let layer = |name: &str| LAYERS.iter().find(|(known, _)| *known == name).map(|(_, layer)| *layer);
    let mut found = BTreeSet::new();
    for name in &crates {
        let Some(own) = layer(name) else {
            found.insert(format!("{name}: add the crate to LAYERS"));
            continue;
        };
        for dependency in dependencies(name).iter().filter(|d| crates.contains(*d)) {
            if layer(dependency).is_none_or(|other| other >= own) {
                found.insert(format!("{name} (layer {own}) depends on {dependency}"));
            }
        }
    }
    expect_known("layers", &found);
}

#[test]
fn imports_between_the_files_of_a_crate_have_no_cycle() {
    let mut found = BTreeSet::new();
    for name in crates() {
        let modules = Modules::read(&name);
        for cycle in cycles(&modules.imports()) {
            found.insert(format!("{name}: {}", names(&cycle).join(" <-> ")));
        }
    }
    expect_known("cycles", &found);
}

#[test]
fn a_folder_holds_at_most_a_dozen_files() {
    let mut found = BTreeSet::new();
    for name in crates() {
        let mut folders: BTreeMap<PathBuf, usize> = BTreeMap::new();
        for file in sources(&root().join("crates").join(&name).join("src")) {
            let is_root = ["lib.rs", "main.rs", "mod.rs"].iter().any(|root| file.ends_with(root));
            *folders.entry(file.parent().unwrap().to_owned()).or_default() += usize::from(!is_root);
        }
        for (folder, files) in folders.into_iter().filter(|(_, files)| *files > MAX_FILES) {
            let folder = folder.strip_prefix(root()).unwrap().display().to_string().replace('\\', "/");
            found.insert(format!("{folder} holds {files} files, at most {MAX_FILES} are allowed"));
        }
    }
    expect_known("folders", &found);
}

/// Compares violations with the known ones of the same kind.
fn expect_known(kind: &str, found: &BTreeSet<String>) {
    let known: Vec<&str> = KNOWN.iter().filter(|(of, _)| *of == kind).map(|(_, entry)| *entry).collect();
    let mut report = String::new();
    for new in found.iter().filter(|violation| !known.iter().any(|entry| violation.starts_with(entry))) {
        let _ = writeln!(report, "new violation: {new}");
    }
    for fixed in known.iter().filter(|entry| !found.iter().any(|violation| violation.starts_with(**entry))) {
        let _ = writeln!(report, "no longer occurs, remove it from KNOWN: {fixed}");
    }
    assert!(report.is_empty(), "\n{report}");
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap()
}

fn crates() -> BTreeSet<String> {
    let entries = std::fs::read_dir(root().join("crates")).unwrap();
    let crates = entries.map(|entry| entry.unwrap().path()).filter(|dir| dir.join("Cargo.toml").exists());
    crates.map(|dir| dir.file_name().unwrap().to_str().unwrap().to_owned()).collect()
}

/// Names under `[dependencies]`; development dependencies may come from any layer.
fn dependencies(name: &str) -> BTreeSet<String> {
    let manifest = std::fs::read_to_string(root().join("crates").join(name).join("Cargo.toml")).unwrap();
    let mut names = BTreeSet::new();
    let mut is_inside = false;
    for line in manifest.lines().map(str::trim) {
        if line.starts_with('[') {
            is_inside = line == "[dependencies]";
        } else if is_inside && !line.starts_with('#') {
            names.extend(
                line.split(['.', '=', ' ']).next().filter(|name| !name.is_empty()).map(str::to_owned),
            );
        }
    }
    names
}

fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files.extend(sources(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
    files.sort();
    files
}

/// Path of a module inside its crate: `["kalman", "filter"]`; empty for the crate root.
type ModulePath = Vec<String>;

/// The files of a crate by module path, with the code that the compiler sees outside tests.
struct Modules {
    code: BTreeMap<ModulePath, String>,
}

impl Modules {
    fn read(name: &str) -> Self {
        let src = root().join("crates").join(name).join("src");
        let mut code: BTreeMap<ModulePath, String> = BTreeMap::new();
        for file in sources(&src) {
            let path = module_path(file.strip_prefix(&src).unwrap());
            let text = without_tests(&without_comments_and_strings(&std::fs::read_to_string(&file).unwrap()));
            // `lib.rs` and `main.rs` are both the crate root.
            code.entry(path).or_default().push_str(&text);
        }
        let test_files: Vec<ModulePath> =
            code.iter().flat_map(|(path, text)| test_modules(path, text)).collect();
        code.retain(|path, _| !test_files.iter().any(|test| path.starts_with(test)));
        Self { code }
    }

    /// Imports of each module, re-exports followed to the module that defines the item.
    fn imports(&self) -> BTreeMap<ModulePath, BTreeSet<ModulePath>> {
        let import = |path: &ModulePath| -> BTreeSet<ModulePath> {
            let used = uses(&self.code[path]);
            // A module that re-exports its own descendants is a facade, which is no import.
            let used =
                used.into_iter().map(|(is_public, segments)| (is_public, self.absolute(path, &segments)));
            used.filter_map(|(is_public, target)| {
                Some((is_public, target.clone()?, self.resolve(&target?, 8)?))
            })
            .filter(|(is_public, _, module)| !(*is_public && module.starts_with(path)))
            .map(|(_, _, module)| module)
            .filter(|module| module != path)
            .collect()
        };
        self.code.keys().map(|path| (path.clone(), import(path))).collect()
    }

    /// Path from the crate root; `None` for another crate.
    fn absolute(&self, module: &ModulePath, segments: &[String]) -> Option<Vec<String>> {
        let first = segments.first()?.as_str();
        let mut base: Vec<String> = match first {
            "crate" => Vec::new(),
            "self" => module.clone(),
            "super" => module[..module.len().checked_sub(1)?].to_vec(),
            child => {
                let mut path = module.clone();
                path.push(child.to_owned());
                return self.code.contains_key(&path).then(|| [module.clone(), segments.to_vec()].concat());
            }
        };
        for segment in &segments[1..] {
            if segment == "super" { drop(base.pop()?) } else { base.push(segment.clone()) }
        }
        Some(base)
    }

    /// The module that defines the item of a path.
    fn resolve(&self, path: &[String], depth: u32) -> Option<ModulePath> {
        let length = (0..=path.len()).rev().find(|length| self.code.contains_key(&path[..*length]))?;
        let (module, rest) = path.split_at(length);
        let module = module.to_vec();
        let Some(item) = rest.first().filter(|_| depth > 0) else { return Some(module) };
        for (is_public, segments) in uses(&self.code[&module]) {
            if is_public && segments.last() == Some(item) {
                let target = self.absolute(&module, &segments)?;
                return if target == path { Some(module) } else { self.resolve(&target, depth - 1) };
            }
        }
        Some(module)
    }
}

fn names(cycle: &[ModulePath]) -> Vec<String> {
    cycle.iter().map(|path| if path.is_empty() { "crate root".to_owned() } else { path.join("/") }).collect()
}

fn module_path(file: &Path) -> ModulePath {
    let mut path: ModulePath = file.iter().map(|part| part.to_str().unwrap().to_owned()).collect();
    let name = path.pop().unwrap();
    if !["lib.rs", "main.rs", "mod.rs"].contains(&name.as_str()) {
        path.push(name.trim_end_matches(".rs").to_owned());
    }
    path
}

/// Replaces comments, text and character literals by nothing.
fn without_comments_and_strings(text: &str) -> String {
    let chars: Vec<char> = text.chars().collect();
    let (mut code, mut at) = (String::new(), 0);
    while at < chars.len() {
        let rest = &chars[at..];
        let raw = raw_string_hashes(rest).filter(|_| at == 0 || !is_word(chars[at - 1]));
        if rest.starts_with(&['/', '/']) {
            at += rest.iter().position(|c| *c == '\n').unwrap_or(rest.len());
        } else if rest.starts_with(&['/', '*']) {
            at += 2 + rest[2..]
                .windows(2)
                .position(|pair| pair == ['*', '/'])
                .map_or(rest.len(), |end| end + 2);
        } else if let Some(hashes) = raw {
            let end: Vec<char> = std::iter::once('"').chain(std::iter::repeat_n('#', hashes)).collect();
            let from = hashes + 2;
            let length = rest[from..].windows(end.len()).position(|window| window == end);
            at += length.map_or(rest.len(), |length| from + length + end.len());
        } else if rest[0] == '"' {
            at += 1 + quoted(&rest[1..], '"');
        } else if rest[0] == '\'' && (rest.get(1) == Some(&'\\') || rest.get(2) == Some(&'\'')) {
            at += 1 + quoted(&rest[1..], '\'');
        } else {
            code.push(rest[0]);
            at += 1;
        }
    }
    code
}

/// Number of hash signs, if a raw string begins here.
fn raw_string_hashes(rest: &[char]) -> Option<usize> {
    let hashes = rest.strip_prefix(&['r'])?.iter().take_while(|c| **c == '#').count();
    (rest.get(hashes + 1) == Some(&'"')).then_some(hashes)
}

/// Length of a literal after its opening quote, with the closing quote.
fn quoted(rest: &[char], quote: char) -> usize {
    let mut at = 0;
    while at < rest.len() && rest[at] != quote {
        at += if rest[at] == '\\' { 2 } else { 1 };
    }
    at + 1
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// Removes inline test modules and other blocks behind `#[cfg(test)]`.
fn without_tests(code: &str) -> String {
    const MARK: &str = "#[cfg(test)]";
    let (mut kept, mut rest) = (String::new(), code);
    while let Some(at) = rest.find(MARK) {
        kept.push_str(&rest[..at]);
        let item = &rest[at + MARK.len()..];
        let end = item.find([';', '{']).unwrap_or(item.len());
        if item[end..].starts_with('{') {
            rest = &item[end + block(&item[end..])..];
        } else {
            // A test module in a file of its own is kept as a mark for `test_modules`.
            let name = item[..end].split_whitespace().skip_while(|word| *word != "mod").nth(1);
            if let Some(name) = name {
                let _ = writeln!(kept, "\ntest_mod {name};");
            }
            rest = &item[end..];
        }
    }
    kept + rest
}

/// Length of a block in braces.
fn block(code: &str) -> usize {
    let mut depth = 0;
    for (at, c) in code.char_indices() {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return at + 1;
        }
    }
    code.len()
}

/// Test modules that are files of their own.
fn test_modules(path: &ModulePath, code: &str) -> Vec<ModulePath> {
    let names = code.lines().filter_map(|line| line.strip_prefix("test_mod ")?.strip_suffix(';'));
    names.map(|name| [path.clone(), vec![name.to_owned()]].concat()).collect()
}

/// Every path of a `use` declaration and every inline `crate::`, `super::` or `self::` path, and whether it is
/// re-exported.
fn uses(code: &str) -> Vec<(bool, Vec<String>)> {
    let mut found = Vec::new();
    let mut rest = code;
    while let Some(at) = next_word(rest, "use") {
        let before = rest[..at].trim_end();
        let is_public = before.ends_with("pub") || (before.ends_with(')') && before.contains("pub("));
        let is_public =
            is_public && before.rsplit([';', '}', '{', ']']).next().is_some_and(|b| b.contains("pub"));
        let tree = &rest[at + 3..];
        let end = tree.find(';').unwrap_or(tree.len());
        expand(tree[..end].trim(), &[], &mut |path| found.push((is_public, path)));
        rest = &tree[end..];
    }
    for word in ["crate", "super", "self"] {
        let mut rest = code;
        while let Some(at) = next_word(rest, word) {
            let path: String = rest[at..].chars().take_while(|c| is_word(*c) || *c == ':').collect();
            if path.contains("::") {
                found.push((false, path.split("::").filter(|s| !s.is_empty()).map(str::to_owned).collect()));
            }
            rest = &rest[at + word.len()..];
        }
    }
    found
}

/// Position of a whole word.
fn next_word(text: &str, word: &str) -> Option<usize> {
    let is_bounded = |at: usize| {
        let before = text[..at].chars().next_back().is_none_or(|c| !is_word(c));
        before && text[at + word.len()..].chars().next().is_none_or(|c| !is_word(c))
    };
    text.match_indices(word).map(|(at, _)| at).find(|at| is_bounded(*at))
}

/// Expands a `use` tree into its paths; names after `as` are dropped.
fn expand(tree: &str, prefix: &[String], take: &mut impl FnMut(Vec<String>)) {
    if let Some(brace) = tree.find('{') {
        let head = segments(&tree[..brace]);
        let prefix = [prefix, &head].concat();
        let inside = &tree[brace + 1..brace + block(&tree[brace..]) - 1];
        let (mut depth, mut from) = (0, 0);
        for (at, c) in inside.char_indices().chain([(inside.len(), ',')]) {
            match c {
                '{' => depth += 1,
                '}' => depth -= 1,
                ',' if depth == 0 => {
                    let item = inside[from..at].trim();
                    if !item.is_empty() {
                        expand(item, &prefix, take);
                    }
                    from = at + 1;
                }
                _ => {}
            }
        }
        return;
    }
    let path = tree.split(" as ").next().unwrap_or(tree);
    let mut path = [prefix, &segments(path)].concat();
    // `a::{self, b}` names `a` itself.
    if path.len() > 1 && path.last().is_some_and(|last| last == "self" || last == "*") {
        path.pop();
    }
    take(path);
}

fn segments(path: &str) -> Vec<String> {
    path.split("::").map(str::trim).filter(|segment| !segment.is_empty()).map(str::to_owned).collect()
}

/// Strongly connected components of more than one module, by the files that reach each other.
fn cycles(imports: &BTreeMap<ModulePath, BTreeSet<ModulePath>>) -> Vec<Vec<ModulePath>> {
    let reach = |from: &ModulePath| {
        let (mut reached, mut open) = (BTreeSet::new(), vec![from.clone()]);
        while let Some(module) = open.pop() {
            for next in imports.get(&module).into_iter().flatten() {
                if reached.insert(next.clone()) {
                    open.push(next.clone());
                }
            }
        }
        reached
    };
    let reached: BTreeMap<&ModulePath, BTreeSet<ModulePath>> =
        imports.keys().map(|module| (module, reach(module))).collect();
    let mut components = BTreeSet::new();
    for module in imports.keys().filter(|module| reached[module].contains(*module)) {
        let component: Vec<ModulePath> =
            reached[module].iter().filter(|other| reached[other].contains(module)).cloned().collect();
        components.insert(component);
    }
    components.into_iter().collect()
}

#[test]
fn the_reader_finds_imports_and_ignores_tests_comments_and_text() {
    let code = "//! use crate::no;\npub use child::Item;\nuse crate::{a::{self, B}, c::D as E};\n\
                fn f() { super::g(\"crate::text\"); }\n#[cfg(test)]\nmod tests { use crate::test; }";
    let found = uses(&without_tests(&without_comments_and_strings(code)));
    let found: BTreeSet<(bool, String)> =
        found.into_iter().map(|(public, path)| (public, path.join("::"))).collect();
    let expected = [
        (true, "child::Item"),
        (false, "crate::a"),
        (false, "crate::a::B"),
        (false, "crate::c::D"),
        (false, "super::g"),
    ];
    for (public, path) in expected {
        assert!(found.contains(&(public, path.to_owned())), "{path} is missing in {found:?}");
    }
    assert!(
        !found.iter().any(|(_, path)| path.contains("test") || path.contains("no") || path.contains("text"))
    );
}

#[test]
fn a_cycle_is_found_and_a_chain_is_none() {
    let module = |name: &str| vec![name.to_owned()];
    let graph = |edges: &[(&str, &str)]| {
        let mut imports: BTreeMap<ModulePath, BTreeSet<ModulePath>> = BTreeMap::new();
        for (from, to) in edges {
            imports.entry(module(from)).or_default().insert(module(to));
            imports.entry(module(to)).or_default();
        }
        imports
    };
    assert!(cycles(&graph(&[("a", "b"), ("b", "c"), ("a", "c")])).is_empty());
    assert_eq!(cycles(&graph(&[("a", "b"), ("b", "a"), ("b", "c")])), [vec![module("a"), module("b")]]);
}
