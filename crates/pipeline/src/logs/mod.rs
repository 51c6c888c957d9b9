//! Which logs there are, and which of them a run reads: files of the folders, less those that are no logs, against their
//! status in the store.

pub mod discover;
mod discover_remote;
pub mod file_stat;
pub mod local_files;
pub mod plan;
mod table_folders;
