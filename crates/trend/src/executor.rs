//! Executor: applies one function to many items, on the caller's threads. This crate has none of its own.

/// Applies one function to many items.
pub trait Executor {
    /// The results, in the order of the items, so that the assignment of items to threads changes none of them.
    fn map<T: Sync, R: Send>(&self, items: &[T], work: impl Fn(&T) -> R + Send + Sync) -> Vec<R>;
}

/// One item after the other, on the caller's thread.
#[derive(Debug, Clone, Copy, Default)]
pub struct SerialExecutor;

impl Executor for SerialExecutor {
    fn map<T: Sync, R: Send>(&self, items: &[T], work: impl Fn(&T) -> R + Send + Sync) -> Vec<R> {
        items.iter().map(work).collect()
    }
}
