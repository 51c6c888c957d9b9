//! Architecture test: crate layers, import cycles between the files of a crate, and folder sizes.
//!
//! Layers are those of `cargo metadata`. Imports are read from the text of every file, so all targets and features are
//! covered without a compiler; modules of tests are not checked.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

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
        let in_cycle = cycles(Modules::read(&name).graph()).into_iter();
        found.extend(in_cycle.map(|module| format!("{name}: crate::{}", module.join("::"))));
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
        let manifest = PathBuf::from(text(&package["manifest_path"]));
        let name = manifest.parent().unwrap().file_name().unwrap().to_str().unwrap().to_owned();
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

/// Import of a file: the path as it is written, and whether it is re-exported.
type Import = (bool, Vec<String>);

struct Modules(BTreeMap<ModulePath, Vec<Import>>);

impl Modules {
    fn read(name: &str) -> Self {
        let src = root().join("crates").join(name).join("src");
        let mut modules: BTreeMap<ModulePath, Vec<Import>> = BTreeMap::new();
        for file in sources(&src) {
            let relative = file.strip_prefix(&src).unwrap().with_extension("");
            let mut path: ModulePath =
                relative.iter().map(|part| part.to_str().unwrap().to_owned()).collect();
            // `lib.rs` and `main.rs` are both the crate root.
            path.pop_if(|name| ["lib", "main", "mod"].contains(&name.as_str()));
            modules.entry(path).or_default().extend(imports(&std::fs::read_to_string(&file).unwrap()));
        }
        Self(modules)
    }

    fn graph(&self) -> BTreeMap<ModulePath, BTreeSet<ModulePath>> {
        let imported = |(module, imports): (&ModulePath, &Vec<Import>)| {
            let target = |(is_public, path): &Import| {
                let target = self.resolve(&self.absolute(module, path)?, 8)?;
                // A module that re-exports its own descendants is a facade, which is no import.
                let is_facade = *is_public && target.starts_with(module);
                (target != *module && !is_facade).then_some(target)
            };
            (module.clone(), imports.iter().filter_map(target).collect())
        };
        self.0.iter().map(imported).collect()
    }

    /// Path from the crate root; `None` for another crate.
    fn absolute(&self, module: &ModulePath, path: &[String]) -> Option<Vec<String>> {
        let child = [module.as_slice(), &path[..1]].concat();
        let supers = path.iter().take_while(|segment| *segment == "super").count();
        let (base, rest) = match path[0].as_str() {
            "crate" => (&[][..], &path[1..]),
            "super" => (&module[..module.len().checked_sub(supers)?], &path[supers..]),
            "self" => (module.as_slice(), &path[1..]),
            _ => (self.0.contains_key(&child).then_some(module.as_slice())?, path),
        };
        Some([base, rest].concat())
    }

    /// The module that defines the item of a path; re-exports are followed to it.
    fn resolve(&self, path: &[String], depth: u32) -> Option<ModulePath> {
        let length = (0..=path.len()).rev().find(|length| self.0.contains_key(&path[..*length]))?;
        let (module, item) = (path[..length].to_vec(), path.get(length));
        let exported = self.0[&module].iter().find(|(is_public, from)| *is_public && from.last() == item);
        match exported.filter(|_| item.is_some() && depth > 0) {
            Some((_, from)) => {
                self.absolute(&module, from).and_then(|target| self.resolve(&target, depth - 1))
            }
            None => Some(module),
        }
    }
}

/// The paths of `use` declarations, and those that begin with `crate` or `super` elsewhere, in code as rustfmt writes
/// it: without comments, and up to the tests, which are the end of a file.
fn imports(code: &str) -> Vec<Import> {
    let code = code.split("\nmod tests {").next().unwrap();
    let lines: Vec<&str> = code.lines().filter(|line| !line.trim_start().starts_with("//")).collect();
    let mut found = Vec::new();
    for statement in lines.join("\n").split(';') {
        let split = statement.rsplit_once("use ").map(|(before, tree)| {
            let (others, visibility) = before.rsplit_once('\n').unwrap_or(("", before));
            (others, visibility.trim(), tree)
        });
        let is_use = |visibility: &str| visibility.is_empty() || visibility.starts_with("pub");
        let (others, visibility, tree) =
            split.filter(|(_, visibility, _)| is_use(visibility)).unwrap_or((statement, "", ""));
        found.extend(expand(tree).into_iter().map(|path| (!visibility.is_empty(), path)));
        let words = others.split(|c: char| !(c.is_alphanumeric() || c == '_' || c == ':'));
        let paths = words.filter(|word| word.starts_with("crate::") || word.starts_with("super::"));
        found.extend(paths.map(|path| (false, path.to_owned())));
    }
    let segments =
        |path: String| path.split("::").filter(|part| !part.is_empty()).map(str::to_owned).collect();
    let found = found.into_iter().map(|(is_public, path)| (is_public, segments(path)));
    found.filter(|(_, path): &Import| !path.is_empty()).collect()
}

/// Expands a `use` tree into its paths; names after `as` are dropped, and `a::{self, b}` names `a` itself.
fn expand(tree: &str) -> Vec<String> {
    let Some((prefix, group)) = tree.trim().split_once('{') else {
        let path = tree.split(" as ").next().unwrap().trim();
        return vec![path.strip_suffix("self").unwrap_or(path).to_owned()];
    };
    let mut depth = 0;
    let is_end = |c: char| {
        depth += i32::from(c == '{') - i32::from(c == '}');
        c == ',' && depth == 0
    };
    let trees = group.strip_suffix('}').unwrap_or(group).split(is_end).filter(|tree| !tree.trim().is_empty());
    trees.flat_map(expand).map(|path| format!("{prefix}{path}")).collect()
}

/// What is left of a graph of imports once no module is without an import or without an importer: cycles, and what lies
/// between two of them.
fn cycles(mut graph: BTreeMap<ModulePath, BTreeSet<ModulePath>>) -> Vec<ModulePath> {
    let is_end = |graph: &BTreeMap<ModulePath, BTreeSet<ModulePath>>, module: &ModulePath| {
        !graph[module].iter().any(|other| graph.contains_key(other))
            || !graph.values().any(|imported| imported.contains(module))
    };
    while let Some(end) = graph.keys().find(|module| is_end(&graph, module)).cloned() {
        graph.remove(&end);
    }
    graph.into_keys().collect()
}

#[test]
fn a_cycle_is_found_in_any_form_of_import_and_a_chain_comments_and_tests_are_none() {
    let module = |name: &str| vec![name.to_owned()];
    let cycles = |files: &[(&str, &str)]| {
        let files = files.iter().map(|(name, code)| (module(name), imports(code)));
        cycles(Modules(files.chain([(Vec::new(), imports("pub use b::Item;"))]).collect()).graph())
    };
    let in_test = "use serde::a;\n#[cfg(test)]\nmod tests {\n    use crate::a;\n}";
    let chain = [("a", "use crate::b::f;"), ("b", "//! use crate::a;\nuse crate::c;"), ("c", in_test)];
    assert!(cycles(&chain).is_empty());
    for code in ["use crate::{Item, c};", "use crate::{\n    c::{self, D as E},\n    b::{self, F},\n};"] {
        let found = cycles(&[("a", code), ("b", "fn f() { super::a::g() }"), ("c", "")]);
        assert_eq!(found, [module("a"), module("b")], "{code}");
    }
}
