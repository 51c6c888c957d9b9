//! Checkpoints: assessments at several dates share the fit of the earlier flights, and change nothing.

use proptest::prelude::*;
use trend::{
    FleetPrior, MaintenanceEvent, Observation, Series, Settings, State, UsageDefaults, assess,
    assess_with_hysteresis,
};

use crate::random::Random;

const DAY_US: i64 = 86_400_000_000;
const LIMIT_M: f64 = 1e-4;

/// Life of a unit with one flight a day.
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
    /// A unit that wears by 12 µm per 1,000 h, without events.
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
    fn rows_by_run(&self) -> Vec<Vec<Observation>> {
        let mut random = Random::new(self.seed);
        let mut runs = vec![Vec::new(); self.flights + 9];
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
            runs[arrives].push(row);
            if random.uniform() < self.twice {
                runs[arrives + 2].push(Observation { gap_m: row.gap_m.map(|gap| gap + 1e-7), ..row });
            }
        }
        runs
    }

    fn maintenance(&self) -> Vec<MaintenanceEvent> {
        let entry =
            |(flight, renews): (usize, bool)| MaintenanceEvent { utc_us: flight as i64 * DAY_US - 9, renews };
        self.near_installation_change.map(entry).into_iter().collect()
    }
}

/// State of a unit as the hysteresis defines it: each of its last 24 earlier flights with a gap is assessed by itself,
/// and the most urgent of these states is the previous one.
fn state_by_definition(
    series: &Series,
    as_of_us: i64,
    settings: &Settings,
    prior: &FleetPrior,
) -> Option<State> {
    let earlier = series.flights_until(as_of_us).iter().rev().filter(|flight| flight.gap.is_some());
    let state = |as_of_us, previous| assess(series, as_of_us, settings, Some(prior), previous).unwrap().state;
    let previous = earlier.skip(1).take(24).map(|flight| state(flight.departure_us, None)).max().flatten();
    state(as_of_us, previous)
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

    /// Worn, stepped, reset, rejected, recorded, late or duplicated: assessments that share a checkpoint give the
    /// state of assessments one by one.
    #[test]
    fn the_hysteresis_follows_its_definition(life in lives(), days in 64_i64..300, watch_m in 3e-5..5e-5) {
        let prior = FleetPrior::uninformative(LIMIT_M);
        let rows = life.rows_by_run().into_iter().flatten();
        let series = Series::new(rows, &UsageDefaults::default()).unwrap().with_maintenance(life.maintenance());
        let settings = Settings { watch_m, planning_horizon_hours: 1.0, ..Settings::for_limit(LIMIT_M) };
        let as_of_us = days * DAY_US;
        let held = assess_with_hysteresis(&series, as_of_us, &settings, Some(&prior)).unwrap();
        prop_assert_eq!(held.state, state_by_definition(&series, as_of_us, &settings, &prior));
    }

    /// The order in which rows arrive changes nothing.
    #[test]
    fn the_order_of_arrival_changes_nothing(life in lives()) {
        let prior = FleetPrior::uninformative(LIMIT_M);
        let mut rows: Vec<Observation> = life.rows_by_run().into_iter().flatten().collect();
        let assessed = |rows: &[Observation]| {
            let series = Series::new(rows.iter().copied(), &UsageDefaults::default()).unwrap();
            let settings = Settings::for_limit(LIMIT_M);
            format!("{:?}", assess(&series, 280 * DAY_US, &settings, Some(&prior), None).unwrap())
        };
        let first = assessed(&rows);
        rows.reverse();
        prop_assert_eq!(assessed(&rows), first);
    }
}

/// At its watch limit, without wear, the states of a unit's last flights matter.
#[test]
fn a_unit_at_its_watch_limit_keeps_its_state() {
    let prior = FleetPrior::uninformative(LIMIT_M);
    let life = Life { outliers: 0.0, um_per_hour: 0.0, ..Life::quiet(5, 2100) };
    let rows: Vec<Observation> = life.rows_by_run().into_iter().flatten().collect();
    let series = Series::new(rows, &UsageDefaults::default()).unwrap();
    let settings = Settings { planning_horizon_hours: 1.0, ..Settings::for_limit(LIMIT_M) };
    let then = assess(&series, 2080 * DAY_US, &settings, Some(&prior), None).unwrap();
    let settings = Settings { watch_m: then.level.unwrap().gap_m, ..settings };
    let mut held = 0;
    for day in 2060..2100 {
        let as_of_us = day * DAY_US;
        let assessment = assess_with_hysteresis(&series, as_of_us, &settings, Some(&prior)).unwrap();
        assert_eq!(assessment.state, state_by_definition(&series, as_of_us, &settings, &prior), "{day}");
        let single = assess(&series, as_of_us, &settings, Some(&prior), None).unwrap();
        held += usize::from(single.state == Some(State::Normal) && assessment.state == Some(State::Watch));
    }
    assert!(held > 0);
}

/// A step is detected as soon as six estimates follow it, with or without a checkpoint in between.
#[test]
fn a_step_after_a_checkpoint_is_found_as_soon_as_six_estimates_follow_it() {
    let prior = FleetPrior::uninformative(LIMIT_M);
    for step in 960..1000 {
        let life = Life { step: (-14.0, step), outliers: 0.0, noise_um: 1.0, ..Life::quiet(7, 1020) };
        let rows: Vec<Observation> = life.rows_by_run().into_iter().flatten().collect();
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
