//! Rows of assessments: trend of a unit, followed quantities, inspection intervals, tables of a report.

pub mod action;
pub mod crossing;
pub mod quantity_row;
pub mod report_rows;
pub mod statement;
pub mod trend_row;
pub mod unit_state;
