//! Rows of assessments: trend of a unit, followed quantities, inspection intervals.

pub mod action;
pub mod quantity_row;
pub mod trend_row;
