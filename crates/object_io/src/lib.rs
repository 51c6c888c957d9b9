//! Blocking access to object stores: `s3://`, `gs://` and `az://` addresses in place of paths.
//!
//! An address is stored as a path, so that code that only passes names on needs no second type; [`is_address`]
//! distinguishes the two. [`ObjectFile`] reads one object: it copies the requested byte ranges into an unnamed
//! temporary file at their own offsets, which is then read like a local file. [`list`] lists a folder page by page.
//!
//! `object_store` is asynchronous. The first request starts a runtime of two threads; a process that reads only
//! local files never starts it. Credentials come from the environment and from AWS profile files
//! (`docs/objects.md`). Without the feature `cloud`, every address is an error that names this feature.

mod address;
mod byte_ranges;
mod client;
#[cfg(feature = "cloud")]
mod cloud;
#[cfg(not(feature = "cloud"))]
#[path = "without_cloud.rs"]
mod cloud;
mod error;
mod http_post;
mod listing;
mod local_file;
mod object_file;

pub use address::{Address, Client, is_address};
pub use client::{Settings, block_on, configure, handle};
pub use cloud::post_json;
pub use error::Error;
pub use http_post::{Posted, check_url};
pub use listing::{ListEntry, head, list};
pub use local_file::{create_fresh, system_error};
pub use object_file::ObjectFile;
