//! Wear laws, the bank of candidate curves made of them, and the components that fits leave.

pub(crate) mod bank;
pub(crate) mod component;
