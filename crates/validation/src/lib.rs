//! The accuracy study: flights of known gap, the methods compared, and how far each is from the truth.
//!
//! [`scenarios::classes`] lists classes of flights, each with one assumption of the estimator broken;
//! `scenarios::Class::fly` draws and flies a flight from a class and an index.
//!
//! `simulator` shares no equation with `estimator`, so neither can flatter the other.

pub mod accuracy_page;
mod drawing;
pub mod gear_bench;
pub mod methods;
pub mod metrics;
pub mod paper;
pub mod plots;
pub mod robot_logs;
pub mod scenarios;

pub use drawing::Drawn;
