//! The licences of everything that is linked into `freeplay`: each text once, with the packages it belongs to.
//!
//! ```text
//! cargo run --locked -p records --example licences > THIRD-PARTY-LICENCES.txt
//! ```

#![allow(clippy::print_stdout, reason = "a command prints")]

use std::collections::{BTreeMap, BTreeSet};
use std::error::Error;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

/// The package whose dependencies are listed.
const ROOT: &str = "cli";
/// How names of files with licences begin.
const NAMES: [&str; 5] = ["LICENSE", "LICENCE", "COPYING", "NOTICE", "UNLICENSE"];

fn main() -> Result<(), Box<dyn Error>> {
    let metadata = metadata()?;
    let linked = linked(&metadata)?;
    let mut by_text: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for package in metadata["packages"].as_array().into_iter().flatten() {
        let is_foreign = !package["source"].is_null() && linked.contains(text(&package["id"]));
        if !is_foreign {
            continue;
        }
        let name = format!("{} {}", text(&package["name"]), text(&package["version"]));
        println!("{name}: {}", text(&package["license"]));
        for licence in licences(Path::new(text(&package["manifest_path"])))? {
            by_text.entry(licence).or_default().push(name.clone());
        }
    }
    for (licence, packages) in by_text {
        println!("\n{}\n{}\n\n{}", "=".repeat(80), packages.join(", "), licence.trim_end());
    }
    Ok(())
}

fn text(value: &Value) -> &str {
    value.as_str().unwrap_or_default()
}

fn metadata() -> Result<Value, Box<dyn Error>> {
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../Cargo.toml");
    let mut command = Command::new(std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned()));
    command.args(["metadata", "--format-version", "1", "--locked", "--manifest-path"]).arg(manifest);
    let output = command.output()?;
    if !output.status.success() {
        return Err(String::from_utf8_lossy(&output.stderr).into());
    }
    Ok(serde_json::from_slice(&output.stdout)?)
}

/// Packages that the root links or builds with, not those of its tests.
fn linked(metadata: &Value) -> Result<BTreeSet<String>, Box<dyn Error>> {
    let nodes = metadata["resolve"]["nodes"].as_array().ok_or("no resolved dependencies")?;
    let by_id: BTreeMap<&str, &Value> = nodes.iter().map(|node| (text(&node["id"]), node)).collect();
    let packages = metadata["packages"].as_array().ok_or("no packages")?;
    let root = packages.iter().find(|package| package["name"] == ROOT).ok_or("no root")?;
    let mut open = vec![text(&root["id"])];
    let mut seen = BTreeSet::new();
    while let Some(id) = open.pop() {
        if !seen.insert(id.to_owned()) {
            continue;
        }
        let dependencies = by_id.get(id).and_then(|node| node["deps"].as_array());
        let is_used = |kind: &Value| kind["kind"] != "dev";
        let used = dependencies.into_iter().flatten().filter(|dependency| {
            dependency["dep_kinds"].as_array().is_some_and(|kinds| kinds.iter().any(is_used))
        });
        open.extend(used.map(|dependency| text(&dependency["pkg"])));
    }
    Ok(seen)
}

/// Texts of the licences next to a manifest.
fn licences(manifest: &Path) -> Result<Vec<String>, Box<dyn Error>> {
    let folder = manifest.parent().ok_or("a manifest without a folder")?;
    let mut files: Vec<_> = std::fs::read_dir(folder)?.filter_map(Result::ok).collect();
    files.sort_by_key(std::fs::DirEntry::file_name);
    let is_licence = |file: &std::fs::DirEntry| {
        let name = file.file_name().to_string_lossy().to_uppercase();
        NAMES.iter().any(|start| name.starts_with(start)) && file.path().is_file()
    };
    Ok(files
        .iter()
        .filter(|file| is_licence(file))
        .map(|file| std::fs::read_to_string(file.path()))
        .collect::<Result<_, _>>()?)
}
