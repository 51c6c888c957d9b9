//! Log discovery in object stores: keys that match a pattern, with the metadata of the listing.

use object_io::{Address, ListEntry};

use crate::error::Error;
use crate::logs::local_files::AS_FILES;
use crate::logs::table_folders::TableFolders;

/// Objects of a folder by which a table is recognised; their names sort before those of data files.
const MOST_NOTED: usize = 1000;

/// Every object that fits a pattern; the tables that are met are noted. Only the folder before its first wildcard is
/// listed.
///
/// # Errors
/// [`Error::Objects`] when the store is not reachable.
pub(crate) fn matching(
    address: &Address,
    wanted: &glob::Pattern,
    tables: &mut TableFolders,
) -> Result<Vec<ListEntry>, Error> {
    let Some(first) = address.key().find(['*', '?', '[']) else {
        note_tables_above(address, address.key(), tables)?;
        return match object_io::head(address) {
            Err(object_io::Error::Missing { .. }) => Ok(Vec::new()),
            entry => Ok(vec![entry?]),
        };
    };
    let folder = address.key()[..first].rsplit_once('/').map_or("", |(folder, _)| folder);
    let root = address.bucket_url();
    note_tables_above(address, folder, tables)?;
    let mut found = Vec::new();
    object_io::list(&address.with_key(folder), usize::MAX, |entry| {
        tables.note(&entry.path);
        let key = entry.path.to_str().and_then(|text| text.strip_prefix(&root));
        if key.is_some_and(|key| wanted.matches_with(key, AS_FILES)) {
            found.push(entry);
        }
    })?;
    Ok(found)
}

/// Notes the tables whose folders lie above a key: a pattern may name a partition of a table. Folders that these
/// credentials may not list are none.
fn note_tables_above(address: &Address, key: &str, tables: &mut TableFolders) -> Result<(), Error> {
    let mut above = key;
    while !above.is_empty() {
        above = above.rsplit_once('/').map_or("", |(folder, _)| folder);
        let separator = if above.is_empty() { "" } else { "/" };
        for name in TableFolders::LOGS {
            let log = address.with_key(&format!("{above}{separator}{name}"));
            match object_io::list(&log, MOST_NOTED, |entry| tables.note(&entry.path)) {
                Ok(()) | Err(object_io::Error::Denied { .. } | object_io::Error::Missing { .. }) => {}
                Err(error) => return Err(error.into()),
            }
        }
    }
    Ok(())
}
