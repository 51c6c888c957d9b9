//! Panic capture: message and source location of a panic, for its diagnostic.

use std::any::Any;
use std::cell::RefCell;
use std::panic::{PanicHookInfo, set_hook, take_hook};
use std::sync::{Mutex, PoisonError};

thread_local! {
    /// Location of the latest panic of this thread.
    static LOCATION: RefCell<Option<String>> = const { RefCell::new(None) };
}

/// Location of the latest panic of any thread: a thread pool resumes a panic on another thread than its own.
static LATEST: Mutex<Option<String>> = Mutex::new(None);

/// Installs a panic hook that records where a panic occurs.
///
/// The default hook, which prints the panic, runs only if `RUST_BACKTRACE` is set.
pub fn install_hook() {
    let default = take_hook();
    set_hook(Box::new(move |info: &PanicHookInfo<'_>| {
        let location = info.location().map(|place| format!("{}:{}", place.file(), place.line()));
        LOCATION.with(|known| known.replace(location.clone()));
        *LATEST.lock().unwrap_or_else(PoisonError::into_inner) = location;
        if std::env::var_os("RUST_BACKTRACE").is_some_and(|value| value != "0") {
            default(info);
        }
    }));
}

/// Message and, with [`install_hook`], location of a caught panic: `index out of bounds (crates/a/src/b.rs:12)`.
pub fn describe(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().copied();
    let text = text.or_else(|| panic.downcast_ref::<String>().map(String::as_str)).unwrap_or("no message");
    let own = LOCATION.with(RefCell::take);
    let location = own.or_else(|| LATEST.lock().unwrap_or_else(PoisonError::into_inner).clone());
    location.map_or_else(|| text.to_owned(), |location| format!("{text} ({location})"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_names_its_message_and_its_line() {
        install_hook();
        let line = line!() + 1;
        let caught = std::panic::catch_unwind(|| panic!("broken {}", 7)).unwrap_err();
        let text = describe(caught.as_ref());
        assert!(text.starts_with("broken 7 (") && text.ends_with(&format!("panic.rs:{line})")), "{text}");
    }
}
