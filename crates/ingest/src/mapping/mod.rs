//! Log mapping: columns, clock and identity of a log as configured in `pipeline.toml`.

pub mod column_pattern;
pub(crate) mod field_metadata;
mod log_mapping;
mod sample_filter;
pub mod units;

pub use log_mapping::{
    ChannelMapping, Channels, ClockMapping, Epoch, GroupMapping, IdentityField, IdentityMapping, Layout,
    Mapping, Output, Role, TailAlias,
};
pub use sample_filter::{RawValue, SampleFilter};
