//! Finds the commit for `freeplay --version`: in the variable `FREEPLAY_COMMIT`, else in git, else in the note that
//! `cargo package` leaves in a crate. Without any of them, the version names no commit.

use std::path::Path;
use std::process::Command;
use std::{env, fs};

fn main() {
    println!("cargo:rerun-if-env-changed=FREEPLAY_COMMIT");
    let commit = env::var("FREEPLAY_COMMIT").ok().filter(|commit| !commit.is_empty());
    let commit = commit.or_else(from_git).or_else(from_package).filter(|commit| !commit.trim().is_empty());
    println!("cargo:rustc-env=FREEPLAY_COMMIT={}", commit.as_deref().map_or("unknown", str::trim));
    let target = env::var("TARGET").unwrap_or_default();
    let profile = env::var("PROFILE").unwrap_or_default();
    println!("cargo:rustc-env=FREEPLAY_BUILD={target}, {profile}");
    let stores = match env::var_os("CARGO_FEATURE_CLOUD") {
        Some(_) => "object stores S3, Google Cloud Storage and Azure with rustls; ",
        None => "",
    };
    println!("cargo:rustc-env=FREEPLAY_FEATURES={stores}Parquet snappy, zstd, lz4, brotli, gzip");
}

fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?.trim().to_owned();
    (output.status.success() && !text.is_empty()).then_some(text)
}

/// The commit of a clone, and its date. Another repository around a source archive is not ours: it does not track
/// this file.
fn from_git() -> Option<String> {
    git(&["ls-files", "--error-unmatch", "build.rs"])?;
    // A commit appends to the log of HEAD.
    if let Some(log) = git(&["rev-parse", "--git-path", "logs/HEAD"]).filter(|log| Path::new(log).exists()) {
        println!("cargo:rerun-if-changed={log}");
    }
    git(&["show", "--no-patch", "--format=%h (%cs)", "--abbrev=12", "HEAD"])
}

/// `.cargo_vcs_info.json` holds `"sha1": "…"`.
fn from_package() -> Option<String> {
    let text = fs::read_to_string(".cargo_vcs_info.json").ok()?;
    let (_, rest) = text.split_once("\"sha1\": \"")?;
    rest.get(..12).map(str::to_owned)
}
