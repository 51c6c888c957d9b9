//! A store that is asked again: whole answers, or an error after all patience.
//!
//! The library's own clients try again until an answer's first line; a body that breaks off after it, or is
//! shorter than its own head says, they hand on. Here a body is read whole and measured before anybody sees it,
//! a listing goes on behind the last key that came, and a name that is taken is compared with what was to be
//! written under it: the answer to a write that had arrived may have been lost.

use std::fmt;
use std::future::Future;
use std::ops::Range;
use std::sync::Arc;
use std::time::{Duration, Instant};

use async_trait::async_trait;
use bytes::Bytes;
use futures::stream::BoxStream;
use futures::{FutureExt, StreamExt, stream};
use object_store::path::Path;
use object_store::{
    CopyOptions, Error, GetOptions, GetRange, GetResult, GetResultPayload, ListResult, MultipartUpload,
    ObjectMeta, ObjectStore, ObjectStoreExt, PutMode, PutMultipartOptions, PutOptions, PutPayload, PutResult,
    Result,
};

/// The first pause; it doubles.
const PAUSE: Duration = Duration::from_millis(100);
const LONGEST_PAUSE: Duration = Duration::from_secs(15);

/// A store, and for how long it is asked again.
#[derive(Debug, Clone)]
pub(crate) struct Patient {
    inner: Arc<dyn ObjectStore>,
    give_up: Duration,
}

/// How long something was tried, and when it is tried again.
struct Patience {
    begun: Instant,
    pause: Duration,
    give_up: Duration,
}

impl Patience {
    /// Waits before the next attempt; hands the error back when it would not help, or time is up.
    async fn after(&mut self, error: Error) -> Result<()> {
        let is_passing = matches!(error, Error::Generic { .. } | Error::JoinError { .. });
        if !is_passing || self.begun.elapsed() + self.pause > self.give_up {
            return Err(error);
        }
        tokio::time::sleep(self.pause).await;
        self.pause = (self.pause * 2).min(LONGEST_PAUSE);
        Ok(())
    }
}

impl Patient {
    pub(crate) fn new(inner: Arc<dyn ObjectStore>, give_up: Duration) -> Self {
        Self { inner, give_up }
    }

    fn patience(&self) -> Patience {
        Patience { begun: Instant::now(), pause: PAUSE, give_up: self.give_up }
    }

    /// Asks until there is an answer, or no patience left.
    async fn again<T, F: Future<Output = Result<T>>>(&self, mut ask: impl FnMut() -> F) -> Result<T> {
        let mut patience = self.patience();
        loop {
            match ask().await {
                Ok(answer) => return Ok(answer),
                Err(error) => patience.after(error).await?,
            }
        }
    }

    /// An object from its first byte on: as a range, since only a range's answer tells how long the whole is,
    /// and a body cut short together with its own length would pass for the object.
    async fn without_range(&self, location: &Path, options: GetOptions) -> Result<GetResult> {
        let ranged = GetOptions { range: Some(GetRange::Offset(0)), ..options.clone() };
        match self.whole(location, ranged).await {
            // An empty object has no range.
            Err(error @ Error::Generic { .. }) => match self.inner.head(location).await {
                Ok(meta) if meta.size == 0 => self.whole(location, options).await,
                _ => Err(error),
            },
            answer => answer,
        }
    }

    /// One answer with its whole body.
    async fn whole(&self, location: &Path, options: GetOptions) -> Result<GetResult> {
        let is_head = options.head;
        let answer = self.inner.get_opts(location, options).await?;
        if is_head {
            return Ok(answer);
        }
        let (meta, range, attributes) =
            (answer.meta.clone(), answer.range.clone(), answer.attributes.clone());
        let bytes = measured(answer.bytes().await?, &range)?;
        let payload = GetResultPayload::Stream(stream::once(async { Ok(bytes) }).boxed());
        Ok(GetResult { payload, meta, range, attributes })
    }

    /// Whether an object holds just this.
    async fn holds(&self, location: &Path, payload: &PutPayload) -> Result<bool> {
        let there = self.get(location).await?.bytes().await?;
        Ok(there.len() == payload.content_length() && there == Bytes::from(payload.clone()))
    }

    /// What is left of a listing, behind a key.
    fn rest(&self, prefix: Option<&Path>, last: Option<&Path>) -> BoxStream<'static, Result<ObjectMeta>> {
        match last {
            Some(last) => self.inner.list_with_offset(prefix, last),
            None => self.inner.list(prefix),
        }
    }
}

fn measured(bytes: Bytes, range: &Range<u64>) -> Result<Bytes> {
    if bytes.len() as u64 == range.end - range.start {
        return Ok(bytes);
    }
    let source = format!("{} bytes came where {} were told of", bytes.len(), range.end - range.start);
    Err(Error::Generic { store: "object", source: source.into() })
}

impl fmt::Display for Patient {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "patient {}", self.inner)
    }
}

#[async_trait]
impl ObjectStore for Patient {
    async fn put_opts(&self, location: &Path, payload: PutPayload, options: PutOptions) -> Result<PutResult> {
        let is_new = options.mode == PutMode::Create;
        let put = self.again(|| self.inner.put_opts(location, payload.clone(), options.clone())).await;
        match put {
            Err(Error::AlreadyExists { .. }) if is_new && self.holds(location, &payload).await? => {
                Ok(PutResult { e_tag: None, version: None })
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
            return self.again(|| self.without_range(location, options.clone())).await;
        }
        self.again(|| self.whole(location, options.clone())).await
    }

    fn delete_stream(&self, locations: BoxStream<'static, Result<Path>>) -> BoxStream<'static, Result<Path>> {
        self.inner.delete_stream(locations)
    }

    fn list(&self, prefix: Option<&Path>) -> BoxStream<'static, Result<ObjectMeta>> {
        self.listed(prefix.cloned(), None)
    }

    fn list_with_offset(
        &self,
        prefix: Option<&Path>,
        offset: &Path,
    ) -> BoxStream<'static, Result<ObjectMeta>> {
        self.listed(prefix.cloned(), Some(offset.clone()))
    }

    async fn list_with_delimiter(&self, prefix: Option<&Path>) -> Result<ListResult> {
        self.again(|| self.inner.list_with_delimiter(prefix)).await
    }

    async fn copy_opts(&self, from: &Path, to: &Path, options: CopyOptions) -> Result<()> {
        self.again(|| self.inner.copy_opts(from, to, options.clone())).await
    }
}

/// A listing under way.
struct Listing {
    store: Patient,
    prefix: Option<Path>,
    last: Option<Path>,
    open: BoxStream<'static, Result<ObjectMeta>>,
    patience: Patience,
    has_failed: bool,
}

impl Listing {
    async fn next(mut self) -> Option<(Result<ObjectMeta>, Self)> {
        while !self.has_failed {
            match self.open.next().await? {
                Ok(meta) => {
                    self.last = Some(meta.location.clone());
                    self.patience = self.store.patience();
                    return Some((Ok(meta), self));
                }
                Err(error) => match self.patience.after(error).await {
                    Ok(()) => self.open = self.store.rest(self.prefix.as_ref(), self.last.as_ref()),
                    Err(error) => {
                        self.has_failed = true;
                        return Some((Err(error), self));
                    }
                },
            }
        }
        None
    }
}

impl Patient {
    fn listed(&self, prefix: Option<Path>, last: Option<Path>) -> BoxStream<'static, Result<ObjectMeta>> {
        let (open, patience) = (self.rest(prefix.as_ref(), last.as_ref()), self.patience());
        let listing = Listing { store: self.clone(), prefix, last, open, patience, has_failed: false };
        stream::unfold(listing, |listing| listing.next().boxed()).boxed()
    }
}
