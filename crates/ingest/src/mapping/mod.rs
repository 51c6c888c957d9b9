//! Log mapping: what `pipeline.toml` says about the columns, clock and identity of a log.

pub mod column_pattern;
mod log_mapping;
mod sample_filter;
pub mod units;

pub use log_mapping::{
    ChannelMapping, Channels, ClockMapping, Epoch, GroupMapping, IdentityField, IdentityMapping, Layout,
    Mapping, Output, Role,
};
pub use sample_filter::SampleFilter;
