//! A flight in blocks: means of whole samples, without missing ones and spikes.

pub(super) mod block_means;
