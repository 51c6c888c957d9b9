//! Public API: hostile names, missing data, and numbers that must be in the page.
#![expect(clippy::unwrap_used, reason = "a test may fail")]

use records::assessment::action::Action;
use records::report_rows::{ReportInspectionRow, ReportTailRow};
use records::row_schema::NoColumn;
use records::{TrendRow, WorkRequest};
use report::{Page, Peers, Report, UnitView, fleet_pages, part_pages, tail_page, unit_page, unit_path};

const HOSTILE: &str = "<script>alert(1)</script>";

fn unit(serial: &str, state: Option<&'static str>) -> UnitView {
    let row = TrendRow {
        part_number: Some("EMA".to_owned()),
        serial_number: serial.to_owned(),
        tail_number: Some(HOSTILE.to_owned()),
        position: Some("aileron".to_owned()),
        as_of_utc: "2026-11-19T23:41:00Z".parse().unwrap(),
        state,
        reason_code: Some("clear"),
        gap_m: state.map(|_| 118.04e-6),
        limit_m: state.map(|_| 150e-6),
        sketch_m: NoColumn(vec![40e-6, 50e-6, 60e-6]),
        ..TrendRow::default()
    };
    UnitView { row: row.with_action(Action::Replace), ..UnitView::default() }
}

fn report(units: Vec<UnitView>) -> Report {
    Report {
        made_utc: "2026-11-20T02:09:00Z".parse().unwrap(),
        program: "Freeplay".to_owned(),
        as_of_utc: Some("2026-11-19T23:41:00Z".parse().unwrap()),
        tails: vec![ReportTailRow { tail_number: HOSTILE.to_owned(), ..ReportTailRow::default() }],
        units,
        ..Report::default()
    }
}

fn text(page: &Page) -> String {
    String::from_utf8(page.body.clone()).unwrap()
}

fn index(report: &Report) -> String {
    let pages = fleet_pages(report, &Peers::of(report)).unwrap();
    pages.iter().find(|page| page.path == "index.html").map(text).unwrap()
}

fn unit_text(report: &Report, unit: usize) -> String {
    text(&unit_page(report, &Peers::of(report), &report.units[unit]).unwrap())
}

/// Content Security Policy Level 3: without `unsafe-inline` no script in a page's own text is executed.
#[test]
fn a_hostile_name_is_shown_and_not_run_and_no_page_allows_other_scripts() {
    let report = report(vec![unit(HOSTILE, Some("plan"))]);
    let peers = Peers::of(&report);
    let mut pages = fleet_pages(&report, &peers).unwrap();
    pages.push(unit_page(&report, &peers, &report.units[0]).unwrap());
    pages.push(tail_page(&report, &peers, &report.tails[0]).unwrap());
    pages.extend(part_pages(&report, &peers).unwrap());
    for page in &pages {
        let html = text(page);
        assert!(!html.contains("<script>"), "{}", page.path);
        assert!(html.contains("script&#62;"), "{} does not show the name", page.path);
        let (_, policy) = html.split_once("http-equiv=\"Content-Security-Policy\" content=\"").unwrap();
        let (policy, _) = policy.split_once('"').unwrap();
        assert!(policy.contains("default-src 'none'; script-src 'self';"), "{}: {policy}", page.path);
    }
}

#[test]
fn a_unit_without_a_statement_is_never_called_normal() {
    let mut unknown = unit("A", Some("unassessed"));
    unknown.row.gap_m = None;
    let html = unit_text(&report(vec![unknown]), 0);
    assert!(html.contains("unassessed") && html.contains("no data") && !html.contains("normal"));
}

/// Date, verdict, reason, chance, caveats and share of the limit: 118.04 of 150 µm is 78.7 %, by hand.
#[test]
fn the_fleet_page_says_what_to_do_until_when_and_why() {
    let mut soon = unit("A", Some("plan"));
    soon.row.position = Some("aileron_left".to_owned());
    soon.row.not_before_utc = Some("2026-12-24T00:00:00Z".parse().unwrap());
    soon.row.reason_code = Some("crosses_soon");
    soon.row.caveats = NoColumn(vec!["2 of 12 gaps are flagged".to_owned()]);
    soon.row = soon.row.with_action(Action::Replace);
    let mut gone = unit("C", None);
    gone.row.removed_utc = Some("2026-09-29T00:00:00Z".parse().unwrap());
    gone.row.gap_m = Some(106.1e-6);
    let report = report(vec![unit("B", Some("normal")), soon, gone]);
    let html = index(&report);
    let texts = [
        "1 inspect before 24 Dec · 1 fine",
        "Inspect aileron_left",
        "118.0 of 150.0\u{a0}µm",
        "5\u{a0}% by 24 Dec",
        "2 of 12 gaps are flagged",
        "79 %",
        "removed 29 Sep; last 106.1 µm",
    ];
    texts.iter().for_each(|text| assert!(html.contains(text), "{text}: {html}"));
    assert!(html.contains(&unit_path(&report.units[1])));
    assert!(unit_text(&report, 1).contains("2 of 12 gaps are flagged"));
    let calm = index(&self::report(vec![unit("B", Some("normal"))]));
    assert!(calm.contains("No assessed unit needs action.") && calm.contains("1 fine"), "{calm}");
}

/// One unit had another state yesterday, one had none since it had no gap, and one had the same.
#[test]
fn what_is_new_is_a_change_or_a_first_assessment() {
    let mut worse = unit("A", Some("plan"));
    worse.state_day_before = Some(Some("watch".to_owned()));
    let mut same = unit("C", Some("normal"));
    same.state_day_before = Some(Some("normal".to_owned()));
    let html = index(&report(vec![worse, unit("B", Some("normal")), same]));
    let (_, news) = html.split_once("New since yesterday").unwrap();
    let (news, _) = news.split_once("</p>").unwrap();
    assert!(news.contains("watch → plan") && news.contains("first assessment: normal"), "{news}");
    assert_eq!(news.matches("<a ").count(), 2);
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
        opened_utc: "2026-11-01T04:13:00Z".parse().unwrap(),
        by: Some(HOSTILE.to_owned()),
        reason: Some(HOSTILE.to_owned()),
        until_utc: Some("2027-01-31T00:00:00Z".parse().unwrap()),
        changed_utc: "2026-11-02T00:00:00Z".parse().unwrap(),
        ..WorkRequest::default()
    };
    let mut normal = unit("A", Some("normal"));
    normal.work_requests = vec![opened("W3", "closed"), opened("W8", "deferred")];
    let report = report(vec![normal, unit("B", Some("normal"))]);
    let deferred = "W8 deferred to <span class=\"d\">2027-01-31</span>";
    let index = index(&report);
    assert!(index.contains(deferred) && !index.contains("W3"), "{index}");
    let html = unit_text(&report, 0);
    assert!(html.contains("W3") && html.contains(deferred), "{html}");
    assert!(!html.contains("<script>"));
    assert!(!unit_text(&report, 1).contains("ork request"));
}

/// Differences of 1, 2 and 3 µm: mean 2, standard deviation 1, half of the 90 % interval 1.645/√3, by hand.
#[test]
fn three_inspections_state_a_bias_and_two_do_not() {
    let check = |um: f64| ReportInspectionRow {
        play_m: 50e-6,
        estimate_m: Some(50e-6 + 1e-6 * um),
        ..ReportInspectionRow::default()
    };
    for (differences, words) in [(&[1.0, 2.0, 3.0][..], "3 pairs: 2.0 ± 0.9 µm"), (&[0.0, 0.0], "at least 3")]
    {
        let inspections = differences.iter().map(|um| check(*um)).collect();
        let checked = UnitView { inspections, ..unit("A", Some("normal")) };
        let html = index(&Report { inspections_given: true, ..report(vec![checked]) });
        assert!(html.contains(words), "{html}");
    }
}

#[test]
fn a_large_fleet_is_split_and_every_unit_keeps_a_link() {
    let units: Vec<UnitView> = (0..350).map(|k| unit(&format!("S{k:04}"), Some("plan"))).collect();
    let report = report(units);
    let pages = fleet_pages(&report, &Peers::of(&report)).unwrap();
    assert_eq!(pages.iter().filter(|p| p.path.starts_with("work-")).count(), 4);
    let all: String =
        pages.iter().filter(|p| p.path.starts_with("work-") || p.path == "index.html").map(text).collect();
    assert!(report.units.iter().all(|u| all.contains(&unit_path(u))));
}
