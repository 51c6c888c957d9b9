//! Files in a folder of logs that are no logs: temporary files, and files that a table has withdrawn.

pub(crate) mod local_files;
pub(crate) mod table_folders;
pub mod temporary_files;
