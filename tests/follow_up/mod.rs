//! What follows from a run: alerts, work requests, and the dashboards of its metrics.

use std::sync::OnceLock;

use crate::harness::{TestFleet, copy};

/// A copy of the small fleet with the results of all its logs.
fn processed_fleet() -> TestFleet {
    static PROCESSED: OnceLock<TestFleet> = OnceLock::new();
    let processed = PROCESSED.get_or_init(|| {
        let fleet = TestFleet::sample();
        // No unit needs attention within one hour.
        fleet.configure(LONG_HORIZON, SHORT_HORIZON);
        fleet.run_ok(&["run", "--quiet"]);
        fleet
    });
    let fleet = TestFleet::empty();
    copy(&processed.path(""), &fleet.path(""));
    fleet
}

/// Two units could reach their limit within 500 hours, none within one (README).
const LONG_HORIZON: &str = "planning_horizon_hours = 500.0";
const SHORT_HORIZON: &str = "planning_horizon_hours = 1.0";

mod alerts;
mod dashboards;
mod same_story;
mod work;
