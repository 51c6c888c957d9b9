//! Scratch memory of the contact regression.

use crate::contact::blocks::block_means::BlockMeans;
use crate::contact::friction::friction_model::Coupling;

/// Scratch memory of a regression, reused from flight to flight.
#[derive(Debug, Default)]
pub struct ContactWorkspace {
    pub(crate) whole: BlockMeans,
    pub(crate) excerpt: BlockMeans,
    pub(crate) couplings: Vec<Coupling>,
}
