//! Object stores behind a blocking door: `s3://`, `gs://` and `az://` where a path is taken.
//!
//! An address is kept as a path, so that whoever only passes names on need not know: [`is_address`] tells them
//! apart. One object is read by [`Spool`], which copies the ranges that are asked for into a nameless
//! temporary file at their own offsets, and all others read that file as they would a local one. A folder is
//! listed by [`list`], page by page.
//!
//! The library underneath is asynchronous; a runtime of two threads is started by the first object that is
//! asked for, and a process that reads local files only never has one. Credentials come from the environment
//! and from AWS profile files (`docs/objects.md`).

mod address;
mod client;
mod error;
mod listing;
mod patient;
mod profile;
mod range;
mod settings;
mod spool;

pub use address::{Address, is_address};
pub use client::{Client, block_on, handle};
pub use error::Error;
pub use listing::{Entry, list, look};
pub use settings::{Settings, configure};
pub use spool::{Spool, whole};
