//! The report: composition of its view model and publication of its folder.

pub mod compose;
pub mod publish;
