//! Check of the Delta log against the digests that [`log_storage`](crate::delta::log_storage) wrote.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde_json::{Map, Value};

use crate::delta::durable_fs::Entry;
use crate::delta::location::Location;
use crate::delta::log_storage::{DIGESTS, LOG, log_file, version};
use crate::error::Error;

/// Actions of the Delta protocol. Readers skip others, so a changed name would remove files without an error.
const ACTIONS: [&str; 10] = [
    "add",
    "remove",
    "metaData",
    "protocol",
    "txn",
    "commitInfo",
    "cdc",
    "domainMetadata",
    "checkpointMetadata",
    "sidecar",
];

#[derive(Debug)]
pub(crate) struct LogDigests {
    pub(crate) files: BTreeMap<String, PathBuf>,
    digests: BTreeMap<String, BTreeSet<String>>,
}

impl LogDigests {
    pub(crate) fn list(table: &Location) -> Result<Self, Error> {
        let mut files = BTreeMap::new();
        for Entry { path, .. } in table.join(LOG).entries()? {
            files.extend(log_file(&path).map(|name| (name.to_owned(), path.clone())));
        }
        let mut digests: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        for Entry { path, .. } in digest_entries(table)? {
            if let Some((name, digest)) = split(&path) {
                digests.entry(name.to_owned()).or_default().insert(digest.to_owned());
            }
        }
        Ok(Self { files, digests })
    }

    /// The log files that the current version is read from: the newest checkpoint and the commits after it.
    pub(crate) fn current(&self) -> impl Iterator<Item = &Path> {
        let checkpoints = self.files.keys().filter(|name| name.contains(".checkpoint"));
        let newest = checkpoints.filter_map(|name| version(name)).max();
        let is_read = move |name: &str| match newest {
            Some(newest) if name.contains(".checkpoint") => version(name) == Some(newest),
            Some(newest) => version(name) > Some(newest),
            None => true,
        };
        self.files.iter().filter(move |(name, _)| is_read(name)).map(|(_, path)| path.as_path())
    }

    /// Whether a commit was written by another program: it has no digest, and an earlier one has.
    pub(crate) fn is_foreign(&self, file: &Path) -> bool {
        let first = self.digests.keys().next();
        let has_earlier = |name: &str| first.is_some_and(|first| first.as_str() < name);
        log_file(file).is_some_and(|name| has_earlier(name) && !self.digests.contains_key(name))
    }

    /// Compares a log file with its digests, and checks that its actions are those of the protocol.
    ///
    /// # Errors
    /// [`Error::LogDamaged`] when they differ; [`Error::Io`] when the file cannot be read.
    pub(crate) fn check(&self, file: &Path) -> Result<(), Error> {
        let content = std::fs::read(file).map_err(Error::io(file, "read"))?;
        let digest = blake3::hash(&content).to_hex();
        let known = log_file(file).and_then(|name| self.digests.get(name));
        let damaged = |problem: String| Err(Error::LogDamaged { path: file.to_owned(), problem });
        if known.is_some_and(|known| !known.contains(digest.as_str())) {
            return damaged("its content does not match its digest".to_owned());
        }
        if file.extension().is_none_or(|extension| extension != "json") {
            return Ok(());
        }
        for line in content.split(|byte| *byte == b'\n').filter(|line| !line.is_empty()) {
            let Ok(action) = serde_json::from_slice::<Map<String, Value>>(line) else {
                return damaged("a line of it is no JSON object".to_owned());
            };
            if let Some(name) = action.keys().find(|name| !ACTIONS.contains(&name.as_str())) {
                return damaged(format!("`{name}` is no action of the Delta protocol"));
            }
        }
        Ok(())
    }
}

pub(crate) fn add(table: &Location, file: &Path) -> Result<(), Error> {
    let content = std::fs::read(file).map_err(Error::io(file, "read"))?;
    let digests = table.join(DIGESTS);
    let name = format!("{}.{}", log_file(file).unwrap_or_default(), blake3::hash(&content).to_hex());
    digests.create(&digests.dir().join(name), &[])
}

/// Deletes the digests of log files that the log clean-up has deleted.
pub(crate) fn prune(table: &Location) -> Result<(), Error> {
    let listed = LogDigests::list(table)?;
    let oldest = listed.files.keys().filter_map(|name| version(name)).min();
    for Entry { path, .. } in digest_entries(table)? {
        if split(&path).is_some_and(|(name, _)| version(name) < oldest) {
            table.delete(&path)?;
        }
    }
    Ok(())
}

fn digest_entries(table: &Location) -> Result<Vec<Entry>, Error> {
    let folder = table.join(DIGESTS);
    // A table of an earlier release has no such folder.
    if !folder.is_bucket() && !table.has(DIGESTS)? {
        return Ok(Vec::new());
    }
    folder.entries()
}

/// The name of a log file and its digest.
fn split(digest_file: &Path) -> Option<(&str, &str)> {
    let (name, digest) = digest_file.file_name()?.to_str()?.rsplit_once('.')?;
    (digest.len() == 64 && version(name).is_some()).then_some((name, digest))
}
