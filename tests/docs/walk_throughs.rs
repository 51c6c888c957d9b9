//! Walk-throughs of CONTRIBUTING.md: each patch of `tests/data/walk-throughs` does what its list says. The gate applies
//! all of them to a copy of the sources and compiles it.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::gate::is_gate;
use crate::harness::{copy, top};

#[test]
fn changes_of_the_walk_throughs_apply_and_compile() {
    if !is_gate() {
        return;
    }
    let copied = tempfile::tempdir().unwrap();
    for name in ["crates", "docs", "third_party", "tests", "benches"] {
        copy(&top().join(name), &copied.path().join(name));
    }
    for name in ["Cargo.toml", "Cargo.lock", "README.md"] {
        std::fs::copy(top().join(name), copied.path().join(name)).unwrap();
    }
    let patches = glob::glob(top().join("tests/data/walk-throughs/*.patch").to_str().unwrap()).unwrap();
    let patches: Vec<PathBuf> = patches.flatten().collect();
    assert!(patches.len() > 2, "{patches:?}");
    for patch in patches {
        runs(Command::new("git").arg("apply").arg(patch), copied.path());
    }
    // Dependencies are those of the lints; checking writes no program that other tests start.
    let target = Path::new(env!("CARGO_BIN_EXE_freeplay")).ancestors().nth(2).unwrap();
    let mut check = Command::new(env!("CARGO"));
    // What cargo says of this package to a test would run build scripts anew, and build all that depends on them twice.
    let is_of_package = |name: &str| name.starts_with("CARGO_MANIFEST_") || name.starts_with("CARGO_PKG_");
    for (name, _) in std::env::vars().filter(|(name, _)| is_of_package(name)) {
        check.env_remove(name);
    }
    runs(check.args(["check", "-p", "cli", "--locked", "--target-dir"]).arg(target), copied.path());
}

fn runs(command: &mut Command, folder: &Path) {
    let result = command.current_dir(folder).output().unwrap();
    assert!(result.status.success(), "{command:?}:\n{}", String::from_utf8_lossy(&result.stderr));
}
