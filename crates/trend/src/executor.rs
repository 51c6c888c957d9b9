//! Executor: applies one function to many items, on the caller's threads. This crate has none of its own.

/// Does one piece of work on each of some things.
///
/// Results are in the order of the items, so the assignment of items to threads does not change them.
pub trait Executor {
    /// The result for each thing, in their order.
    fn map<T: Sync, R: Send>(&self, things: &[T], work: impl Fn(&T) -> R + Send + Sync) -> Vec<R>;
}

/// One thing after the other.
#[derive(Debug, Clone, Copy, Default)]
pub struct SerialExecutor;

impl Executor for SerialExecutor {
    fn map<T: Sync, R: Send>(&self, things: &[T], work: impl Fn(&T) -> R + Send + Sync) -> Vec<R> {
        things.iter().map(work).collect()
    }
}
