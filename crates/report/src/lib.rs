//! HTML report of a fleet: a fleet page, a page per part, per tail and per unit.
//!
//! A [`Report`] is rendered to [`Page`]s; this crate reads and writes no files and estimates nothing. Every
//! number is in the page as text; scripts only magnify. Templates escape every external string.

mod charts;
mod format;
mod model;
mod page;
mod pages;
mod peers;
mod removal_forecast;
mod state_badge;

pub use charts::estimate_plot::{EstimatePlot, estimate_plot_html, estimate_plot_svg, min_max_buckets};
pub use charts::frame::Frame;
pub use model::{Event, FleetPriorView, Quality, QuantityView, Report, UnitView};
pub use page::{Error, Page, assets, flight_path, unit_path};
pub use pages::fleet::fleet_pages;
pub use pages::part::part_pages;
pub use pages::tail::tail_page;
pub use pages::unit::unit_page;
pub use peers::Peers;
pub use removal_forecast::removal_forecast;
pub use state_badge::StateBadge;
