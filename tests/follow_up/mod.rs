//! What follows from a run: alerts and work requests.

use std::sync::OnceLock;

use crate::harness::TestFleet;

/// A copy of the small fleet with the results of all its logs.
fn processed_fleet() -> TestFleet {
    static PROCESSED: OnceLock<TestFleet> = OnceLock::new();
    TestFleet::once(&PROCESSED, || {
        let fleet = TestFleet::sample();
        // No unit needs attention within one hour.
        fleet.configure(LONG_HORIZON, SHORT_HORIZON);
        fleet.run_ok(&["run", "--quiet"]);
        fleet
    })
}

/// Two units could reach their limit within 500 hours, none within one (README).
const LONG_HORIZON: &str = "planning_horizon_hours = 500.0";
const SHORT_HORIZON: &str = "planning_horizon_hours = 1.0";

mod alerts;
mod same_story;
