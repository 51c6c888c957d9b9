//! Architecture test: crate layers, import cycles between the files of a crate, and folder sizes.
//!
//! Layers are those of `cargo metadata`. Imports are read from the tokens of every file, so all targets and features
//! are covered without a compiler; test modules (`#[cfg(test)]`) are not checked.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

use proc_macro2::{TokenStream, TokenTree};

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

#[test]
fn crates_depend_on_lower_layers_only() {
    let layer = |name: &str| LAYERS.iter().find(|(known, _)| *known == name).map(|(_, layer)| *layer);
    let crates = crates();
    let mut found = Vec::new();
    for (name, dependencies) in &crates {
        let Some(own) = layer(name) else {
            found.push(format!("{name}: add the crate to LAYERS"));
            continue;
        };
        for dependency in dependencies.iter().filter(|dependency| crates.contains_key(*dependency)) {
            if layer(dependency).is_none_or(|other| other >= own) {
                found.push(format!("{name} (layer {own}) depends on {dependency}"));
            }
        }
    }
    assert!(found.is_empty(), "{found:#?}");
}

#[test]
fn imports_between_the_files_of_a_crate_have_no_cycle() {
    let mut found = Vec::new();
    for name in crates().into_keys() {
        for cycle in cycles(&Modules::read(&name).imports()) {
            found.push(format!("{name}: {}", names(&cycle).join(" <-> ")));
        }
    }
    assert!(found.is_empty(), "{found:#?}");
}

#[test]
fn a_folder_holds_at_most_a_dozen_files() {
    for name in crates().into_keys() {
        let mut folders: BTreeMap<PathBuf, usize> = BTreeMap::new();
        for file in sources(&root().join("crates").join(&name).join("src")) {
            let is_root = ["lib.rs", "main.rs", "mod.rs"].iter().any(|root| file.ends_with(root));
            *folders.entry(file.parent().unwrap().to_owned()).or_default() += usize::from(!is_root);
        }
        for (folder, files) in folders {
            assert!(files <= MAX_FILES, "{} holds {files} files, at most {MAX_FILES}", folder.display());
        }
    }
}

pub(crate) fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap()
}

/// The crates of the workspace by the names of their folders, with their dependencies. Development dependencies may come
/// from any layer.
fn crates() -> BTreeMap<String, BTreeSet<String>> {
    let mut cargo = Command::new(env!("CARGO"));
    let asked = cargo.args(["metadata", "--no-deps", "--offline", "--format-version=1"]).current_dir(root());
    let metadata: serde_json::Value = serde_json::from_slice(&asked.output().unwrap().stdout).unwrap();
    let text = |value: &serde_json::Value| value.as_str().unwrap().to_owned();
    let packages = metadata["packages"].as_array().unwrap().iter().map(|package| {
        let dependencies = package["dependencies"].as_array().unwrap().iter();
        let dependencies = dependencies.filter(|dependency| dependency["kind"] != "dev");
        let folder = PathBuf::from(text(&package["manifest_path"])).parent().unwrap().to_owned();
        let name = folder.file_name().unwrap().to_str().unwrap().to_owned();
        (name, dependencies.map(|dependency| text(&dependency["name"])).collect())
    });
    packages.collect()
}

pub(crate) fn sources(folder: &Path) -> Vec<PathBuf> {
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

/// The files of a crate by module path, with the paths that each names outside tests.
struct Modules(BTreeMap<ModulePath, Imports>);

impl Modules {
    fn read(name: &str) -> Self {
        let src = root().join("crates").join(name).join("src");
        let mut files: BTreeMap<ModulePath, Imports> = BTreeMap::new();
        for file in sources(&src) {
            let path = module_path(file.strip_prefix(&src).unwrap());
            // `lib.rs` and `main.rs` are both the crate root.
            files.entry(path).or_default().read(std::fs::read_to_string(&file).unwrap().parse().unwrap());
        }
        let in_file = |(path, imports): (&ModulePath, &Imports)| -> Vec<ModulePath> {
            imports.test_modules.iter().map(|name| [path.clone(), vec![name.clone()]].concat()).collect()
        };
        let test_files: Vec<ModulePath> = files.iter().flat_map(in_file).collect();
        files.retain(|path, _| !test_files.iter().any(|test| path.starts_with(test)));
        Self(files)
    }

    /// Imports of each module, re-exports followed to the module that defines the item.
    fn imports(&self) -> BTreeMap<ModulePath, BTreeSet<ModulePath>> {
        let import = |(path, imports): (&ModulePath, &Imports)| {
            let mut imported = BTreeSet::new();
            for (is_public, segments) in &imports.paths {
                let target = self.absolute(path, segments);
                let Some(module) = target.and_then(|target| self.resolve(&target, 8)) else { continue };
                // A module that re-exports its own descendants is a facade, which is no import.
                if module != *path && !(*is_public && module.starts_with(path)) {
                    imported.insert(module);
                }
            }
            (path.clone(), imported)
        };
        self.0.iter().map(import).collect()
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
                return self.0.contains_key(&path).then(|| [module.clone(), segments.to_vec()].concat());
            }
        };
        for segment in &segments[1..] {
            if segment == "super" { drop(base.pop()?) } else { base.push(segment.clone()) }
        }
        Some(base)
    }

    /// The module that defines the item of a path.
    fn resolve(&self, path: &[String], depth: u32) -> Option<ModulePath> {
        let length = (0..=path.len()).rev().find(|length| self.0.contains_key(&path[..*length]))?;
        let (module, rest) = path.split_at(length);
        let module = module.to_vec();
        let Some(item) = rest.first().filter(|_| depth > 0) else { return Some(module) };
        for (is_public, segments) in &self.0[&module].paths {
            if *is_public && segments.last() == Some(item) {
                let target = self.absolute(&module, segments)?;
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

/// The paths that a file names, each with whether it is re-exported, and its test modules that are files of their own.
#[derive(Default)]
struct Imports {
    paths: Vec<(bool, ModulePath)>,
    test_modules: Vec<String>,
}

impl Imports {
    /// Takes every `use` declaration, and every `crate::`, `super::` or `self::` path elsewhere.
    fn read(&mut self, code: TokenStream) {
        let tokens: Vec<TokenTree> = code.into_iter().collect();
        let mut at = 0_usize;
        while at < tokens.len() {
            match &tokens[at] {
                TokenTree::Group(group) if is_test(&group.stream()) => {
                    let is_end = |token: &TokenTree| is_sign(token, ';') || is_sign(token, '{');
                    let end = tokens[at..].iter().position(is_end).map_or(tokens.len(), |end| at + end);
                    let module = tokens[at..end].iter().skip_while(|token| token.to_string() != "mod").nth(1);
                    let is_file = tokens.get(end).is_some_and(|token| is_sign(token, ';'));
                    self.test_modules.extend(module.filter(|_| is_file).map(ToString::to_string));
                    at = end;
                }
                TokenTree::Group(group) => self.read(group.stream()),
                // `use<'a>` in a return type lists what it captures, and imports nothing.
                TokenTree::Ident(word)
                    if word == "use" && !tokens.get(at + 1).is_some_and(|t| is_sign(t, '<')) =>
                {
                    let is_public = tokens[at.saturating_sub(2)..at].iter().any(|t| t.to_string() == "pub");
                    let end = tokens[at..].iter().position(|token| is_sign(token, ';')).unwrap();
                    self.expand(&tokens[at + 1..at + end], &[], is_public);
                    at += end;
                }
                TokenTree::Ident(word) if is_root(&word.to_string()) => {
                    let mut path = vec![word.to_string()];
                    while let Some([first, second, TokenTree::Ident(name)]) = tokens.get(at + 1..at + 4)
                        && is_sign(first, ':')
                        && is_sign(second, ':')
                    {
                        path.push(name.to_string());
                        at += 3;
                    }
                    if path.len() > 1 {
                        self.paths.push((false, path));
                    }
                }
                _ => {}
            }
            at += 1;
        }
    }

    /// Expands a `use` tree into its paths; names after `as` are dropped.
    fn expand(&mut self, tree: &[TokenTree], prefix: &[String], is_public: bool) {
        let mut path = prefix.to_vec();
        for token in tree {
            match token {
                TokenTree::Ident(word) if word == "as" => break,
                TokenTree::Ident(word) => path.push(word.to_string()),
                TokenTree::Group(group) => {
                    if path.first().is_some_and(|first| is_root(first)) {
                        self.paths.push((false, path.clone()));
                    }
                    let inside: Vec<TokenTree> = group.stream().into_iter().collect();
                    let trees = inside.split(|token| is_sign(token, ',')).filter(|tree| !tree.is_empty());
                    return trees.for_each(|tree| self.expand(tree, &path, is_public));
                }
                _ => {}
            }
        }
        // `a::{self, b}` names `a` itself.
        if path.len() > 1 && path.last().is_some_and(|last| last == "self") {
            path.pop();
        }
        self.paths.push((is_public, path));
    }
}

/// Whether a path that begins with a word lies in the crate.
fn is_root(word: &str) -> bool {
    ["crate", "super", "self"].contains(&word)
}

/// Whether an attribute leaves its item to tests.
fn is_test(attribute: &TokenStream) -> bool {
    let text = attribute.to_string().replace(' ', "");
    text == "cfg(test)" || text.starts_with("cfg(all(test,")
}

/// Whether a token is a punctuation mark, or a group that begins with it.
fn is_sign(token: &TokenTree, sign: char) -> bool {
    token.to_string().starts_with(sign)
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
    let mut imports = Imports::default();
    imports.read(code.parse().unwrap());
    let found: BTreeSet<(bool, String)> =
        imports.paths.into_iter().map(|(public, path)| (public, path.join("::"))).collect();
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
