//! From the truth to a log: sensors, their dynamics and their faults.

pub(crate) mod sensor;

pub(crate) mod channel_sampler;
