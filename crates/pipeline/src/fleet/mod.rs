//! The fleet as it is stored, with the bookkeeping joined: flights of each unit by departure, also from external tables.

pub mod bookkeeping;
pub(crate) mod builder;
pub mod external_estimates;
pub mod flight_row;
pub mod histories;
pub(crate) mod unit_rows;
