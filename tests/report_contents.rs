//! Optional contents of a report: diagnostic plots and tables; and the pages of parts.

use std::collections::BTreeSet;

use crate::harness::TestFleet;

/// Addresses of the links in a page that contain a word.
fn links<'a>(html: &'a str, word: &str) -> Vec<&'a str> {
    let addresses = html.split("href=\"").skip(1).filter_map(|rest| rest.split('"').next());
    addresses.filter(|address| address.contains(word)).collect()
}

#[test]
fn a_flight_leads_to_its_diagnostic_plot() {
    let fleet = TestFleet::sample();
    fleet.run_ok(&["run", "--tail", "N414FP", "--quiet"]);
    let serial = ["report", "-o", "pages", "--serial", "1040-0013", "--diagnostics", "2"];
    fleet.run_ok(&serial);
    let unit = fleet.read("pages/serial/unit-EMA-27-1040_1040-0013.html");
    let plots: BTreeSet<&str> = links(&unit, "flight/").into_iter().collect();
    assert_eq!(plots.len(), 2, "{plots:?}");
    let queried = fleet.rows(&["query", "serial", "1040-0013", "--last", "2"]);
    for record in &queried {
        let departure = record["departure_utc"].as_str().unwrap().replace(['-', ':'], "");
        let plot = plots.iter().find(|plot| plot.contains(&departure[..15])).unwrap();
        let page = fleet.read(&format!("pages/serial/{plot}"));
        let gap_um = record["gap_m"].as_f64().unwrap() * 1e6;
        assert!(page.contains(&format!("gap {gap_um:.1} µm")), "{departure}");
        assert_eq!(links(&page, "serial/"), ["../serial/unit-EMA-27-1040_1040-0013.html"]);
    }
    // Another log in its place, and a log that is gone, are errors of their own; the report is there without the plot.
    let [other, log] = [0, 1].map(|k| fleet.path(queried[k]["log_path"].as_str().unwrap()));
    let facts = crate::harness::facts(&log);
    crate::harness::rewrite(&other, &log, &facts, |_| true, |_| true);
    for code in ["log_changed", "unreadable"] {
        let result = fleet.freeplay(&serial);
        assert_eq!(result.code, Some(1), "{result:?}");
        let name = queried[1]["log_path"].as_str().unwrap();
        assert!(
            result.err.contains(&format!("error[{code}]")) && result.err.contains(name),
            "{}",
            result.err
        );
        let unit = fleet.read("pages/serial/unit-EMA-27-1040_1040-0013.html");
        assert_eq!(links(&unit, "flight/").into_iter().collect::<BTreeSet<_>>().len(), 1);
        let _ = std::fs::remove_file(&log);
    }
    // Without the option no log is read.
    fleet.run_ok(&serial[..5]);
    assert!(links(&fleet.read("pages/serial/unit-EMA-27-1040_1040-0013.html"), "flight/").is_empty());
    assert!(!fleet.path("pages/flight").exists());
}

#[test]
fn every_unit_is_on_the_page_of_its_part_once() {
    let fleet = TestFleet::processed();
    fleet.run_ok(&["report", "-o", "pages", "--data"]);
    let report = fleet.read_json("pages/report.json");
    let units = report["units"].as_array().unwrap();
    let mut shown = Vec::new();
    for part in ["EMA-27-1040", "EMA-27-1060"] {
        let page = fleet.read(&format!("pages/part/part-{part}.html"));
        let of_part = units.iter().filter(|unit| unit["part_number"] == part).count();
        assert_eq!(links(&page, "serial/").len(), of_part, "{part}");
        assert_eq!(page.matches("class=\"spark\"").count(), of_part, "{part}");
        shown.extend(links(&page, "serial/").into_iter().map(str::to_owned));
    }
    assert_eq!(shown.iter().collect::<BTreeSet<_>>().len(), units.len());
    assert_eq!(links(&fleet.read("pages/index.html"), "part/").len(), 2);
    let tables: BTreeSet<String> = std::fs::read_dir(fleet.path("pages/data"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    assert_eq!(tables.len(), 11, "{tables:?}");
}
