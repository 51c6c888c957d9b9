//! Fleets whose truth a small simulator knows, with laws the bank does and does not contain.

use trend::{
    Assessment, ChangePoint, ChangePointKind, Executor, FleetPrior, MaintenanceEvent, Observation,
    SerialExecutor, Series, Settings, UsageAxis, WearStatus, assess,
};

use crate::histories::{self, DAY_US, series};
use crate::random::Random;

const LIMIT_M: f64 = 1e-4;

/// Share of the life's growth at a share of the life.
type WearLaw = fn(f64) -> f64;

/// None of these is in the bank.
const STRANGE: [WearLaw; 4] = [
    // Running in, then a line.
    |t| 0.15 * (1.0 - (-t / 0.05).exp()) + 0.85 * t,
    // Slow, fast, slow again: it meets the limit on the steep part.
    |t| ((1.0 / (1.0 + (-6.0 * (t - 0.8)).exp())) - 0.008) / (0.7685 - 0.008),
    // Two slopes with a knee.
    |t| if t < 0.6 { 0.6 * t } else { 0.36 + 1.6 * (t - 0.6) },
    // A logarithm.
    |t| (1.0 + 4.0 * t).ln() / 5.0_f64.ln(),
];

/// A unit of two flights a day at 1.7 h, four in five of which leave an estimate.
struct Unit {
    rows: Vec<Observation>,
    /// True hours at which the gap meets the limit, from the first flight.
    crossing_hours: f64,
    life_hours: f64,
}

fn unit(seed: u64, law: WearLaw, flights: i64) -> Unit {
    let mut random = Random::new(seed);
    let life_hours = 3000.0 * (0.4 * random.normal()).exp();
    let new_um = 20.0 + 3.0 * random.normal();
    let mut rows = Vec::new();
    let (mut crossing_hours, mut gap_um, mut before) = (f64::INFINITY, new_um, law(0.0));
    for flight in 0..20_000_i64 {
        let hours = 1.7 * (flight + 1) as f64;
        let value = law(hours / life_hours);
        let mean_um = 80.0 * (value - before).max(0.0);
        before = value;
        // Wear comes in lumps: the mean at its rate, its variance 0.2 µm times the mean.
        let lump = if mean_um > 0.0 { 0.2 } else { 1.0 };
        gap_um += if random.uniform() < mean_um / lump { lump } else { 0.0 };
        if gap_um >= 100.0 && crossing_hours.is_infinite() {
            crossing_hours = hours;
        }
        if flight < flights && random.uniform() < 0.8 {
            let se_um = random.between(1.5, 4.0);
            let outlier = if random.uniform() < 0.02 { 40.0 } else { 0.0 };
            let measured_um = gap_um + se_um * random.normal() + outlier;
            rows.push(histories::row(flight, DAY_US / 2, 1.7, measured_um, se_um));
        } else if flight >= flights && crossing_hours.is_finite() {
            break;
        }
    }
    Unit { rows, crossing_hours, life_hours }
}

fn assessment(series: &Series, as_of_us: i64, prior: Option<&FleetPrior>) -> Assessment {
    assess(series, as_of_us, &Settings::for_limit(LIMIT_M), prior).unwrap()
}

/// Day on which a unit has flown some hours.
fn day_of(hours: f64) -> i64 {
    (hours / 3.4) as i64
}

/// Median relative error and coverage of the 90 % interval at shares of life, for a fleet of one law,
/// each assessed with a prior learned at the same share.
fn score(law: WearLaw, shares: &[f64]) -> (f64, f64) {
    let fleet: Vec<Unit> = (0..30).map(|seed| unit(seed, law, 3000)).collect();
    let (mut errors, mut covered, mut without) = (Vec::new(), 0.0, 0);
    for share in shares {
        // Every unit cut at its own share of life, so that the prior has seen no crossing.
        let day = |u: &Unit| day_of(share * u.crossing_hours.min(2.0 * u.life_hours));
        let is_known = |u: &Unit, row: &Observation| row.departure_us <= day(u) * DAY_US;
        let cut = |u: &Unit| series(u.rows.iter().copied().filter(|row| is_known(u, row)));
        let known: Vec<Series> = fleet.iter().map(cut).collect();
        let prior = FleetPrior::learn(&known, i64::MAX, LIMIT_M, None, &SerialExecutor);
        for (unit, series) in fleet.iter().zip(&known) {
            let Some(crossing) = assessment(series, day(unit) * DAY_US, Some(&prior)).crossing else {
                // A lone wild last record has none until the next one.
                without += 1;
                continue;
            };
            let left = unit.crossing_hours - 3.4 * day(unit) as f64;
            let [low, likely, high] =
                [crossing.p05_hours, crossing.p50_hours, crossing.p95_hours].map(|h| h.unwrap_or(20_000.0));
            errors.push((likely - left).abs() / left);
            covered += f64::from(u8::from(low <= left && left <= high));
        }
    }
    assert!(without <= 1, "{without} without forecast");
    errors.sort_by(f64::total_cmp);
    (errors[errors.len() / 2], covered / errors.len() as f64)
}

#[test]
fn a_fleet_on_a_line_is_forecast_within_a_tenth_and_its_intervals_hold() {
    let (error, coverage) = score(|t| t, &[0.4, 0.7]);
    println!("line: median error {error:.3}, coverage {coverage:.3}");
    assert!(error < 0.12 && coverage > 0.8, "{error} {coverage}");
}

#[test]
fn laws_the_bank_does_not_contain_are_still_forecast_with_intervals_that_mostly_hold() {
    for (name, law) in ["running in", "sigmoid", "knee", "logarithm"].into_iter().zip(STRANGE) {
        let (error, coverage) = score(law, &[0.5, 0.7, 0.85]);
        println!("{name}: median error {error:.3}, coverage {coverage:.3}");
        assert!(error < 0.6 && coverage > 0.35, "{name}: {error} {coverage}");
    }
}

/// Rows of a unit wearing at 10 µm per 1,000 h with 2 µm noise, and what a caller does to its gaps.
fn rows(seed: u64, change_um: impl Fn(i64, f64) -> f64) -> Vec<Observation> {
    let mut random = Random::new(seed);
    (0..500)
        .map(|flight| {
            let hours = 1.7 * (flight + 1) as f64;
            let gap_um = change_um(flight, 20.0 + 0.01 * hours) + 2.0 * random.normal();
            histories::row(flight, DAY_US / 2, 1.7, gap_um, 2.0)
        })
        .collect()
}

fn changes(rows: Vec<Observation>) -> Vec<ChangePoint> {
    assessment(&series(rows), 250 * DAY_US, None).changes
}

#[test]
fn a_rise_that_no_record_explains_is_a_step_and_stays_in_the_level() {
    let risen = |rise_um: f64| {
        let rows = rows(2, |flight, gap| if flight < 200 { gap } else { gap + rise_um });
        assessment(&series(rows), 250 * DAY_US, None)
    };
    let (moved, still) = (risen(9.0), risen(0.0));
    assert_eq!(moved.changes.iter().map(|c| c.kind).collect::<Vec<_>>(), [ChangePointKind::Step]);
    let off_m = moved.level.unwrap().gap_m - still.level.unwrap().gap_m - 9e-6;
    assert!(off_m.abs() < 2e-6, "{off_m:e}");
    assert!(still.changes.is_empty(), "{:?}", still.changes);
}

#[test]
fn the_same_step_at_a_change_of_installation_is_the_books_own() {
    let mut rows = rows(3, |flight, gap| if flight < 200 { gap } else { gap + 9.0 });
    rows[200..].iter_mut().for_each(|row| row.installation = 1);
    rows[200..].iter_mut().for_each(|row| row.tail_hours_end = row.tail_hours_end.map(|h| h + 5000.0));
    assert_eq!(changes(rows).iter().map(|c| c.kind).collect::<Vec<_>>(), [ChangePointKind::Recorded]);
}

#[test]
fn wear_that_begins_late_is_an_onset_and_no_step() {
    let found =
        changes(rows(4, |flight, _| 20.0 + if flight < 250 { 0.0 } else { 0.08 * (flight - 250) as f64 }));
    let [change] = found[..] else { panic!("{found:?}") };
    assert_eq!(change.kind, ChangePointKind::Onset);
    assert!((change.departure_us - 125 * DAY_US).abs() < 20 * DAY_US, "{change:?}");
    assert!(change.certainty > 0.5 && change.certainty <= 1.0, "{change:?}");
}

#[test]
fn units_that_do_not_wear_are_seldom_called_wearing() {
    let wear = |seed: u64| assessment(&series(rows(1000 + seed, |_, _| 20.0)), 250 * DAY_US, None).wear;
    let wearing = (0..60).filter(|&seed| wear(seed) == WearStatus::Wearing).count();
    assert!(wearing <= 2, "{wearing} of 60");
}

#[test]
fn a_prior_looks_at_nothing_later_than_its_day_and_not_at_the_order_of_its_units() {
    let fleet = |flights| (0..6).map(move |seed| series(unit(seed, |t| t, flights).rows));
    let learned = |fleet: &[Series]| FleetPrior::learn(fleet, 200 * DAY_US, LIMIT_M, None, &SerialExecutor);
    let whole = learned(&fleet(800).collect::<Vec<_>>());
    let reversed = learned(&fleet(800).rev().collect::<Vec<_>>());
    assert_eq!(format!("{whole:?}"), format!("{reversed:?}"));
    let cut = learned(&fleet(401).collect::<Vec<_>>());
    assert_eq!(format!("{whole:?}"), format!("{cut:?}"));
}

/// The last first, each on a thread of its own.
struct Backwards;

impl Executor for Backwards {
    fn map<T: Sync, R: Send>(&self, things: &[T], work: impl Fn(&T) -> R + Send + Sync) -> Vec<R> {
        let work = &work;
        let mut results: Vec<R> = std::thread::scope(|scope| {
            let threads: Vec<_> = things.iter().rev().map(|thing| scope.spawn(move || work(thing))).collect();
            threads.into_iter().map(|thread| thread.join().unwrap()).collect()
        });
        results.reverse();
        results
    }
}

#[test]
fn a_prior_is_the_same_to_the_last_bit_whoever_does_the_work() {
    let fleet: Vec<Series> = (0..6).map(|seed| series(unit(seed, |t| t, 400).rows)).collect();
    let day = 200 * DAY_US;
    let in_turn = FleetPrior::learn(&fleet, day, LIMIT_M, None, &SerialExecutor);
    let apart = FleetPrior::learn(&fleet, day, LIMIT_M, None, &Backwards);
    assert_eq!(format!("{in_turn:?}"), format!("{apart:?}"));
}

#[test]
fn a_booked_re_shim_is_the_books_own_and_begins_the_unit_anew() {
    // A fall of 8 µm to some 25 µm above new: too small to be known for a reset without the book.
    let at = 300;
    let fell = rows(11, |flight, gap| if flight < at { gap + 30.0 } else { gap + 22.0 });
    let departure_us = fell[at as usize].departure_us;
    let booked = |renews: Option<bool>| {
        let maintenance = renews.map(|renews| MaintenanceEvent { utc_us: departure_us - 1, renews });
        let series = series(fell.clone()).with_maintenance(maintenance.into_iter().collect());
        assessment(&series, 250 * DAY_US, None)
    };
    let kinds = |trend: &Assessment| trend.changes.iter().map(|c| c.kind).collect::<Vec<_>>();
    let (single_unit, rigged, renewed) = (booked(None), booked(Some(false)), booked(Some(true)));
    assert!(!kinds(&single_unit).contains(&ChangePointKind::Recorded), "{:?}", single_unit.changes);
    assert_eq!(kinds(&rigged), [ChangePointKind::Recorded]);
    // The level is measured either way.
    let level = |trend: &Assessment| trend.level.map(|level| (level.gap_m, level.se_m, level.records));
    assert_eq!(level(&rigged), level(&renewed));
}

/// Thirty units of 400 flights at 1.5 h that wear by 30 µm in 600 h from 20 µm; halfway the gap falls by 8 µm.
fn reshimmed(is_booked: bool) -> Vec<Series> {
    const HALF: i64 = 200;
    let one = |seed: u64| {
        let mut random = Random::new(seed + 500);
        let new_um = 20.0 + 2.0 * random.normal();
        let row = |flight: i64| {
            let shim_um = if flight < HALF { 0.0 } else { 8.0 };
            let gap_um = new_um + 0.075 * (flight + 1) as f64 - shim_um + 1.5 * random.normal();
            Observation { load_reversals: None, ..histories::row(flight, DAY_US, 1.5, gap_um, 1.5) }
        };
        let entry = MaintenanceEvent { utc_us: HALF * DAY_US - DAY_US / 2, renews: true };
        let maintenance = if is_booked { vec![entry] } else { Vec::new() };
        series((0..2 * HALF).map(row)).with_maintenance(maintenance)
    };
    (0..30).map(one).collect()
}

/// New units begin at 20 µm, re-shimmed ones at 20 + 15 − 8 = 27 µm: 23.5 µm in the mean. Unbooked, the
/// fall is a step of the measurement, and only the 20 µm of the new units enter the prior.
#[test]
fn a_fleet_learns_from_its_maintenance_book_what_a_reshimmed_gap_is() {
    let new_um = |recorded_um| {
        let prior = FleetPrior::learn(
            &reshimmed(recorded_um),
            i64::MAX,
            LIMIT_M,
            Some(UsageAxis::Hours),
            &SerialExecutor,
        );
        prior.new_m * 1e6
    };
    let (recorded_um, unrecorded_um) = (new_um(true), new_um(false));
    assert!((recorded_um - 23.5).abs() < 1.5, "{recorded_um} µm");
    assert!((unrecorded_um - 20.0).abs() < 1.5, "{unrecorded_um} µm");
}

#[test]
fn wear_follows_the_configured_axis_unless_it_was_not_counted() {
    let fleet = reshimmed(true);
    let learned = |axis| FleetPrior::learn(&fleet, i64::MAX, LIMIT_M, axis, &SerialExecutor);
    assert_eq!(learned(Some(UsageAxis::Flights)).axis, UsageAxis::Flights);
    // No flight holds its load reversals; all have one length, so hours and flights are equivalent.
    assert_eq!(learned(Some(UsageAxis::Reversals)), learned(None));
}
