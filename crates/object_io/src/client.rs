//! One client per bucket, the shared asynchronous runtime, and the timeouts of requests.

use std::collections::HashMap;
use std::future::Future;
use std::sync::{Arc, LazyLock, Mutex, OnceLock, PoisonError, RwLock};
use std::time::{Duration, Instant};

use object_store::path::Path;
use tokio::runtime::{Builder, Handle, Runtime};

use crate::address::{Address, Client, Scheme};
use crate::cloud;
use crate::error::Error;

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
    /// The client of the address's bucket; [`Error::NotBuilt`] without the feature `cloud`.
    ///
    /// # Errors
    /// [`Error::Settings`] when credentials, region or endpoint are wrong or missing; [`Error::NotBuilt`] without the
    /// feature `cloud`.
    pub fn client(&self) -> Result<Client, Error> {
        let mut clients = CLIENTS.lock().unwrap_or_else(PoisonError::into_inner);
        let name = (self.scheme, self.bucket.clone());
        if let Some(known) = clients.get(&name) {
            return Ok(Arc::clone(known));
        }
        let built = cloud::client(self)?;
        clients.insert(name, Arc::clone(&built));
        Ok(built)
    }

    /// Asks the bucket about the object of this address.
    ///
    /// # Errors
    /// As [`Address::client`] and [`Address::location`]; the error of the request.
    pub async fn request<T>(
        &self,
        question: impl AsyncFnOnce(&Client, &Path) -> object_store::Result<T>,
    ) -> Result<T, Error> {
        let (client, location, clock) = (self.client()?, self.location()?, Instant::now());
        let answer = question(&client, &location).await;
        answer.map_err(|error| Error::of(self, clock.elapsed().as_secs_f64(), &error))
    }
}

/// Timeouts of object-store requests, process-wide.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Settings {
    /// Time after which an incomplete request is aborted and repeated.
    pub timeout: Duration,
    /// Time after which a request is no longer repeated.
    pub give_up: Duration,
}

impl Settings {
    /// Default timeouts.
    pub const DEFAULT: Self = Self { timeout: Duration::from_secs(30), give_up: Duration::from_mins(3) };
}

static SETTINGS: RwLock<Settings> = RwLock::new(Settings::DEFAULT);

/// Sets the timeouts of clients that are created from now on.
pub fn configure(settings: Settings) {
    *SETTINGS.write().unwrap_or_else(PoisonError::into_inner) = settings;
}

#[cfg(feature = "cloud")]
pub(crate) fn settings() -> Settings {
    *SETTINGS.read().unwrap_or_else(PoisonError::into_inner)
}
