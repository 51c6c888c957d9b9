//! Static pictures (SVG, HTML).

pub(crate) mod estimate_plot;
pub(crate) mod frame;
pub(crate) mod history;
pub(crate) mod quantities;
