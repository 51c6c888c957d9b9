//! Fleets whose truth a small simulator knows, with laws the bank does and does not contain.

use trend::{
    Assessment, ChangePointKind, FleetPrior, MaintenanceEvent, Observation, SerialExecutor, Series, Settings,
    UsageAxis, WearStatus, assess,
};

use crate::histories::{self, DAY_US, series};
use crate::random::Random;

const LIMIT_M: f64 = 1e-4;

/// Share of the life's growth at a share of the life.
type WearLaw = fn(f64) -> f64;

/// None of these is in the bank.
const STRANGE: [(&str, WearLaw); 4] = [
    ("running in, then a line", |t| 0.15 * (1.0 - (-t / 0.05).exp()) + 0.85 * t),
    // It meets the limit on the steep part.
    ("slow, fast, slow", |t| ((1.0 / (1.0 + (-6.0 * (t - 0.8)).exp())) - 0.008) / (0.7685 - 0.008)),
    ("two slopes", |t| if t < 0.6 { 0.6 * t } else { 0.36 + 1.6 * (t - 0.6) }),
    ("logarithm", |t| (1.0 + 4.0 * t).ln() / 5.0_f64.ln()),
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

/// Median relative error and coverage of the 90 % interval at shares of life, for a fleet of one law,
/// each assessed with a prior learned at the same share.
fn score(law: WearLaw, shares: &[f64]) -> (f64, f64) {
    let fleet: Vec<Unit> = (0..30).map(|seed| unit(seed, law, 3000)).collect();
    let (mut errors, mut covered, mut without) = (Vec::new(), 0.0, 0);
    for share in shares {
        // Every unit cut at its own share of life, so that the prior has seen no crossing; 3.4 h are flown in a day.
        let day = |u: &Unit| (share * u.crossing_hours.min(2.0 * u.life_hours) / 3.4) as i64;
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
fn fleets_are_forecast_with_intervals_that_hold_and_laws_the_bank_does_not_contain_hardly_worse() {
    let line: (&str, WearLaw, &[f64], f64, f64) = ("line", |t| t, &[0.4, 0.7], 0.12, 0.8);
    let strange = STRANGE.map(|(name, law)| (name, law, &[0.5, 0.7, 0.85][..], 0.6, 0.35));
    for (name, law, shares, largest_error, least_coverage) in [line].into_iter().chain(strange) {
        let (error, coverage) = score(law, shares);
        println!("{name}: median error {error:.3}, coverage {coverage:.3}");
        assert!(error < largest_error && coverage > least_coverage, "{name}: {error} {coverage}");
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

fn changes(assessment: &Assessment) -> Vec<ChangePointKind> {
    assessment.changes.iter().map(|change| change.kind).collect()
}

#[test]
fn a_rise_is_a_step_and_stays_in_the_level_and_is_the_books_own_at_a_change_of_installation() {
    let risen = |rise_um: f64, installation: u32| {
        let mut rows = rows(2, |flight, gap| if flight < 200 { gap } else { gap + rise_um });
        for row in &mut rows[200..] {
            row.installation = installation;
            row.tail_hours_end = row.tail_hours_end.map(|hours| hours + 5000.0 * f64::from(installation));
        }
        assessment(&series(rows), 250 * DAY_US, None)
    };
    let (moved, still) = (risen(9.0, 0), risen(0.0, 0));
    assert_eq!(changes(&moved), [ChangePointKind::Step]);
    let off_m = moved.level.unwrap().gap_m - still.level.unwrap().gap_m - 9e-6;
    assert!(off_m.abs() < 2e-6, "{off_m:e}");
    assert_eq!(changes(&still), []);
    assert_eq!(changes(&risen(9.0, 1)), [ChangePointKind::Recorded]);
}

#[test]
fn wear_that_begins_late_is_an_onset_and_no_step() {
    let rows = rows(4, |flight, _| 20.0 + if flight < 250 { 0.0 } else { 0.08 * (flight - 250) as f64 });
    let found = assessment(&series(rows), 250 * DAY_US, None).changes;
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
