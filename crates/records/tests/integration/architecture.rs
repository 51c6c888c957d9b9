//! Architecture test: layers of the crates, as `cargo metadata` lists their dependencies, and sizes of folders.

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

fn root() -> PathBuf {
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
