//! What follows from a run: alerts, work requests, and the dashboards of its metrics.

mod alerts;
mod dashboards;
mod work;
