//! Rows of assessments: trend of a unit, followed quantities, inspection intervals, tables of a report.

pub mod action;
pub(crate) mod quantity_row;
pub mod report_rows;
pub(crate) mod statement;
pub(crate) mod trend_row;
pub(crate) mod unit_state;

/// The unit that a row is about.
macro_rules! rows_of_units {
    ($($row:ty),*) => {$(
        impl $row {
            /// Part number, if known, and serial number.
            pub fn unit(&self) -> (Option<String>, String) {
                (self.part_number.clone(), self.serial_number.clone())
            }
        }
    )*};
}
rows_of_units!(crate::QuantityRow, crate::TrendRow, crate::UnitState, crate::WorkRequest);
