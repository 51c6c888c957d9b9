//! Rows of assessments: trend of a unit, followed quantities, inspection intervals, tables of a report.

pub mod action;
pub(crate) mod quantity_row;
pub mod report_rows;
pub(crate) mod statement;
pub(crate) mod trend_row;
pub(crate) mod unit_state;
