//! Single logs and records under the eye of a person: check, estimate, explain, normalize, simulate, and comparison of
//! stores.

pub mod check;
pub mod estimate;
pub mod explain;
pub mod normalize;
pub mod simulate;
pub mod store_diff;
