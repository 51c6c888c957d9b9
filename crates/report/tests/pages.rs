//! Public API: hostile names, missing data, and numbers that must be in the page.
#![expect(clippy::unwrap_used, reason = "a test may fail")]

use records::WorkRequest;
use report::{
    Assessment, RateSpreads, Report, Tail, UnitView, fleet_pages, part_pages, tail_page, unit_page, unit_path,
};

const HOSTILE: &str = "<script>alert(1)</script>";

fn unit(serial: &str, state: Option<&str>) -> UnitView {
    UnitView {
        part_number: Some("EMA".to_owned()),
        serial_number: serial.to_owned(),
        tail_number: Some(HOSTILE.to_owned()),
        position: Some("aileron".to_owned()),
        assessment: Assessment {
            state: state.map(str::to_owned),
            gap_m: state.map(|_| 118.04e-6),
            limit_m: state.map(|_| 150e-6),
            ..Assessment::default()
        },
        sketch_m: vec![40e-6, 50e-6, 60e-6],
        ..UnitView::default()
    }
}

fn report(units: Vec<UnitView>) -> Report {
    Report {
        made_utc: "2026-11-20T02:09:00Z".parse().unwrap(),
        program: "Freeplay".to_owned(),
        as_of_utc: Some("2026-11-19T23:41:00Z".parse().unwrap()),
        check_interval_hours: 300.0,
        tails: vec![Tail { tail_number: HOSTILE.to_owned(), ..Tail::default() }],
        units,
        ..Report::default()
    }
}

fn text(page: &report::Page) -> String {
    String::from_utf8(page.body.clone()).unwrap()
}

#[test]
fn a_hostile_name_is_shown_and_not_run() {
    let report = report(vec![unit(HOSTILE, Some("plan"))]);
    let mut pages = fleet_pages(&report).unwrap();
    pages.push(unit_page(&report, &RateSpreads::of(&report), &report.units[0]).unwrap());
    pages.push(tail_page(&report, &report.tails[0]).unwrap());
    pages.extend(part_pages(&report).unwrap());
    for page in &pages {
        let html = text(page);
        assert!(!html.contains("<script>"), "{}", page.path);
        assert!(html.contains("script&#62;"), "{} does not show the name", page.path);
    }
}

/// Content Security Policy Level 3: without `unsafe-inline` no script in a page's own text is executed.
#[test]
fn every_page_forbids_scripts_that_are_not_files_of_the_report() {
    let report = report(vec![unit("1040-0009", Some("plan"))]);
    let mut pages = fleet_pages(&report).unwrap();
    pages.push(unit_page(&report, &RateSpreads::of(&report), &report.units[0]).unwrap());
    pages.push(tail_page(&report, &report.tails[0]).unwrap());
    pages.extend(part_pages(&report).unwrap());
    for page in &pages {
        let html = text(page);
        let (_, policy) = html.split_once("http-equiv=\"Content-Security-Policy\" content=\"").unwrap();
        let (policy, _) = policy.split_once('"').unwrap();
        assert!(policy.contains("default-src 'none'; script-src 'self';"), "{}: {policy}", page.path);
    }
}

#[test]
fn a_unit_without_a_statement_is_never_called_normal() {
    let report = report(vec![unit("A", Some("unassessed"))]);
    let html = text(&unit_page(&report, &RateSpreads::of(&report), &report.units[0]).unwrap());
    assert!(html.contains("unassessed") && html.contains("no data") && !html.contains("normal"));
}

#[test]
fn the_fleet_page_opens_with_what_to_do_first() {
    let mut soon = unit("A", Some("plan"));
    soon.assessment.action_text = Some("inspect before 2026-12-24".to_owned());
    soon.position = Some("aileron_left".to_owned());
    let report = report(vec![unit("B", Some("normal")), soon]);
    let index = text(fleet_pages(&report).unwrap().iter().find(|p| p.path == "index.html").unwrap());
    assert!(
        index.contains("aileron_left (EMA / A): inspect before <span class=\"d\">2026-12-24.</span> In all: 1 plan, 1 normal."),
        "{index}"
    );
    let calm = self::report(vec![unit("B", Some("normal"))]);
    let index = text(fleet_pages(&calm).unwrap().iter().find(|p| p.path == "index.html").unwrap());
    assert!(index.contains("No unit needs action: 1 normal."), "{index}");
}

#[test]
fn the_gap_and_its_share_of_the_limit_stand_in_the_page_as_text() {
    let report = report(vec![unit("A", Some("watch"))]);
    let pages = fleet_pages(&report).unwrap();
    let index = pages.iter().find(|p| p.path == "index.html").map(text).unwrap();
    // 118.04 of 150 µm is 78.7 %, by hand.
    assert!(index.contains("118.0 µm") && index.contains("79 %"), "{index}");
    assert!(index.contains(&unit_path(&report.units[0])));
}

/// A unit whose state is normal again keeps its place until its request is closed.
#[test]
fn an_open_request_is_on_the_work_list_and_on_the_page_of_its_unit() {
    let opened = |id: &str, status: &'static str| WorkRequest {
        request_id: id.to_owned(),
        status,
        state: Some("normal".to_owned()),
        part_number: Some("EMA".to_owned()),
        serial_number: "A".to_owned(),
        tail_number: Some("N1".to_owned()),
        position: Some(HOSTILE.to_owned()),
        quantity: "gap".to_owned(),
        finding: None,
        opened_utc: "2026-11-01T04:13:00Z".parse().unwrap(),
        by: Some(HOSTILE.to_owned()),
        reason: Some(HOSTILE.to_owned()),
        until_utc: Some("2027-01-31T00:00:00Z".parse().unwrap()),
        changed_utc: "2026-11-02T00:00:00Z".parse().unwrap(),
        closed_by: None,
        closed_utc: None,
    };
    let mut normal = unit("A", Some("normal"));
    normal.work_requests = vec![opened("W3", "closed"), opened("W8", "deferred")];
    let report = report(vec![normal, unit("B", Some("normal"))]);
    let index = fleet_pages(&report).unwrap().iter().find(|p| p.path == "index.html").map(text).unwrap();
    assert!(index.contains("W8 deferred to 2027-01-31") && !index.contains("W3"), "{index}");
    let html = text(&unit_page(&report, &RateSpreads::of(&report), &report.units[0]).unwrap());
    assert!(html.contains("W3") && html.contains("W8") && html.contains("deferred to 2027-01-31"), "{html}");
    assert!(!html.contains("<script>"));
    let other = text(&unit_page(&report, &RateSpreads::of(&report), &report.units[1]).unwrap());
    assert!(!other.contains("Work request"), "{other}");
}

#[test]
fn a_large_fleet_is_split_and_every_unit_keeps_a_link() {
    let units: Vec<UnitView> = (0..350).map(|k| unit(&format!("S{k:04}"), Some("plan"))).collect();
    let report = report(units);
    let pages = fleet_pages(&report).unwrap();
    assert_eq!(pages.iter().filter(|p| p.path.starts_with("work-")).count(), 4);
    let all: String =
        pages.iter().filter(|p| p.path.starts_with("work-") || p.path == "index.html").map(text).collect();
    assert!(report.units.iter().all(|u| all.contains(&unit_path(u))));
}
