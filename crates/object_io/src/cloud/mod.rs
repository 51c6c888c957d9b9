//! Clients of buckets and of HTTP: the feature `cloud`.

mod aws_profile;
mod buckets;
mod http_client;
mod retry;

pub(crate) use buckets::client;
pub use http_client::post_json;
