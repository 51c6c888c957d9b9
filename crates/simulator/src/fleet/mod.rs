//! A fleet: its specification, its calendar with the truth, and its flights.

pub(crate) mod fleet_events;
pub(crate) mod fleet_plan;
pub(crate) mod fleet_spec;
pub(crate) mod wear;

mod fleet_planner;
