//! Quantities other than the gap, followed per unit: what changed, by how much, and whose change it is.
//!
//! ```text
//! records ─values→ series of units ─follow→ steps and drift ─attribution→ unit, tail or part ─→ rows and changes
//! ```

pub mod attribution;
pub mod follow;
pub mod limits;
pub(crate) mod peers;
pub mod subject;
pub mod values;
