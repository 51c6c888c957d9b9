//! One module per command: arguments in, library call, text or rows out.

pub(crate) mod context;
pub(crate) mod logs;
pub(crate) mod results;
pub(crate) mod run;
pub(crate) mod setup;
pub(crate) mod store;
pub(crate) mod work;
