//! Commands that prepare a folder or a shell.

pub(crate) mod init;
mod proposal;
pub(crate) mod shell;
pub(crate) mod simulate;
