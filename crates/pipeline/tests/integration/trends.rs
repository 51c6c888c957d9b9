//! Statements about a small fleet whose wear is a line: 2 h a day, 20 µm when new, limit 150 µm.

use std::collections::BTreeSet;
use std::path::Path;

use jiff::{SignedDuration, Timestamp};
use job::Config;
use pipeline::assess::backtest;
use pipeline::assess::changes::{Cause, RunFacts, changes};
use pipeline::assess::trends::{self, UnitSelection};
use records::{GapRecord, Installation, Installations, PartNumber, Position, TailNumber, TrendRow};
use store::Store;

use crate::fleet::{self, config, day};

const DAY: SignedDuration = SignedDuration::from_hours(24);
const HOURS_A_DAY: f64 = 2.0;

fn store(folder: &Path, rows: &[GapRecord]) -> Store {
    let results: Vec<_> = rows.iter().map(|row| fleet::result(vec![row.clone()])).collect();
    fleet::store(folder, &results)
}

/// Fourteen units, the nth of which wears by 15 + n µm in 1,000 h.
fn flown(days: i32) -> Vec<GapRecord> {
    let flight = |unit: i32, at: i32| {
        fleet::worn(unit, at, &format!("place_{unit}"), [15.0 + f64::from(unit), HOURS_A_DAY, HOURS_A_DAY])
    };
    (0..14).flat_map(|unit| (0..days).map(move |at| flight(unit, at))).collect()
}

/// The installation of a unit of [`flown`].
fn installation(unit: i32, removed_utc: Option<Timestamp>) -> Installation {
    let names = [&*format!("T{unit:02}"), &format!("place_{unit}"), "EMA-27-1040", &format!("S{unit:02}")];
    fleet::installation(names, day(-1), removed_utc)
}

fn unit(record: &GapRecord) -> i32 {
    record.serial_number.as_str()[1..].parse().unwrap()
}

/// Assessments of the units of some records.
fn assess_rows(
    config: &Config,
    installations: &Installations,
    rows: &[GapRecord],
    ask: &UnitSelection,
) -> Vec<TrendRow> {
    let folder = tempfile::tempdir().unwrap();
    trends::assess_store(config, installations, &store(folder.path(), rows), ask).unwrap().now
}

/// Assessments of all units at a date, by default that of the newest record.
fn assess_with(config: &Config, flown: &[GapRecord], as_of_utc: Option<Timestamp>) -> Vec<TrendRow> {
    let ask = UnitSelection { as_of_utc, ..UnitSelection::default() };
    assess_rows(config, &Installations::default(), flown, &ask)
}

fn assess(flown: &[GapRecord], as_of: Timestamp) -> Vec<TrendRow> {
    assess_with(&config(), flown, Some(as_of))
}

#[test]
fn neither_later_flights_nor_the_order_of_arrival_change_a_bit_of_an_assessment() {
    let known = assess(&flown(200), day(199));
    assert_eq!(assess(&flown(330), day(199)), known);
    let mut late = flown(330);
    late.reverse();
    assert_eq!(assess(&late, day(199)), known);
}

#[test]
fn any_number_of_threads_gives_bitwise_identical_assessments() {
    let rows = flown(150);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| assess(&rows, day(149)))
    };
    assert_eq!(on(1), on(3));
}

/// One flight a day. Silent for sixty days or four hundred: usage has gone on at the unit's own rate, so dates count from
/// the last flight and stay when they have passed.
#[test]
fn dates_count_from_the_last_flight_at_the_units_own_rate() {
    let [now, silent, later] = [199, 259, 599].map(|at| assess(&flown(200), day(at)));
    for (row, tolerance) in now.iter().map(|row| (row, 1e-6)).chain(silent.iter().map(|row| (row, 0.01))) {
        let flights = row.crossing_hours_p50.unwrap() / HOURS_A_DAY;
        assert!((row.crossing_flights_p50.unwrap() - flights).abs() < 1e-6, "{row:?}");
        let days = row.likely_utc.unwrap().duration_since(day(199)).as_secs_f64() / 86_400.0;
        assert!((days / flights - 1.0).abs() < tolerance, "{days} days for {flights} flights");
        assert!(row.not_before_utc < row.likely_utc, "{row:?}");
    }
    for (silent, later) in silent.iter().zip(later) {
        let moved = later.likely_utc.unwrap().duration_since(silent.likely_utc.unwrap());
        assert!(moved.abs() <= DAY, "{moved}");
    }
}

/// Every third flight has a log, and the aircraft's meter counts all of them: 2 h a day.
#[test]
fn utilisation_counts_the_flights_that_left_no_log() {
    let mut rows = flown(200);
    rows.retain(|row| row.flight.departure_utc.duration_since(day(0)).as_hours() / 24 % 3 == 0);
    let metered = &assess(&rows, day(199))[0];
    assert!((metered.hours_per_day.unwrap() - HOURS_A_DAY).abs() < 1e-9, "{metered:?}");
    assert_eq!(metered.usage_source.as_deref(), Some("tail_hours"));
    rows.iter_mut().for_each(|row| row.flight.tail_hours_end = None);
    let logged = &assess(&rows, day(199))[0];
    assert!((logged.hours_per_day.unwrap() - HOURS_A_DAY / 3.0).abs() < 1e-9, "{logged:?}");
    assert_eq!(logged.usage_source.as_deref(), Some("logged_flights"));
    // Sixty-odd or thirty flights in ninety days.
    assert!(logged.hours_per_day_se.unwrap() / logged.hours_per_day.unwrap() > 0.15, "{logged:?}");
}

#[test]
fn a_removed_unit_has_no_state_no_dates_and_its_removal_date() {
    let installed = |unit| installation(unit, (unit == 3).then(|| "2024-07-20T00:00:00Z".parse().unwrap()));
    let installations = Installations::new((0..14).map(installed).collect()).unwrap();
    let ask = UnitSelection { as_of_utc: Some(day(259)), ..UnitSelection::default() };
    let rows = assess_rows(&config(), &installations, &flown(200), &ask);
    for row in &rows {
        let is_removed = row.serial_number == "S03";
        assert_eq!(row.state.is_none(), is_removed, "{row:?}");
        assert_eq!(row.crossing_hours_p50.is_none() && row.likely_utc.is_none(), is_removed);
        assert_eq!(row.check_probability.is_none(), is_removed);
    }
    let removed = &rows[3];
    assert_eq!(removed.reason.as_deref(), Some("removed from place_3 of T03 on 2024-07-20"));
    assert!(removed.gap_m.is_some() && removed.removed_utc.is_some() && removed.stale_days.is_none());
    // Those that stay have sent nothing for sixty days.
    assert_eq!(
        (rows[4].stale_days, rows[4].state, rows[4].action),
        (Some(60.0), Some("unassessed"), Some("check_logs"))
    );
    assert!(rows[4].reason.as_deref().unwrap().starts_with("no sound record for 60 days"), "{:?}", rows[4]);
}

/// Before its part number changed, S03 was reshimmed by 12 µm, and was measured above its limit.
#[test]
fn maintenance_and_inspections_under_a_former_number_are_those_of_the_unit_today() {
    let folder = tempfile::tempdir().unwrap();
    let table = |name: &str, columns: &str, row: String| {
        let text = format!("part_number,serial_number,{columns}\nOLD,S03,{row}\n");
        std::fs::write(folder.path().join(name), text).unwrap();
        Some(folder.path().join(name).display().to_string())
    };
    let mut config = config();
    config.document.logs.maintenance = table("m.csv", "utc,kind", format!("{},reshim", day(100)));
    config.document.logs.inspections = table("i.csv", "date_utc,play_m", format!("{},1.6e-4", day(140)));
    let part_number = PartNumber::new("OLD").unwrap();
    let former = Installation { part_number, ..installation(3, Some(day(150))) };
    let present = Installation { installed_utc: day(150), ..installation(3, None) };
    let installations = Installations::new(vec![former, present]).unwrap();
    let mut rows = flown(200);
    rows.retain(|row| unit(row) == 3);
    for gap_m in rows[100..].iter_mut().filter_map(|row| row.estimate.gap_m.as_mut()) {
        *gap_m -= 12e-6;
    }
    let ask = UnitSelection { as_of_utc: Some(day(199)), ..UnitSelection::default() };
    let row = &assess_rows(&config, &installations, &rows, &ask)[0];
    assert_eq!((row.reason_code, row.change_points[0].kind), (Some("inspected"), "recorded"), "{row:?}");
}

/// The records under the former name of the position have other settings: 5 µm more.
#[test]
fn a_flight_counts_once_after_its_position_was_renamed() {
    let stay = Installation { position: Position::new("LH").unwrap(), ..installation(3, None) };
    let installations = Installations::new(vec![stay.clone()]).unwrap();
    let (mut renamed, mut both) = (Vec::new(), Vec::new());
    for mut row in flown(200).into_iter().filter(|row| unit(row) == 3) {
        row.estimate.friction_n = row.estimate.gap_m.map(|gap_m| 1e6 * gap_m);
        renamed.push(GapRecord { position: stay.position.clone(), ..row.clone() });
        row.estimate.gap_m = row.estimate.gap_m.map(|gap_m| gap_m + 5e-6);
        both.extend([row, renamed[renamed.len() - 1].clone()]);
    }
    let assess = |rows: &[GapRecord]| {
        let folder = tempfile::tempdir().unwrap();
        let (store, ask) = (store(folder.path(), rows), UnitSelection::default());
        let found = trends::assess_store(&config(), &installations, &store, &ask).unwrap();
        (found.now[0].flights, found.now[0].rate_m_per_hour, found.followed)
    };
    assert_eq!(assess(&both), assess(&renamed));
}

#[test]
fn a_fleet_without_a_failure_is_compared_with_the_levels_that_it_has_reached() {
    let folder = tempfile::tempdir().unwrap();
    let histories = trends::load_histories(&store(folder.path(), &flown(700)), &BTreeSet::new()).unwrap();
    let past = backtest::of_histories(&config(), &Installations::default(), histories).unwrap();
    assert!(past.len() > 30, "{} past statements", past.len());
    for statement in &past {
        let elapsed = (day(699) - statement.as_of_utc).total(jiff::Unit::Hour).unwrap() / 24.0 * HOURS_A_DAY;
        assert_eq!(statement.target, "level");
        assert!((statement.true_hours - elapsed).abs() < 1e-6, "{statement:?}");
    }
    let held = past.iter().filter(|p| p.interval == "held").count() as f64 / past.len() as f64;
    let mut errors: Vec<f64> = past.iter().map(|p| p.relative_error).collect();
    errors.sort_by(f64::total_cmp);
    let error = errors[errors.len() / 2];
    assert!(held > 0.8 && error < 0.15, "held {held}, median error {error}");
}

/// The fleet of [`flown`], of which every second flight left no log and no hour meter is read: the flights
/// table alone has it. Each flight takes two hours in both tables.
#[test]
fn flights_of_the_flights_table_that_left_no_log_are_usage() {
    const UNITS: i32 = 14;
    const DAYS: i32 = 300;
    // The table from a day on, with a prefix of each name, and how many hours later flights with and without a log depart.
    let table = |first: i32, prefix: fn(i32) -> &'static str, late_h: [i64; 2]| {
        let row = |(unit, at): (i32, i32)| {
            let departs = day(at) + SignedDuration::from_hours(late_h[usize::from(at % 2 == 0)]);
            format!("T{unit:02},{}{unit}-{at},{departs},2.0\n", prefix(at))
        };
        let flights = (0..UNITS).flat_map(|unit| (first..DAYS + 50).map(move |at| (unit, at)));
        let head = "tail_number,flight_id,departure_utc,flight_hours\n".to_owned();
        fleet::with_flights(config(), &flights.map(row).fold(head, |all, row| all + &row))
    };
    let config_with = table(0, |_| "", [0, 0]);
    let installed = |unit| Installation { unit_hours_at_install: Some(100.0), ..installation(unit, None) };
    let installations = Installations::new((0..UNITS).map(installed).collect()).unwrap();
    let ask = UnitSelection { as_of_utc: Some(day(DAYS - 1)), ..UnitSelection::default() };
    let assess = |config: &Config| {
        let mut logged = flown(DAYS);
        logged.retain(|row| row.flight.flight_id.as_str().ends_with(['1', '3', '5', '7', '9']));
        logged.iter_mut().for_each(|row| row.flight.tail_hours_end = None);
        assess_rows(config, &installations, &logged, &ask)
    };
    let mut ratios = 0.0;
    for (unit, (with, without)) in assess(&config_with).iter().zip(assess(&config())).enumerate() {
        assert_eq!((with.flights, with.unit_hours), (300, Some(700.0)));
        assert_eq!((without.flights, without.unit_hours), (150, Some(400.0)));
        let truth = (15.0 + unit as f64) * 1e-9;
        let [low, rate, high] =
            [with.rate_p05_m_per_hour, with.rate_m_per_hour, with.rate_p95_m_per_hour].map(Option::unwrap);
        assert!(low < truth && truth < high, "{low} to {high} m/h of {truth}");
        ratios += rate / truth;
        assert!(without.rate_m_per_hour.unwrap() > 1.5 * truth);
    }
    // By other names, and in another time zone: each log is one of the flights all the same.
    assert!(assess(&table(0, |_| "TK", [3, 3])).iter().all(|row| row.flights == 300));
    // So it is where a fifth of them has the names of the logs.
    let mixed = table(0, |at| if at % 10 == 1 { "" } else { "TK" }, [3, 3]);
    assert!(assess(&mixed).iter().all(|row| row.flights == 300));
    // A table of the last fifty days, with flights ten hours after a log: these are others.
    assert!(assess(&table(250, |_| "", [0, -14])).iter().all(|row| row.flights == 150 + 25));
    // Some of them lie high and some low, by what their scatter allows: 3 % of the mean of all.
    let mean = ratios / f64::from(UNITS);
    assert!((mean - 1.0).abs() < 0.06, "{mean} of the true rates");
}

/// S03 wears on and nothing is new of it; S05 falls by 12 µm with the first flight of the last four weeks.
#[test]
fn a_run_reports_what_its_flights_changed_and_a_first_run_nothing() {
    let mut rows = flown(228);
    for row in rows.iter_mut().filter(|row| unit(row) == 5 && row.flight.departure_utc >= day(200)) {
        row.estimate.gap_m = row.estimate.gap_m.map(|gap| gap - 12e-6);
    }
    let known: Vec<GapRecord> =
        rows.iter().filter(|row| row.flight.departure_utc < day(200)).cloned().collect();
    let assess = |rows: &[GapRecord]| assess_with(&config(), rows, None);
    let states = |rows: &[GapRecord]| -> Vec<records::UnitState> {
        assess(rows).iter().map(|row| records::UnitState::of(row, None, "before")).collect()
    };
    let nothing = BTreeSet::new();
    let with_records = [(Some("EMA-27-1040".to_owned()), "S05".to_owned())].into();
    let run = |before: &[records::UnitState], with_records, config: &Config| {
        changes(config, before, &assess(&rows), RunFacts { run_id: "now", with_records, moved: &[] })
    };
    let found = run(&states(&known), &with_records, &config());
    let [change] = &found.changed[..] else { panic!("{:?}", found.changed) };
    assert_eq!(change.serial_number, "S05");
    assert_eq!(change.new_events.len(), 1, "{change:?}");
    assert_eq!(change.new_events[0].departure_utc, day(200));
    assert!(change.cleared_events.is_empty());
    assert_eq!(
        (change.from.as_deref(), change.to, change.cause),
        (Some("normal"), Some("watch"), Cause::Records)
    );
    // What is stored is what the next run compares with: it finds nothing.
    let stored: Vec<_> = found.states.iter().chain(&states(&known)).cloned().collect();
    let stored: std::collections::BTreeMap<_, _> = stored.into_iter().rev().map(|s| (s.unit(), s)).collect();
    let stored: Vec<records::UnitState> = stored.into_values().collect();
    assert!(run(&stored, &nothing, &config()).changed.is_empty());
    // A first run stores states and reports nothing.
    let first = run(&[], &with_records, &config());
    assert_eq!((first.changed.len(), first.states.len()), (0, 14));
}

/// Four units of a tail step together; two more on it measure nothing around the step, and do again after the day.
#[test]
fn flights_after_a_day_do_not_change_whether_its_step_is_tail_wide() {
    let mut rows = flown(228);
    for row in rows.iter_mut().filter(|row| unit(row) < 6) {
        let at = row.flight.departure_utc;
        row.flight.tail_number = TailNumber::new("T77").unwrap();
        row.estimate.gap_m = match unit(row) {
            4.. => row.estimate.gap_m.filter(|_| at < day(200) || at > day(215)),
            _ => row.estimate.gap_m.map(|gap| if at >= day(203) { gap + 8e-6 } else { gap }),
        };
    }
    let known: Vec<GapRecord> =
        rows.iter().filter(|row| row.flight.departure_utc <= day(215)).cloned().collect();
    let said_then = assess(&known, day(215));
    assert!(said_then[0].change_points.iter().any(|change| change.tail_wide), "{:?}", said_then[0]);
    assert_eq!(assess(&rows, day(215)), said_then);
}

/// Four units of one tail rise by 8 µm with one flight, and so does one unit of another tail.
#[test]
fn a_step_of_all_units_of_a_tail_is_reported_as_one_of_its_sensors() {
    let mut rows = flown(228);
    for row in &mut rows {
        if unit(row) < 4 {
            row.flight.tail_number = TailNumber::new("T77").unwrap();
        }
        if (unit(row) < 4 || unit(row) == 9) && row.flight.departure_utc >= day(205) {
            row.estimate.gap_m = row.estimate.gap_m.map(|gap| gap + 8e-6);
        }
    }
    let assess = assess(&rows, day(227));
    for unit in [0, 1, 2, 3, 9] {
        let [change] = &assess[unit].change_points[..] else { panic!("{:?}", assess[unit]) };
        assert_eq!((change.kind, change.tail_wide), ("step", unit < 4), "{unit}");
        let reason = assess[unit].reason.as_deref().unwrap();
        assert_eq!(
            reason.contains("the actuators of T77 changed together: its sensor or recorder is the likelier"),
            unit < 4,
            "{reason}"
        );
    }
    // Asked for alone, a unit is assessed the same.
    let ask = UnitSelection {
        as_of_utc: Some(day(227)),
        serial_number: Some("S02".into()),
        ..UnitSelection::default()
    };
    let alone = assess_rows(&config(), &Installations::default(), &rows, &ask);
    assert_eq!(alone, assess[2..3]);
}

/// The last six gaps are 3.5 µm too high, and the other estimator reports it.
#[test]
fn gaps_whose_estimators_disagree_hardly_move_a_level_and_the_reason_names_them() {
    let with = |off_um: f64, flag: Option<&str>| {
        let mut rows = flown(200);
        for row in rows.iter_mut().filter(|row| unit(row) == 3 && row.flight.departure_utc > day(193)) {
            let gap_m = row.estimate.gap_m.unwrap();
            row.estimate.gap_m = Some(gap_m + off_um * 1e-6);
            row.estimate.flags = flag.map(str::to_owned).into_iter().collect();
            row.estimate.gap_midrange_fitted_m = Some(gap_m);
        }
        assess(&rows, day(199)).into_iter().find(|row| row.serial_number == "S03").unwrap()
    };
    let (sound, off, flagged) = (with(0.0, None), with(3.5, None), with(3.5, Some("estimators_disagree")));
    assert_eq!(with(3.5, Some("soft_contact")), off, "no other flag disputes a gap");
    let moved_um = |row: &TrendRow| (row.gap_m.unwrap() - sound.gap_m.unwrap()) * 1e6;
    assert!(moved_um(&off) > 0.3, "{}", moved_um(&off));
    assert!(moved_um(&flagged).abs() < 0.3 * moved_um(&off), "{} {}", moved_um(&flagged), moved_um(&off));
    assert_eq!(flagged.state, sound.state);
    let reason = flagged.reason.unwrap();
    assert!(reason.contains("6 of the latest 12 gaps") && reason.contains("estimators_disagree"), "{reason}");
}
