//! The report: composition of its view model, plots of single flights, its tables, and publication of its folder.

pub mod compose;
pub mod data;
mod flight_columns;
pub mod flight_plots;
pub mod publish;
