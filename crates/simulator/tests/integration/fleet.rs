//! A planned fleet: books that balance, and flights that do not depend on the order of asking.

use std::collections::BTreeMap;

use simulator::{FaultKind, Plan, PlannedFlight, SAMPLE_SPEC, SimulatedFlight, Spec};

fn sample() -> Spec {
    toml::from_str(SAMPLE_SPEC).unwrap()
}

/// A fleet small enough to fly whole.
const SMALL: &str = r#"
    seed = 9
    tails = ["A", "B"]
    flights_per_tail = 2
    profile = { duration_s = 10.0, sample_rate_hz = 50.0 }
    parts = [{ part_number = "P" }]
    positions = [{ position = "left", part_number = "P" }, { position = "right", part_number = "P" }]
"#;

/// The small fleet with further tables of its spec.
fn small_with(tables: &str) -> Spec {
    toml::from_str(&format!("{SMALL}\n{tables}")).unwrap()
}

fn small() -> Spec {
    small_with("")
}

/// Simulates one flight of a fleet, counted from 0.
fn fly(spec: &Spec, flight: usize) -> SimulatedFlight {
    let plan = Plan::new(spec).unwrap();
    plan.simulate_flight(&plan.flights[flight]).unwrap()
}

#[test]
fn flights_may_be_flown_in_any_order() {
    let plan = Plan::new(&small()).unwrap();
    let forward: Vec<_> = plan.flights.iter().map(|of| plan.simulate_flight(of).unwrap()).collect();
    let again = Plan::new(&small()).unwrap();
    for k in [2, 0, 3, 1] {
        assert_eq!(again.simulate_flight(&again.flights[k]).unwrap(), forward[k]);
    }
    assert_ne!(forward[0].actuators[0].load, forward[0].actuators[1].load);
    assert_ne!(forward[0].actuators[0].load, forward[1].actuators[0].load);
}

/// The contract's lookup: the stay that covers the departure names the serial the truth names, and its
/// hours at installation give the unit's age.
#[test]
fn the_books_name_the_unit_that_flew_and_its_age() {
    let plan = Plan::new(&sample()).unwrap();
    for flight in &plan.flights {
        for truth in &flight.actuators {
            let stays: Vec<_> = plan
                .installations
                .iter()
                .filter(|s| s.tail_number == flight.tail_number && s.position == truth.position)
                .filter(|s| s.installed_us <= flight.departure_us)
                .filter(|s| s.removed_us.is_none_or(|removed| flight.departure_us < removed))
                .collect();
            assert_eq!(stays.len(), 1);
            assert_eq!(stays[0].serial_number, truth.serial_number);
            let age = stays[0].unit_hours_at_install + flight.tail_hours_end - stays[0].tail_hours_at_install;
            assert!((age - truth.unit_hours).abs() < 1e-6);
        }
    }
}

#[test]
fn flights_of_a_tail_follow_each_other_and_their_hours_add_up() {
    let plan = Plan::new(&sample()).unwrap();
    for tail in ["N412FP", "N413FP", "N414FP"] {
        let flights: Vec<_> = plan.flights.iter().filter(|f| f.tail_number == tail).collect();
        assert_eq!(flights.len(), sample().flights_per_tail);
        for pair in flights.windows(2) {
            assert!(pair[0].departure_us + (pair[0].flight_hours * 3.6e9) as i64 <= pair[1].departure_us);
            assert!((pair[1].tail_hours_end - pair[0].tail_hours_end - pair[1].flight_hours).abs() < 1e-9);
        }
    }
}

/// Only a shim makes a gap smaller: 1040-0010 (recorded) and 1040-0006 (not recorded).
#[test]
fn no_gap_ever_heals() {
    let plan = Plan::new(&sample()).unwrap();
    let mut gaps = BTreeMap::new();
    let mut smaller = Vec::new();
    for truth in plan.flights.iter().flat_map(|flight| &flight.actuators) {
        let before = gaps.insert(&truth.serial_number, truth.plant.contact.gap_m).unwrap_or(0.0);
        if truth.plant.contact.gap_m < before {
            smaller.push(truth.serial_number.as_str());
        }
    }
    assert_eq!(gaps.len(), 13);
    assert_eq!(smaller, ["1040-0010", "1040-0006"]);
    let recorded: Vec<&str> = plan.maintenance.iter().map(|row| row.serial_number.as_str()).collect();
    assert_eq!(recorded, ["1040-0010"]);
}

#[test]
fn a_rotary_part_is_logged_in_radians_and_newton_metres() {
    let mut spec = small();
    let linear = fly(&spec, 0);
    spec.parts[0].reference_radius_m = Some(0.05);
    let rotary = fly(&spec, 0);
    let (a, b) = (&linear.actuators[0], &rotary.actuators[0]);
    assert_eq!(
        (b.screw_unit, b.load_unit),
        (simulator::ChannelUnit::Radian, simulator::ChannelUnit::NewtonMetre)
    );
    assert!((a.screw[100] / b.screw[100] - 0.05).abs() < 1e-12);
    assert!((b.load[100] / a.load[100] - 0.05).abs() < 1e-12);
}

/// Each row of `refused.toml`: tables that replace those of the small fleet, and words of the error.
#[test]
fn mistakes_are_named() {
    let rows: BTreeMap<String, Vec<[String; 2]>> =
        toml::from_str(include_str!("../data/refused.toml")).unwrap();
    for [mistake, words] in &rows["refused"] {
        let mut spec: toml::Table = SMALL.parse().unwrap();
        spec.extend(mistake.parse::<toml::Table>().unwrap());
        let read = spec.try_into::<Spec>().map_err(|error| error.to_string());
        let planned = read.and_then(|spec| Plan::new(&spec).map_err(|error| error.to_string()));
        let error = planned.unwrap_err();
        assert!(error.contains(words), "{mistake}: {error}");
    }
}

/// The promises in the head of `specs/sample.toml` and of `sample-data/README.md`.
#[test]
fn the_sample_fleet_is_what_its_description_promises() {
    let plan = Plan::new(&sample()).unwrap();
    let rows = || plan.flights.iter().flat_map(|f| f.actuators.iter().map(move |t| (f, t)));
    assert!(rows().all(|(_, truth)| !truth.profile.is_one_sided()));
    let of_tail = |flight: &&PlannedFlight| flight.tail_number == "N412FP";
    let hours: f64 = plan.flights.iter().filter(of_tail).map(|flight| flight.flight_hours).sum();
    assert!((6.0..9.0).contains(&(hours / 84.0)), "{hours} h in 84 days");
    let with =
        |fault| plan.flights.iter().filter(|flight| flight.has_log && flight.log_fault == fault).count();
    assert_eq!([None, Some(FaultKind::Duplicate), Some(FaultKind::Truncated)].map(with), [40, 1, 1]);
    let history = |serial: &str| -> Vec<(&str, f64)> {
        let of_unit = rows().filter(|(_, truth)| truth.serial_number == serial);
        of_unit.map(|(flight, truth)| (flight.tail_number.as_str(), truth.plant.contact.gap_m)).collect()
    };
    for (serial, before, after) in [("1060-0008", "N412FP", "N413FP"), ("1060-0012", "N413FP", "N412FP")] {
        let tails: Vec<&str> = history(serial).into_iter().map(|(tail, _)| tail).collect();
        assert_eq!(tails, [vec![before; 196], vec![after; 140]].concat());
    }
    assert_eq!((history("1040-0014").len(), history("1040-0021").len()), (144, 192));
    let last_um = |serial: &str| 1e6 * history(serial).last().unwrap().1;
    assert!(last_um("1040-0013") > 150.0, "the limit");
    assert!(last_um("1040-0009") < 150.0 && last_um("1060-0015") < 180.0);
    let growth_um = |serial: &str| last_um(serial) - 1e6 * history(serial)[0].1;
    assert!(growth_um("1040-0009") > 30.0 && growth_um("1060-0015") > 30.0);
    for serial in ["1040-0005", "1060-0007", "1060-0008", "1060-0011", "1060-0012", "1060-0016"] {
        assert!(growth_um(serial) < 6.0, "{serial}");
    }
}

/// Six flights, a log for one of two; the spare, the shim and the reading are those of the spec.
#[test]
fn events_happen_before_the_flight_that_they_name() {
    let events = r#"
        replacements = [{ before_flight = 3, tail = "B", position = "left", serial_number = "SPARE", gap_m = 40e-6 }]
        reshims = [{ before_flight = 4, tail = "A", position = "right", gap_m = 20e-6 }]
        log_faults = [{ tail = "B", log = 2, fault = "truncated" }]
        [[play_checks]]
        before_flight = 4
        tail = "A"
        position = "right"
        error_m = 5e-6
        instrument = "dial gauge"
        force_n = 200.0
    "#;
    let spec = Spec { flights_per_tail: 6, flights_per_log: 2, ..small_with(events) };
    let plan = Plan::new(&spec).unwrap();
    let of = |tail: &str| plan.flights.iter().filter(|f| f.tail_number == tail).collect::<Vec<_>>();
    let (a, b) = (of("A"), of("B"));
    assert_eq!(b[1].actuators[0].serial_number, "S10003");
    assert_eq!(
        (b[2].actuators[0].serial_number.as_str(), b[2].actuators[0].plant.contact.gap_m),
        ("SPARE", 40e-6)
    );
    let stays: Vec<_> = plan.installations.iter().filter(|s| s.serial_number.starts_with("S10003")).collect();
    assert_eq!(
        stays[0].removed_us,
        plan.installations.iter().find(|s| s.serial_number == "SPARE").map(|s| s.installed_us)
    );
    let before_m = a[2].actuators[1].plant.contact.gap_m;
    assert_eq!(a[3].actuators[1].plant.contact.gap_m, 20e-6);
    assert_eq!(plan.maintenance[0].serial_number, "S10002");
    // The reading is that of the gap before the shim, to a micrometre.
    assert!((plan.inspections[0].play_m - before_m - 5e-6).abs() <= 0.5e-6);
    for flights in [&a, &b] {
        for pair in flights.chunks(2) {
            assert_eq!(pair.iter().filter(|flight| flight.has_log).count(), 1);
        }
    }
    assert_eq!(b.iter().filter(|flight| flight.log_fault == Some(FaultKind::Truncated)).count(), 1);
}

/// FNV-1a over the bits of every channel of the first flight. Keys that a spec leaves out change nothing, so flights of specs
/// from before a key keep their bits: those of `three_aircraft`, `service` and `rough` are from before load spectra, lag,
/// hysteresis and further laws.
#[test]
fn every_spec_that_comes_with_the_crate_flies_and_its_flights_keep_their_bits() {
    for (text, digest) in [
        (include_str!("../../specs/three_aircraft.toml"), 18_300_182_548_049_083_202_u64),
        (include_str!("../../specs/service.toml"), 13_874_963_508_701_740_792),
        (include_str!("../../specs/rough.toml"), 15_269_884_242_281_932_624),
        (SAMPLE_SPEC, 15_949_420_514_293_068_475),
        (include_str!("../../specs/harsh.toml"), 14_206_531_696_915_457_738),
    ] {
        let mut spec: Spec = toml::from_str(text).unwrap();
        spec.profile.duration_s = 20.0;
        let flight = fly(&spec, 0);
        assert_eq!(flight.actuators.len(), spec.positions.len());
        assert_eq!(flight.time_s.len(), flight.actuators[0].motor.len());
        let channels = flight.actuators.iter().flat_map(|a| [&a.motor, &a.screw, &a.load]);
        let bytes = channels.flatten().chain(&flight.time_s).flat_map(|x| x.to_bits().to_le_bytes());
        let found = bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        });
        assert_eq!(found, digest, "{:?}", spec.tails);
    }
}

/// Both fleets meet the same flights and the same noise, so that only what was planted differs.
#[test]
fn a_planted_change_shows_on_the_actuators_that_it_names_and_from_its_flight_on() {
    let planned = |tables: &str| Plan::new(&Spec { flights_per_tail: 4, ..small_with(tables) }).unwrap();
    let before = planned("");
    let changes = r#"
        changes = [
            { tail = "B", from_flight = 3, load_bias_n = 400.0, skew_s = 1e-3 },
            { tail = "B", from_flight = 4, buffet = { low_hz = 5.0, high_hz = 20.0, rms = 0.05 } },
            { serial_number = "S10001", from_flight = 1, to_flight = 4, stiffness_factor = 0.8 },
        ]
    "#;
    let after = planned(changes);
    let mut drift = Vec::new();
    for (k, (was, is)) in before.flights.iter().zip(&after.flights).enumerate() {
        let is_moved = is.tail_number == "B" && (is.flight_id.ends_with('3') || is.flight_id.ends_with('4'));
        for (was, is) in was.actuators.iter().zip(&is.actuators) {
            let skew_s = if is_moved { 1e-3 } else { 0.0 };
            assert!((is.sensors.skew_s() - was.sensors.skew_s() - skew_s).abs() < 1e-12);
            let ratio = is.plant.contact.stiffness_n_per_m / was.plant.contact.stiffness_n_per_m;
            if is.serial_number == "S10001" {
                drift.push(ratio);
            } else {
                assert!((ratio - 1.0).abs() < 1e-12);
            }
        }
        if is.tail_number == "A" {
            continue;
        }
        let [was, is] = [&before, &after].map(|plan| plan.simulate_flight(&plan.flights[k]).unwrap());
        let added_n = if is_moved { 400.0 } else { 0.0 };
        let loads_n = was.actuators[0].load.iter().zip(&is.actuators[0].load);
        let off_n: Vec<f64> = loads_n.map(|(was, is)| is - was - added_n).collect();
        let rms_n = (off_n.iter().map(|n| n * n).sum::<f64>() / off_n.len() as f64).sqrt();
        // Buffet of 5 % of ± 8 kN, in the last flight.
        let wanted_n = if k == 7 { 400.0 } else { 0.0 };
        assert!((rms_n - wanted_n).abs() <= 0.15 * wanted_n + 1e-9, "flight {k}: {rms_n} N");
    }
    assert_eq!(drift.len(), 4);
    for (found, expected) in drift.iter().zip([0.95, 0.90, 0.85, 0.80]) {
        assert!((found - expected).abs() < 1e-12);
    }
}
