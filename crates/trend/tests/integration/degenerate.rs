//! Fleets with too much or no information: whatever the prior, the level of a unit is where its estimates are.

use proptest::prelude::*;
use trend::{Assessment, FleetPrior, Observation, Series, Settings, State, UsageDefaults, assess, forecast};

use crate::random::Random;

const DAY_US: i64 = 86_400_000_000;
const LIMIT_M: f64 = 1e-4;

/// A unit of one flight a day at 1.5 h: where it begins, how it wears, and how it is measured, all in µm.
#[derive(Debug, Clone, Copy)]
struct Unit {
    new_um: f64,
    um_per_hour: f64,
    /// Flights before wear begins.
    onset: i64,
    noise_um: f64,
    stated_um: Option<f64>,
    flights: i64,
}

/// A unit that does not wear, like many others.
const STILL: Unit =
    Unit { new_um: 20.0, um_per_hour: 0.0, onset: 0, noise_um: 1.0, stated_um: Some(1.0), flights: 150 };

impl Unit {
    fn series(self, seed: u64) -> Series {
        let mut random = Random::new(seed + 77);
        let rows: Vec<Observation> = (0..self.flights)
            .map(|flight| {
                let worn_um = self.um_per_hour * 1.5 * (flight - self.onset).max(0) as f64;
                Observation {
                    departure_us: flight * DAY_US,
                    installation: 0,
                    flight_hours: Some(1.5),
                    tail_hours_end: Some(1.5 * (flight + 1) as f64),
                    load_reversals: Some(100),
                    gap_m: Some((self.new_um + worn_um + self.noise_um * random.normal()) * 1e-6),
                    gap_se_m: self.stated_um.map(|um| um * 1e-6),
                    is_doubtful: false,
                }
            })
            .collect();
        Series::new(rows, &UsageDefaults::default()).unwrap()
    }

    fn last_day_us(self) -> i64 {
        (self.flights - 1) * DAY_US
    }

    fn assessment(self, seed: u64, prior: &FleetPrior) -> Assessment {
        let settings = Settings::for_limit(LIMIT_M);
        assess(&self.series(seed), self.last_day_us(), &settings, Some(prior)).unwrap()
    }
}

fn learned(fleet: &[Unit]) -> FleetPrior {
    let fleet: Vec<Series> = (0..).zip(fleet).map(|(seed, unit)| unit.series(seed)).collect();
    FleetPrior::learn(&fleet, i64::MAX, LIMIT_M, None)
}

/// Median of the last dozen gaps and how far one of them is from it in the middle, µm.
fn last_um(series: &Series) -> (f64, f64) {
    let gaps_um: Vec<f64> = series.gaps_until(i64::MAX).iter().rev().take(12).map(|m| m * 1e6).collect();
    let middle = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    };
    let median_um = middle(gaps_um.clone());
    (median_um, middle(gaps_um.iter().map(|um| (um - median_um).abs()).collect()))
}

#[test]
fn a_fleet_that_never_wears_does_not_talk_a_unit_near_its_limit_down() {
    let prior = learned(&[STILL; 200]);
    for um_per_hour in [0.0, 0.02] {
        let assessment =
            Unit { new_um: 90.0 - 225.0 * um_per_hour, um_per_hour, ..STILL }.assessment(9, &prior);
        let level = assessment.level.unwrap();
        assert!((level.gap_m - 90e-6).abs() < 3e-6, "{level:?}");
        assert!(assessment.state > State::Normal, "{:?}: {}", assessment.state, assessment.reason);
    }
}

#[test]
fn a_fleet_of_one_gap_and_no_scatter_still_lets_a_unit_differ() {
    let alike = Unit { noise_um: 0.0, ..STILL };
    let prior = learned(&[alike; 40]);
    for unit in [alike, Unit { new_um: 95.0, ..alike }, Unit { new_um: 60.0, um_per_hour: 0.1, ..STILL }] {
        let series = unit.series(5);
        let level = unit.assessment(5, &prior).level.unwrap();
        assert!((level.gap_m * 1e6 - last_um(&series).0).abs() < 3.0, "{unit:?}: {level:?}");
    }
}

/// A flight's 40 µm at once are no rigging: to take them off would hide a unit at 80 µm behind 40.
#[test]
fn a_rise_beyond_what_rigging_does_is_damage_and_stays_in_the_level() {
    let damaged = Unit { um_per_hour: 40.0 / 1.5, onset: 99, new_um: 40.0, flights: 101, ..STILL };
    let mut rows = Vec::new();
    for flight in
        damaged.series(3).flights().iter().chain(&Unit { new_um: 80.0, ..STILL }.series(4).flights()[101..])
    {
        rows.push(Observation {
            departure_us: flight.departure_us,
            installation: 0,
            flight_hours: Some(1.5),
            tail_hours_end: None,
            load_reversals: None,
            gap_m: flight.gap.map(|gap| gap.gap_m),
            gap_se_m: Some(1e-6),
            is_doubtful: false,
        });
    }
    let series = Series::new(rows, &UsageDefaults::default()).unwrap();
    let assessment = assess(&series, STILL.last_day_us(), &Settings::for_limit(LIMIT_M), None).unwrap();
    let level = assessment.level.unwrap();
    assert!((level.gap_m - 80e-6).abs() < 2e-6, "{level:?} {:?}", assessment.changes);
    assert_eq!(assessment.state, State::Watch, "{}", assessment.reason);
}

fn units() -> impl Strategy<Value = Unit> {
    let errors = prop_oneof![Just(None), Just(Some(1e-9)), Just(Some(1e6)), (0.01..30.0).prop_map(Some)];
    let wear = prop_oneof![Just(0.0), 0.0..0.05, Just(1.0)];
    let noise = prop_oneof![Just(0.0), 0.1..5.0, Just(300.0)];
    (-20.0..150.0, wear, 0_i64..150, noise, errors, 1_i64..150).prop_map(
        |(new_um, um_per_hour, onset, noise_um, stated_um, flights)| Unit {
            new_um,
            um_per_hour,
            onset,
            // Where gaps repeat to the last digit, the stated error is the true one.
            noise_um: if stated_um > Some(100.0) { f64::max(noise_um, 0.1) } else { noise_um },
            stated_um,
            flights,
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// For any fleet and unit, the assessment is a level near the unit's last gaps with ordered bounds,
    /// or none with a reason.
    #[test]
    fn whatever_the_fleet_the_level_is_near_the_last_gaps_and_bounds_are_in_order(
        fleet in prop::collection::vec(units(), 1..8), copies in 1_usize..6, unit in units(),
    ) {
        let fleet: Vec<Unit> = fleet.iter().copied().cycle().take(copies * fleet.len()).collect();
        let prior = learned(&fleet);
        let assessment = unit.assessment(1000, &prior);
        let level = assessment.level.unwrap();
        let (last_um, scatter_um) = last_um(&unit.series(1000));
        // Wear of a dozen flights, the scatter that was found, and what an installation or a season may add.
        let reach_um = 20.0 + 18.0 * unit.um_per_hour + 5.0 * scatter_um;
        prop_assert!((level.gap_m * 1e6 - last_um).abs() < reach_um, "{level:?} of {last_um} µm");
        prop_assert!(level.se_m > 0.0 && level.se_m.is_finite());
        let Some((crossing, rate)) = assessment.crossing.zip(assessment.rate) else { return Ok(()) };
        let hours = [crossing.p05_hours, crossing.p50_hours, crossing.p95_hours];
        let hours = hours.map(|h| h.unwrap_or(f64::INFINITY));
        prop_assert!(0.0 <= hours[0] && hours[0] <= hours[1] && hours[1] <= hours[2], "{hours:?}");
        let rates = [rate.p05_m_per_hour, rate.m_per_hour, rate.p95_m_per_hour];
        prop_assert!(rates.iter().all(|r| r.is_finite()) && rates.is_sorted(), "{rates:?}");
        prop_assert!((0.0..=1.0 + 1e-9).contains(&assessment.check_probability.unwrap()));
        let settings = Settings::for_limit(LIMIT_M);
        let drawn = forecast(&unit.series(1000), unit.last_day_us(), &settings, Some(&prior), [0.0, 300.0]);
        for (_, band) in drawn.unwrap().ahead {
            prop_assert!([band.p05_m, band.m, band.p95_m].is_sorted(), "{band:?}");
        }
    }
}

/// Gaps of 10⁹ m among those of an actuator once left weights that added up to zero.
#[test]
fn gaps_beyond_every_curve_leave_numbers_or_nothing() {
    let mut rows: Vec<Observation> = (0..111)
        .map(|day| Observation {
            departure_us: day * DAY_US,
            installation: 0,
            flight_hours: Some(1.5),
            tail_hours_end: Some(1.5 * (day + 1) as f64),
            load_reversals: Some(100),
            gap_m: Some(30e-6 + 2e-7 * day as f64),
            gap_se_m: Some(1e-6),
            is_doubtful: false,
        })
        .collect();
    rows[8..52].iter_mut().for_each(|row| row.gap_m = Some(1e9));
    let series = Series::new(rows, &UsageDefaults::default()).unwrap();
    let found = assess(&series, 111 * DAY_US, &Settings::for_limit(LIMIT_M), None).unwrap();
    assert!(found.level.is_none_or(|level| level.gap_m.is_finite()), "{found:?}");
    assert!(found.growth_probability.is_none_or(|p| (0.0..=1.0).contains(&p)), "{found:?}");
}
