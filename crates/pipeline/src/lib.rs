//! A night's work: which logs are new, one flight per worker, every finished flight stored, and an
//! account of all of them.
//!
//! The only crate that knows rayon. It prints nothing: it reports [`Event`]s and returns a
//! [`Report`]. Results depend on neither the number of workers nor the order in which they finish.

pub mod account;
pub mod adhoc;
pub mod backtest;
mod book;
mod budget;
pub mod bundle;
mod calendar;
pub mod changed;
pub mod elsewhere;
pub mod estimates;
pub mod event;
mod flown;
mod gathering;
pub mod histories;
pub mod innovations;
mod joined;
pub mod lately;
mod limits;
pub mod maintenance;
pub mod normalize;
pub mod pages;
mod parts;
pub mod plan;
pub mod recorder;
mod remote;
pub mod report;
pub mod rows;
pub mod schedule;
mod seats;
mod shelf;
pub mod simulate;
pub mod statement;
mod stays;
mod tail_wide;
mod taught;
pub mod trends;
mod unlogged;
mod usage;

mod error;

pub use account::Report;
pub use error::Error;
pub use event::Event;
pub use plan::{Plan, Request, Why};
pub use schedule::run;
