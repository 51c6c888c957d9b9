//! An incremental snapshot gives the assessment of the whole history.

use proptest::prelude::*;
use trend::{
    Assessment, FleetPrior, MaintenanceEvent, Observation, Series, Settings, State, UnitSnapshot,
    UsageDefaults, assess, assess_with_hysteresis,
};

use crate::random::Random;

const DAY_US: i64 = 86_400_000_000;
const LIMIT_M: f64 = 1e-4;

/// What befalls a unit of one flight a day, and when.
#[derive(Debug, Clone)]
struct Life {
    seed: u64,
    flights: usize,
    um_per_hour: f64,
    exponent: f64,
    noise_um: f64,
    stated_um: Option<f64>,
    /// Step of the gap, µm, and the flight it comes with.
    step: (f64, usize),
    /// Flight from which wear begins.
    onset: usize,
    /// Flights between two changes of installation.
    stay: usize,
    refused: f64,
    outliers: f64,
    /// Share of rows that arrive late, and of those that arrive twice.
    late: f64,
    twice: f64,
    metered: bool,
    near_installation_change: Option<(usize, bool)>,
}

impl Life {
    /// A unit that wears by 12 µm per 1,000 h and to which nothing happens.
    fn quiet(seed: u64, flights: usize) -> Self {
        Self {
            seed,
            flights,
            um_per_hour: 0.012,
            exponent: 1.0,
            noise_um: 2.0,
            stated_um: Some(2.0),
            step: (0.0, usize::MAX),
            onset: 0,
            stay: usize::MAX,
            refused: 0.0,
            outliers: 0.02,
            late: 0.0,
            twice: 0.0,
            metered: true,
            near_installation_change: None,
        }
    }

    /// The rows of each run, in the order of their arrival.
    fn nights(&self) -> Vec<Vec<Observation>> {
        let mut random = Random::new(self.seed);
        let mut nights = vec![Vec::new(); self.flights + 9];
        for flight in 0..self.flights {
            let hours = 1.6 * (flight + 1) as f64;
            let worn = (1.6 * flight.saturating_sub(self.onset) as f64 / 1000.0).powf(self.exponent);
            let step_um = if flight >= self.step.1 { self.step.0 } else { 0.0 };
            let outlier_um = if random.uniform() < self.outliers { 40.0 } else { 0.0 };
            let gap_um = 25.0
                + 1000.0 * self.um_per_hour * worn
                + step_um
                + outlier_um
                + self.noise_um * random.normal();
            let row = Observation {
                departure_us: flight as i64 * DAY_US,
                installation: (flight / self.stay) as u32,
                flight_hours: Some(1.5),
                tail_hours_end: self.metered.then_some(3000.0 + hours),
                load_reversals: (flight % 3 > 0).then_some(90 + flight as u64 % 20),
                gap_m: (random.uniform() >= self.refused).then_some(gap_um * 1e-6),
                gap_se_m: self.stated_um.map(|um| um * 1e-6),
            };
            let arrives = flight + if random.uniform() < self.late { 4 } else { 0 };
            nights[arrives].push(row);
            if random.uniform() < self.twice {
                nights[arrives + 2].push(Observation { gap_m: row.gap_m.map(|gap| gap + 1e-7), ..row });
            }
        }
        nights
    }

    fn maintenance(&self) -> Vec<MaintenanceEvent> {
        let entry =
            |(flight, renews): (usize, bool)| MaintenanceEvent { utc_us: flight as i64 * DAY_US - 9, renews };
        self.near_installation_change.map(entry).into_iter().collect()
    }
}

/// How often an increment needed its history, of all nights with a flight.
struct Evaluated {
    nights: usize,
    histories: usize,
}

/// A unit assessed in each run from its snapshot and from its series, which must be bitwise identical.
fn compare(life: &Life, prior: &FleetPrior, from: usize) -> Evaluated {
    let settings = Settings::for_limit(LIMIT_M);
    let (mut rows, mut bytes) = (Vec::new(), Vec::new());
    let mut asked = Evaluated { nights: 0, histories: 0 };
    for (night, new) in life.nights().into_iter().enumerate() {
        let as_of_us = night as i64 * DAY_US;
        rows.extend(new.iter().copied());
        if night < from {
            continue;
        }
        let series = || {
            Series::new(rows.iter().copied(), &UsageDefaults::default())
                .unwrap()
                .with_maintenance(life.maintenance())
        };
        let says = |snapshot: &UnitSnapshot| {
            snapshot.assess(as_of_us, &life.maintenance(), &settings, prior, None).unwrap()
        };
        let snapshot = UnitSnapshot::from_bytes(&bytes, prior)
            .and_then(|snapshot| snapshot.append(new.iter().copied()).unwrap());
        let known = snapshot.and_then(|snapshot| Some((says(&snapshot)?, snapshot)));
        asked.nights += usize::from(!new.is_empty());
        asked.histories += usize::from(known.is_none());
        let (assessment, snapshot) = known.unwrap_or_else(|| {
            let snapshot = UnitSnapshot::from_series(&series(), as_of_us, prior);
            (says(&snapshot).unwrap(), snapshot)
        });
        let whole: Assessment = assess(&series(), as_of_us, &settings, Some(prior), None).unwrap();
        if night % 5 == 0
            && let Some(held) =
                snapshot.assess_with_hysteresis(as_of_us, &life.maintenance(), &settings, prior).unwrap()
        {
            let whole = assess_with_hysteresis(&series(), as_of_us, &settings, Some(prior)).unwrap();
            assert_eq!(format!("{held:?}"), format!("{whole:?}"), "night {night} of {life:?}");
        }
        // Numbers are printed so that no other number reads the same.
        assert_eq!(format!("{assessment:?}"), format!("{whole:?}"), "night {night} of {life:?}");
        bytes = snapshot.to_bytes();
        // An error that was not stated is no number, and so not equal to itself: its bytes are.
        let again = UnitSnapshot::from_bytes(&bytes, prior).map(|snapshot| snapshot.to_bytes());
        assert!(again.as_ref() == Some(&bytes), "night {night} of {life:?}");
    }
    asked
}

fn lives() -> impl Strategy<Value = Life> {
    let wear = (prop_oneof![Just(0.0), 0.0..0.06], 0.5..2.0, prop_oneof![0.2..4.0, Just(0.0)]);
    let stated = prop_oneof![Just(None), (0.5..5.0).prop_map(Some)];
    let step = (prop_oneof![Just(0.0), -30.0..30.0], 0_usize..300);
    let shares = (prop_oneof![Just(0.0), 0.0..0.6], 0.0..0.1, 0.0..0.05, 0.0..0.05);
    let near_installation_change = prop::option::of((0_usize..300, any::<bool>()));
    let stay = prop_oneof![Just(usize::MAX), 10_usize..200];
    (any::<u64>(), wear, stated, step, 0_usize..150, stay, shares, any::<bool>(), near_installation_change)
        .prop_map(
            |(
                seed,
                (um_per_hour, exponent, noise_um),
                stated_um,
                step,
                onset,
                stay,
                shares,
                metered,
                near_installation_change,
            )| {
                let (refused, outliers, late, twice) = shares;
                let quiet = Life::quiet(seed, 300);
                let life = Life { um_per_hour, exponent, noise_um, stated_um, step, onset, ..quiet };
                Life { stay, refused, outliers, late, twice, metered, near_installation_change, ..life }
            },
        )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    /// Worn, stepped, reset, rejected, recorded, late or duplicated: snapshots and flights give the same assessments.
    #[test]
    fn an_incremental_state_equals_the_whole_history_bitwise(
        life in lives(), from in 0_usize..250,
    ) {
        compare(&life, &FleetPrior::uninformative(LIMIT_M), from);
    }

    /// Whatever the bytes, they are a state or nothing.
    #[test]
    fn damaged_bytes_are_no_state(at in 0_usize..4000, change in 1_u8..=255, cut in 0_usize..4000) {
        let prior = FleetPrior::uninformative(LIMIT_M);
        let mut bytes = snapshot(&Life::quiet(3, 200), 190, &prior).to_bytes();
        prop_assert_eq!(UnitSnapshot::from_bytes(&bytes[..cut.min(bytes.len() - 1)], &prior), None);
        let at = at % bytes.len();
        bytes[at] ^= change;
        prop_assert_eq!(UnitSnapshot::from_bytes(&bytes, &prior), None);
    }
}

/// The state of the flights of some nights.
fn snapshot(life: &Life, nights: usize, prior: &FleetPrior) -> UnitSnapshot {
    let rows = life.nights().into_iter().take(nights).flatten();
    UnitSnapshot::from_series(
        &Series::new(rows, &UsageDefaults::default()).unwrap(),
        nights as i64 * DAY_US,
        prior,
    )
}

#[test]
fn a_quiet_unit_of_a_thousand_flights_seldom_needs_its_history() {
    let Evaluated { nights, histories } =
        compare(&Life::quiet(1, 1100), &FleetPrior::uninformative(LIMIT_M), 1000);
    assert!(nights == 100 && histories <= 8, "{histories} of {nights}");
}

/// At its watch limit, without wear, the states of a unit's last flights matter; the tail holds
/// them from 25 flights on.
#[test]
fn a_snapshot_applies_the_hysteresis_of_the_last_flights() {
    let prior = FleetPrior::uninformative(LIMIT_M);
    let life = Life { outliers: 0.0, um_per_hour: 0.0, ..Life::quiet(5, 2100) };
    let rows: Vec<Observation> = life.nights().into_iter().flatten().collect();
    let series = Series::new(rows.iter().copied(), &UsageDefaults::default()).unwrap();
    let settings = Settings { planning_horizon_hours: 1.0, ..Settings::for_limit(LIMIT_M) };
    let then = assess(&series, 2080 * DAY_US, &settings, Some(&prior), None).unwrap();
    let settings = Settings { watch_m: then.level.unwrap().gap_m, ..settings };
    let mut held = 0;
    for flights in 2060..2100 {
        let series = Series::new(rows[..flights].iter().copied(), &UsageDefaults::default()).unwrap();
        let as_of_us = flights as i64 * DAY_US;
        let assessment = assess_with_hysteresis(&series, as_of_us, &settings, Some(&prior)).unwrap();
        let snapshot = UnitSnapshot::from_series(&series, as_of_us, &prior);
        let lookback_departures = snapshot.assess_with_hysteresis(as_of_us, &[], &settings, &prior).unwrap();
        assert!(
            lookback_departures == Some(assessment.clone())
                || (lookback_departures.is_none() && flights <= 2072),
            "{flights}"
        );
        let single_unit = snapshot.assess(as_of_us, &[], &settings, &prior, None).unwrap().unwrap();
        held +=
            usize::from(single_unit.state == Some(State::Normal) && assessment.state == Some(State::Watch));
    }
    assert!(held > 0);
}

/// A step is believed as soon as six estimates follow it, checkpoint or not.
#[test]
fn a_step_after_a_checkpoint_is_found_as_soon_as_six_estimates_follow_it() {
    let prior = FleetPrior::uninformative(LIMIT_M);
    for step in 960..1000 {
        let life = Life { step: (-14.0, step), outliers: 0.0, noise_um: 1.0, ..Life::quiet(7, 1020) };
        let rows: Vec<Observation> = life.nights().into_iter().flatten().collect();
        let series = Series::new(rows, &UsageDefaults::default()).unwrap();
        let as_of_us = (step + 5) as i64 * DAY_US;
        let assessment =
            assess(&series, as_of_us, &Settings::for_limit(LIMIT_M), Some(&prior), None).unwrap();
        let found = assessment.changes;
        assert!(
            found.len() == 1 && (found[0].departure_us / DAY_US - step as i64).abs() <= 1,
            "{step}: {found:?}"
        );
    }
}

#[test]
fn a_state_of_another_prior_or_book_or_of_a_later_day_is_not_used() {
    let prior = FleetPrior::uninformative(LIMIT_M);
    let snapshot = snapshot(&Life::quiet(2, 200), 197, &prior);
    let settings = Settings::for_limit(LIMIT_M);
    let says = |day: i64, maintenance: &[MaintenanceEvent], prior: &FleetPrior| {
        snapshot.assess(day * DAY_US, maintenance, &settings, prior, None).unwrap().is_some()
    };
    assert!(says(197, &[], &prior));
    let other = FleetPrior::uninformative(1.1 * LIMIT_M);
    assert!(!says(197, &[], &other) && UnitSnapshot::from_bytes(&snapshot.to_bytes(), &other).is_none());
    assert!(!says(197, &[MaintenanceEvent { utc_us: 90 * DAY_US, renews: false }], &prior));
    assert!(!says(190, &[], &prior));
    // Work after the last flight is not yet known to have changed anything.
    assert!(says(210, &[MaintenanceEvent { utc_us: 200 * DAY_US, renews: true }], &prior));
}

#[test]
fn a_late_or_repeated_flight_needs_the_history_and_a_wrong_one_is_refused() {
    let prior = FleetPrior::uninformative(LIMIT_M);
    let life = Life::quiet(4, 200);
    let snapshot = snapshot(&life, 197, &prior);
    let rows: Vec<Observation> = life.nights().into_iter().flatten().collect();
    for late in [&rows[196], &rows[90]] {
        assert_eq!(snapshot.append([*late]).unwrap(), None);
    }
    assert!(snapshot.append([rows[198], rows[197]]).unwrap().is_some());
    assert!(snapshot.append(rows[197..199].iter().copied().cycle().take(9)).unwrap().is_some());
    // The 200th flight is a checkpoint's.
    assert_eq!(snapshot.append(rows[197..].iter().copied()).unwrap(), None);
    assert_eq!(snapshot.append([]).unwrap(), Some(snapshot.clone()));
    snapshot.append([Observation { gap_m: Some(f64::NAN), ..rows[197] }]).unwrap_err();
}

/// Ten thousand flights of three a day, with outliers, refusals and moves from tail to tail.
#[test]
fn the_state_of_ten_thousand_flights_takes_less_than_16_kb() {
    let prior = FleetPrior::uninformative(LIMIT_M);
    for (seed, um_per_hour) in [(1, 0.0), (2, 0.003), (3, 0.005)] {
        let life = Life {
            um_per_hour,
            stay: 300,
            refused: 0.05,
            outliers: 0.03,
            stated_um: None,
            ..Life::quiet(seed, 10_000)
        };
        let rows = life.nights().into_iter().flatten();
        let rows = rows.map(|row| Observation { departure_us: row.departure_us / 3, ..row });
        // The tail is longest just before the next checkpoint.
        let rows = rows.take(9983);
        let series = Series::new(rows, &UsageDefaults::default()).unwrap();
        let bytes = UnitSnapshot::from_series(&series, i64::MAX, &prior).to_bytes();
        assert!(bytes.len() <= 16_000, "{} bytes", bytes.len());
    }
}
