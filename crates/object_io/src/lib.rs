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
#[cfg(feature = "cloud")]
mod aws_profile;
#[cfg(feature = "cloud")]
mod buckets;
mod byte_ranges;
mod client;
mod error;
#[cfg(feature = "cloud")]
mod http_client;
mod http_post;
mod listing;
mod object_file;
#[cfg(feature = "cloud")]
mod retry;
mod settings;
#[cfg(not(feature = "cloud"))]
mod without_cloud;

pub use address::{Address, is_address};
pub use client::{Client, block_on, handle};
pub use error::Error;
#[cfg(feature = "cloud")]
pub use http_client::post_json;
pub use http_post::{Posted, check_url};
pub use listing::{ListEntry, head, list, list_first};
pub use object_file::{ObjectFile, read_all};
pub use settings::{Settings, configure};
#[cfg(not(feature = "cloud"))]
use without_cloud as buckets;
#[cfg(not(feature = "cloud"))]
pub use without_cloud::post_json;
