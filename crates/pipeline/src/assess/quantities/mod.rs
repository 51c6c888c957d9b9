//! Quantities other than the gap, followed per unit: what changed, by how much, and whose change it is.
//!
//! ```text
//! records ─values→ series of units ─follow→ steps and drift ─attribution→ unit, tail or part ─rows→ rows and changes
//! ```

mod attribution;
pub mod follow;
mod limits;
pub(crate) mod peers;
pub(crate) mod rows;
pub(crate) mod subject;
pub(crate) mod values;
