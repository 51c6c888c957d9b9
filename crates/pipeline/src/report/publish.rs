//! Publishes a report folder: written completely under a temporary name, then renamed.

use std::collections::BTreeSet;
use std::fs;
use std::io::BufWriter;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use rayon::prelude::*;
use records::Diagnostic;
use records::sanitize::escape_cell;
use report::{Page, Report};
use tempfile::TempDir;

use crate::{Error, Event};

/// Age at which a temporary folder is one of a report that was killed.
const LEFTOVER_AGE: Duration = Duration::from_hours(24);

/// File of a report that lists all its files: nothing else is ever removed. A temporary folder has it from the start.
const MANIFEST: &str = ".freeplay-report";

/// What was written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub struct PublishSummary {
    pub files: u64,
    pub bytes: u64,
}

/// Writes the pages of a report, and further files of it, to a folder, in the place of the report that was there.
///
/// # Errors
/// When the folder holds something that is no report, or a page cannot be made or written: the report
/// that was there stays.
pub fn write(
    report: &Report,
    files: Vec<Page>,
    dir: &Path,
    watch: &(impl Fn(Event) + Sync),
) -> Result<PublishSummary, Error> {
    // A link stays one: the folder that it leads to is written.
    let named = dir;
    let resolved = dir.canonicalize().unwrap_or_else(|_| dir.to_owned());
    let dir = resolved.as_path();
    refuse_foreign(dir, named)?;
    let parent = dir.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    fs::create_dir_all(parent).map_err(|e| failed(parent, e))?;
    remove_leftovers(parent, &prefix(dir));
    // Both are removed when anything fails.
    let fresh = temporary(parent, dir)?;
    let written = all(report, files, fresh.path(), watch)?;
    let list = fresh.path().join(MANIFEST);
    fs::write(&list, entries(fresh.path()).join("\n")).map_err(|e| failed(&list, e))?;
    let old = temporary(parent, dir)?;
    let replaced = old.path().join("report");
    if dir.exists() {
        fs::rename(dir, &replaced).map_err(|e| failed(dir, e))?;
    }
    fs::rename(fresh.path(), dir).map_err(|e| {
        // Best effort: the report that was there is not lost with its temporary folder.
        let _ = fs::rename(&replaced, dir);
        failed(dir, e)
    })?;
    Ok(written)
}

/// Refuses a folder that holds anything but a report: replacing it would delete what belongs to someone else.
fn refuse_foreign(dir: &Path, named: &Path) -> Result<(), Error> {
    let found = entries(dir);
    let list = fs::read_to_string(dir.join(MANIFEST)).ok();
    let ours: BTreeSet<&str> = list.iter().flat_map(|list| list.lines()).chain([MANIFEST]).collect();
    let foreign: Vec<&String> = found.iter().filter(|entry| !ours.contains(entry.as_str())).collect();
    let Some(first) = foreign.first() else { return Ok(()) };
    let more = match foreign.len() {
        1 => String::new(),
        count => format!(" and {} more", count - 1),
    };
    let what = format!("{} holds files that are not a report: {}{more}", named.display(), escape_cell(first));
    let diagnostic = Diagnostic::new("would_overwrite", what)
        .hint("move these files away, or name an empty folder or one that only a report was written to");
    Err(Error::refused(diagnostic))
}

/// Everything in a folder, folders included, as paths from it with `/`, in order. Links are entries.
fn entries(dir: &Path) -> Vec<String> {
    let below = |entry: walkdir::DirEntry| {
        let parts = entry.path().strip_prefix(dir).ok()?.components();
        let names: Vec<_> = parts.map(|part| part.as_os_str().to_string_lossy()).collect();
        Some(names.join("/"))
    };
    let mut found: Vec<String> =
        walkdir::WalkDir::new(dir).min_depth(1).into_iter().flatten().filter_map(below).collect();
    found.sort_unstable();
    found
}

fn all(
    report: &Report,
    further: Vec<Page>,
    dir: &Path,
    watch: &(impl Fn(Event) + Sync),
) -> Result<PublishSummary, Error> {
    let folders = further.iter().filter_map(|page| Path::new(&page.path).parent());
    for folder in ["assets", "tail", "serial", "part"].into_iter().map(Path::new).chain(folders) {
        fs::create_dir_all(dir.join(folder)).map_err(|e| failed(dir, e))?;
    }
    let pages = report.units.len() + report.tails.len();
    watch(Event::Planned { logs: pages, bytes: 0 });
    let (files, bytes) = (AtomicU64::new(0), AtomicU64::new(0));
    let put = |page: Page| {
        let path = dir.join(&page.path);
        files.fetch_add(1, Ordering::Relaxed);
        bytes.fetch_add(page.body.len() as u64, Ordering::Relaxed);
        fs::write(&path, &page.body).map_err(|e| failed(&path, e))
    };
    let done = |page: Page| {
        let log = page.path.clone();
        let bytes = page.body.len() as u64;
        put(page)?;
        watch(Event::Finished { log, bytes, estimated: 0, refused: 0, diagnostics: Vec::new() });
        Ok::<(), Error>(())
    };
    report::assets().into_iter().chain(further).try_for_each(put)?;
    let peers = report::Peers::of(report);
    report.units.par_iter().try_for_each(|unit| done(report::unit_page(report, &peers, unit)?))?;
    report.tails.par_iter().try_for_each(|tail| done(report::tail_page(report, &peers, tail)?))?;
    let pages = report::part_pages(report, &peers)?.into_iter().chain(report::fleet_pages(report, &peers)?);
    pages.into_iter().try_for_each(put)?;
    let json = write_json(report, &dir.join("report.json"))?;
    Ok(PublishSummary { files: files.into_inner() + 1, bytes: bytes.into_inner() + json })
}

/// Writes a report's results for programs, without holding their text; returns its bytes.
fn write_json(report: &Report, path: &Path) -> Result<u64, Error> {
    let write = || {
        let mut file = BufWriter::new(fs::File::create(path)?);
        serde_json::to_writer(&mut file, report)?;
        file.into_inner().map_err(std::io::IntoInnerError::into_error)?.metadata().map(|of| of.len())
    };
    write().map_err(|e| failed(path, e))
}

fn prefix(dir: &Path) -> String {
    let name = dir.file_name().map_or_else(|| "report".to_owned(), |n| n.to_string_lossy().into_owned());
    format!(".{name}.new-")
}

/// A folder of its own next to the report, so that two programs may write one report; it is removed when dropped.
fn temporary(parent: &Path, dir: &Path) -> Result<TempDir, Error> {
    let prefix = prefix(dir);
    let mut builder = tempfile::Builder::new();
    builder.prefix(&prefix);
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o777));
    let made = builder.tempdir_in(parent).map_err(|e| failed(dir, e))?;
    fs::write(made.path().join(MANIFEST), "").map_err(|e| failed(dir, e))?;
    Ok(made)
}

/// Removes the temporary folders of reports that were killed more than a day ago.
fn remove_leftovers(parent: &Path, prefix: &str) {
    for entry in fs::read_dir(parent).into_iter().flatten().flatten() {
        let is_named = entry.file_name().to_string_lossy().starts_with(prefix);
        let is_ours = is_named && entry.path().join(MANIFEST).is_file();
        let age = entry.metadata().and_then(|of| of.modified()).ok().and_then(|at| at.elapsed().ok());
        if is_ours && age.is_some_and(|age| age > LEFTOVER_AGE) {
            // What cannot be removed now is removed by a later report.
            let _ = fs::remove_dir_all(entry.path());
        }
    }
}

fn failed(path: &Path, source: std::io::Error) -> Error {
    Error::Pages { path: path.to_owned(), source }
}
