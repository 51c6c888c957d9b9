//! The same work on many things, by whoever has threads: this crate has none.

/// Does one piece of work on each of some things.
///
/// Results stand in the order of the things, so that who does the work, and when, moves no bit.
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
