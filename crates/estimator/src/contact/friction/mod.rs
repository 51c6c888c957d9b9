//! The friction model and the force in the coupling.

pub(super) mod coupling_path;
pub(super) mod friction_model;
