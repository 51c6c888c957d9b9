//! `ObjectStore` wrapper that retries requests and checks the length of each body.
//!
//! The wrapped clients retry until the response header. This wrapper also reads each body completely and checks
//! its length before returning it, resumes a listing after the last received key, and compares an existing object
//! with the content to be written: the response to a successful write may have been lost.

use std::fmt;
use std::future::Future;
use std::sync::Arc;
use std::time::{Duration, Instant};

use async_trait::async_trait;
use bytes::Bytes;
use futures::stream::BoxStream;
use futures::{StreamExt, stream};
use object_store::path::Path;
use object_store::{
    CopyOptions, Error, GetOptions, GetRange, GetResult, GetResultPayload, ListResult, MultipartUpload,
    ObjectMeta, ObjectStore, ObjectStoreExt, PutMode, PutMultipartOptions, PutOptions, PutPayload, PutResult,
    Result,
};

/// The first delay; each retry doubles it.
const FIRST_DELAY: Duration = Duration::from_millis(100);
const MAX_DELAY: Duration = Duration::from_secs(15);

#[derive(Debug, Clone)]
pub(crate) struct RetryingStore {
    inner: Arc<dyn ObjectStore>,
    give_up: Duration,
}

struct Backoff {
    deadline: Instant,
    delay: Duration,
}

impl Backoff {
    /// Waits before the next attempt; returns the error if it is permanent or the deadline has passed.
    async fn wait_after(&mut self, error: Error) -> Result<()> {
        let is_passing = matches!(error, Error::Generic { .. } | Error::JoinError { .. });
        if !is_passing || Instant::now() + self.delay > self.deadline {
            return Err(error);
        }
        tokio::time::sleep(self.delay).await;
        self.delay = (self.delay * 2).min(MAX_DELAY);
        Ok(())
    }
}

impl RetryingStore {
    pub(crate) fn new(inner: Arc<dyn ObjectStore>, give_up: Duration) -> Self {
        Self { inner, give_up }
    }

    fn backoff(&self) -> Backoff {
        Backoff { deadline: Instant::now() + self.give_up, delay: FIRST_DELAY }
    }

    /// Repeats a request until it succeeds, fails permanently or the deadline passes.
    async fn with_retry<T, F: Future<Output = Result<T>>>(&self, mut ask: impl FnMut() -> F) -> Result<T> {
        let mut backoff = self.backoff();
        loop {
            match ask().await {
                Ok(answer) => return Ok(answer),
                Err(error) => backoff.wait_after(error).await?,
            }
        }
    }

    /// A whole object, requested as a range: only a range response states the length of the whole object, so
    /// that a body truncated together with its `Content-Length` is detected.
    async fn without_range(&self, location: &Path, options: GetOptions) -> Result<GetResult> {
        let ranged = GetOptions { range: Some(GetRange::Offset(0)), ..options.clone() };
        match self.complete_body(location, ranged).await {
            // An empty object has no range.
            Err(error @ Error::Generic { .. }) => match self.inner.head(location).await {
                Ok(meta) if meta.size == 0 => self.complete_body(location, options).await,
                _ => Err(error),
            },
            answer => answer,
        }
    }

    async fn complete_body(&self, location: &Path, options: GetOptions) -> Result<GetResult> {
        let is_head = options.head;
        let answer = self.inner.get_opts(location, options).await?;
        if is_head {
            return Ok(answer);
        }
        let (meta, range, attributes) =
            (answer.meta.clone(), answer.range.clone(), answer.attributes.clone());
        let (bytes, length) = (answer.bytes().await?, range.end - range.start);
        if bytes.len() as u64 != length {
            let source = format!("{} bytes were received instead of {length}", bytes.len()).into();
            return Err(Error::Generic { store: "object", source });
        }
        let payload = GetResultPayload::Stream(stream::once(async { Ok(bytes) }).boxed());
        Ok(GetResult { payload, meta, range, attributes })
    }

    /// The keys after `last`, from a listing that resumes after the last received key where a request fails.
    fn resumable_list(
        &self,
        prefix: Option<&Path>,
        last: Option<&Path>,
    ) -> BoxStream<'static, Result<ObjectMeta>> {
        let (store, prefix) = (self.clone(), prefix.cloned());
        let list_after = move |store: &Self, last: Option<&Path>| match last {
            Some(last) => store.inner.list_with_offset(prefix.as_ref(), last),
            None => store.inner.list(prefix.as_ref()),
        };
        let first = (list_after(&store, last), last.cloned(), store.backoff());
        let next =
            move |(mut open, mut last, mut backoff): (BoxStream<'static, Result<ObjectMeta>>, _, Backoff)| {
                let (store, list_after) = (store.clone(), list_after.clone());
                async move {
                    loop {
                        match open.next().await.transpose() {
                            Ok(None) => return Ok(None),
                            Ok(Some(meta)) => {
                                last = Some(meta.location.clone());
                                return Ok(Some((meta, (open, last, store.backoff()))));
                            }
                            Err(error) => backoff.wait_after(error).await?,
                        }
                        open = list_after(&store, last.as_ref());
                    }
                }
            };
        stream::try_unfold(first, next).boxed()
    }
}

impl fmt::Display for RetryingStore {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "retrying {}", self.inner)
    }
}

#[async_trait]
impl ObjectStore for RetryingStore {
    async fn put_opts(&self, location: &Path, payload: PutPayload, options: PutOptions) -> Result<PutResult> {
        let is_new = options.mode == PutMode::Create;
        let put = self.with_retry(|| self.inner.put_opts(location, payload.clone(), options.clone())).await;
        match put {
            Err(error @ Error::AlreadyExists { .. }) if is_new => {
                let is_same = self.get(location).await?.bytes().await? == Bytes::from(payload);
                if is_same { Ok(PutResult { e_tag: None, version: None }) } else { Err(error) }
            }
            put => put,
        }
    }

    async fn put_multipart_opts(
        &self,
        location: &Path,
        options: PutMultipartOptions,
    ) -> Result<Box<dyn MultipartUpload>> {
        self.inner.put_multipart_opts(location, options).await
    }

    async fn get_opts(&self, location: &Path, options: GetOptions) -> Result<GetResult> {
        if options.range.is_none() && !options.head {
            return self.with_retry(|| self.without_range(location, options.clone())).await;
        }
        self.with_retry(|| self.complete_body(location, options.clone())).await
    }

    fn delete_stream(&self, locations: BoxStream<'static, Result<Path>>) -> BoxStream<'static, Result<Path>> {
        self.inner.delete_stream(locations)
    }

    fn list(&self, prefix: Option<&Path>) -> BoxStream<'static, Result<ObjectMeta>> {
        self.resumable_list(prefix, None)
    }

    fn list_with_offset(
        &self,
        prefix: Option<&Path>,
        offset: &Path,
    ) -> BoxStream<'static, Result<ObjectMeta>> {
        self.resumable_list(prefix, Some(offset))
    }

    async fn list_with_delimiter(&self, prefix: Option<&Path>) -> Result<ListResult> {
        self.with_retry(|| self.inner.list_with_delimiter(prefix)).await
    }

    async fn copy_opts(&self, from: &Path, to: &Path, options: CopyOptions) -> Result<()> {
        self.with_retry(|| self.inner.copy_opts(from, to, options.clone())).await
    }
}
