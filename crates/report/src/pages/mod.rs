//! The HTML pages of a report, one module per kind of page.

pub(crate) mod fleet;
pub(crate) mod part;
pub(crate) mod quantities;
pub(crate) mod tail;
pub(crate) mod unit;
pub(crate) mod work_list;
