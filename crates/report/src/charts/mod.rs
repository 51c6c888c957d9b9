//! Static plots (SVG, HTML).

pub(crate) mod agreement_plot;
pub(crate) mod axes;
pub(crate) mod estimate_plot;
pub(crate) mod history;
pub(crate) mod quantities;
pub(crate) mod small_multiple;
pub(crate) mod sparkline;
