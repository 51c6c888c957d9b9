//! The `freeplay` command as its users type it, on the sample fleet, on logs of other machines, and on
//! logs that are damaged.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod accounts;
mod bench;
mod book;
mod damaged;
#[cfg(target_os = "linux")]
mod disk;
mod errors;
mod interrupted;
mod known;
mod layouts;
mod older;
mod oracle;
mod pages;
mod speech;
mod told;
mod truth;
