//! Clients of S3, Google Cloud Storage and Azure Blob Storage, with settings from the environment.

use std::sync::Arc;

use object_store::aws::{AmazonS3Builder, AmazonS3ConfigKey};
use object_store::azure::MicrosoftAzureBuilder;
use object_store::gcp::GoogleCloudStorageBuilder;
use object_store::{ClientOptions, RetryConfig};

use crate::address::{Address, Client, Scheme};
use crate::client::settings;
use crate::cloud::aws_profile;
use crate::cloud::retry::RetryingStore;
use crate::error::Error;

pub(crate) fn client(address: &Address) -> Result<Client, Error> {
    let detail = |detail: String| Error::Settings { place: address.bucket_url(), detail };
    let built = match address.scheme {
        Scheme::S3 => s3(&address.bucket).map_err(detail)?,
        Scheme::Gs => gs(&address.bucket).map_err(|e| detail(e.to_string()))?,
        Scheme::Az => az(&address.bucket).map_err(|e| detail(e.to_string()))?,
    };
    Ok(Arc::new(RetryingStore::new(built, settings().give_up)))
}

fn s3(bucket: &str) -> Result<Client, String> {
    let mut builder = AmazonS3Builder::from_env();
    let given = |builder: &AmazonS3Builder, key| builder.get_config_value(&key).is_some();
    // Keys are taken from one source only: a token does not belong to the key of another source.
    let has_key = given(&builder, AmazonS3ConfigKey::AccessKeyId);
    for (key, value) in aws_profile::from_env()? {
        let is_key = !matches!(key, AmazonS3ConfigKey::Region | AmazonS3ConfigKey::Endpoint);
        let is_given = if is_key { has_key } else { given(&builder, key) };
        if !is_given {
            builder = builder.with_config(key, value);
        }
    }
    let endpoint = [AmazonS3ConfigKey::S3Endpoint, AmazonS3ConfigKey::Endpoint];
    let endpoint = endpoint.iter().find_map(|key| builder.get_config_value(key));
    // An explicit http:// endpoint is used as it is, as the AWS tools do.
    let is_plain = endpoint.is_some_and(|url| url.starts_with("http://"));
    let built =
        builder.with_bucket_name(bucket).with_client_options(options(is_plain)).with_retry(retry()).build();
    Ok(Arc::new(built.map_err(|e| e.to_string())?))
}

fn gs(bucket: &str) -> object_store::Result<Client> {
    let builder = GoogleCloudStorageBuilder::from_env().with_bucket_name(bucket);
    Ok(Arc::new(builder.with_client_options(options(false)).with_retry(retry()).build()?))
}

fn az(container: &str) -> object_store::Result<Client> {
    let builder = MicrosoftAzureBuilder::from_env().with_container_name(container);
    Ok(Arc::new(builder.with_client_options(options(false)).with_retry(retry()).build()?))
}

fn options(allow_http: bool) -> ClientOptions {
    let options = ClientOptions::new().with_timeout(settings().timeout);
    let options = options.with_connect_timeout(settings().timeout.min(std::time::Duration::from_secs(5)));
    if allow_http { options.with_allow_http(true) } else { options }
}

fn retry() -> RetryConfig {
    RetryConfig { retry_timeout: settings().give_up, ..RetryConfig::default() }
}
