//! Runs after runs: a second log of a flight changes no record.

use crate::harness::{TestFleet, facts, rewrite};

/// Two recordings of one flight: the one whose name sorts first is used, and the other is named, also where two recorders
/// write the flight id differently. The summary does not depend on the worker that was faster.
#[test]
fn a_rival_log_of_the_same_flight_is_in_error_whichever_is_read_first() {
    let mut summaries = Vec::new();
    for (jobs, flight_id) in [("1", None), ("2", None), ("1", Some("412-4"))] {
        let fleet = TestFleet::sample();
        let logs = fleet.logs();
        let mut truth = facts(&logs[3]);
        truth.extend(flight_id.map(|id| ("flight_id".to_owned(), id.to_owned())));
        rewrite(&logs[4], &logs[3].with_file_name("z_rival.parquet"), &truth, |_| true, |_| true);
        let result = fleet.freeplay(&["run", "--json", "--jobs", jobs]);
        assert_eq!(result.code, Some(1), "{result:?}");
        let summary = result.json();
        let counts = ["found", "known", "done", "flights", "estimated", "refused"];
        summaries.push(counts.map(|count| summary[count].to_string()));
        assert!(result.err.contains("error[duplicate_flight]"), "{}", result.err);
        assert!(result.err.contains("z_rival.parquet"), "{}", result.err);
        let plain = TestFleet::processed();
        assert_eq!(fleet.exported(), plain.exported());
    }
    assert_eq!(summaries[0], summaries[1]);
}
