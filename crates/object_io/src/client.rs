//! One client per bucket, and the shared asynchronous runtime.

use std::collections::HashMap;
use std::future::Future;
use std::sync::{Arc, LazyLock, Mutex, OnceLock, PoisonError};

use object_store::aws::{AmazonS3Builder, AmazonS3ConfigKey};
use object_store::azure::MicrosoftAzureBuilder;
use object_store::gcp::GoogleCloudStorageBuilder;
use object_store::{ClientOptions, ObjectStore, RetryConfig};
use tokio::runtime::{Builder, Handle, Runtime};

use crate::address::{Address, Scheme};
use crate::aws_profile::AwsProfileSource;
use crate::error::Error;
use crate::retry::RetryingStore;
use crate::settings::settings;

/// Client of a bucket, shared by all requests to that bucket.
pub type Client = Arc<dyn ObjectStore>;

static CLIENTS: LazyLock<Mutex<HashMap<(Scheme, String), Client>>> = LazyLock::new(Mutex::default);

/// Runs a future to completion on the shared runtime; the caller's thread blocks.
///
/// # Errors
/// [`Error::Settings`] when the system gives no threads.
pub fn block_on<F: Future>(work: F) -> Result<F::Output, Error> {
    Ok(handle()?.block_on(work))
}

/// Handle of the shared runtime, for other asynchronous work: connections live as long as the runtime.
///
/// # Errors
/// [`Error::Settings`] when the system gives no threads.
pub fn handle() -> Result<Handle, Error> {
    static RUNTIME: OnceLock<Result<Runtime, String>> = OnceLock::new();
    let started =
        || Builder::new_multi_thread().worker_threads(2).thread_name("objects").enable_all().build();
    match RUNTIME.get_or_init(|| started().map_err(|e| e.to_string())) {
        Ok(runtime) => Ok(runtime.handle().clone()),
        Err(detail) => Err(Error::Settings { place: "an object store".to_owned(), detail: detail.clone() }),
    }
}

impl Address {
    /// The client of the address's bucket.
    ///
    /// # Errors
    /// [`Error::Settings`] when credentials, region or endpoint are wrong or missing.
    pub fn client(&self) -> Result<Client, Error> {
        let mut clients = CLIENTS.lock().unwrap_or_else(PoisonError::into_inner);
        let name = (self.scheme, self.bucket.clone());
        if let Some(known) = clients.get(&name) {
            return Ok(Arc::clone(known));
        }
        let detail = |detail: String| Error::Settings { place: self.bucket_url(), detail };
        let built = match self.scheme {
            Scheme::S3 => s3(&self.bucket).map_err(detail)?,
            Scheme::Gs => gs(&self.bucket).map_err(|e| detail(e.to_string()))?,
            Scheme::Az => az(&self.bucket).map_err(|e| detail(e.to_string()))?,
        };
        let built: Client = Arc::new(RetryingStore::new(built, settings().give_up));
        clients.insert(name, Arc::clone(&built));
        Ok(built)
    }
}

fn s3(bucket: &str) -> Result<Client, String> {
    let mut builder = AmazonS3Builder::from_env();
    let given = |builder: &AmazonS3Builder, key| builder.get_config_value(&key).is_some();
    // Keys are taken from one source only: a token does not belong to the key of another source.
    let has_key = given(&builder, AmazonS3ConfigKey::AccessKeyId);
    for (key, value) in AwsProfileSource::from_env().read()? {
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
