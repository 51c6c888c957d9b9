//! Changes planted in simulated flights, and those that the whole program finds again.
//!
//! ```sh
//! cargo bench -p pipeline --bench planted_changes -- FLEETS FLIGHTS
//! ```
//!
//! Each fleet has eight tails with four actuators of two part numbers. Of each tail one unit's friction rises by 20 %, or
//! its stiffness falls by 10 %, over the flights; one tail's load cells gain 5 %, one tail's screw channels lag by a
//! millisecond more, one tail's load cells move by 400 N, and one part's delay falls, each from the middle on. All logs
//! are simulated, written, run and assessed like logs of a recorder.
#![allow(clippy::print_stdout, reason = "the table is the output")]

use std::collections::BTreeMap;
use std::error::Error;
use std::sync::atomic::AtomicBool;

use job::Config;
use pipeline::Request;
use pipeline::assess::trends::{self, UnitSelection};
use pipeline::inspect::simulate;
use pipeline::run::scheduler::{self, Context};
use records::QuantityChange;
use simulator::{PlantedChange, Spec};
use store::{Holder, Store};

const TAILS: usize = 8;
const POSITIONS: [&str; 4] = ["aileron_left", "aileron_right", "elevator_left", "elevator_right"];

/// What is planted, and how it should be found: quantity, scope and name.
struct Planted {
    what: &'static str,
    change: PlantedChange,
    /// Quantities whose change at the scope finds it; the first is the one meant.
    quantities: &'static [&'static str],
    scope: &'static str,
    name: String,
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1).filter(|a| a != "--bench");
    let fleets: u64 = args.next().map_or(Ok(1), |a| a.parse())?;
    let flights: usize = args.next().map_or(Ok(120), |a| a.parse())?;
    let mut table: BTreeMap<&str, [usize; 3]> = BTreeMap::new();
    let (mut others, mut unit_years) = (0, 0.0);
    for seed in 1..=fleets {
        let mut spec: Spec = toml::from_str(&fleet(flights))?;
        spec.seed = seed;
        let planted = plant(flights);
        spec.changes = planted.iter().map(|p| p.change.clone()).collect();
        let changes = changes_of(&spec)?;
        let mut explained = vec![false; changes.len()];
        for p in &planted {
            let is_found = |c: &QuantityChange| {
                p.quantities.contains(&c.quantity) && c.scope == p.scope && name_of(c) == p.name
            };
            let row = table.entry(p.what).or_default();
            row[0] += 1;
            row[1] += usize::from(changes.iter().any(is_found));
            row[2] += usize::from(changes.iter().any(|c| is_found(c) && is_dated(c, &spec, p)));
            explained.iter_mut().zip(&changes).for_each(|(e, c)| *e |= is_found(c));
        }
        for (c, _) in changes.iter().zip(&explained).filter(|(_, e)| !**e) {
            println!("fleet {seed}, not planted: {} {} {}: {}", c.quantity, c.scope, name_of(c), c.evidence);
            others += 1;
        }
        unit_years += (TAILS * POSITIONS.len()) as f64 * flights as f64 * spec.days_between_flights / 365.0;
    }
    println!("| planted | times | found with its scope | dated within one flight |\n|---|---|---|---|");
    for (what, [times, found, dated]) in table {
        let dated = if what.contains("over") { "–".to_owned() } else { dated.to_string() };
        println!("| {what} | {times} | {found} | {dated} |");
    }
    println!("\n{others} other changes in {unit_years:.0} unit-years");
    Ok(())
}

/// A fleet as in service: three flights a day, of which every second is logged.
fn fleet(flights: usize) -> String {
    let names = |made: Vec<String>| made.join(", ");
    let tails = names((1..=TAILS).map(|k| format!("\"T{k}\"")).collect());
    let position = |(k, name): (usize, &&str)| {
        format!("{{ position = \"{name}\", part_number = \"{}\" }}", ["P-1", "P-2"][k / 2])
    };
    let positions = names(POSITIONS.iter().enumerate().map(position).collect());
    let part = |name: &str| format!("{{ part_number = \"{name}\", motor_log = \"position\" }}");
    format!(
        "tails = [{tails}]\nflights_per_tail = {flights}\ndays_between_flights = 0.667\n\
         positions = [{positions}]\nparts = [{}, {}]\n\
         profile = {{ duration_s = 60.0, sample_rate_hz = 100.0, gust_share = 0.12, gust_hz = 0.4 }}\n\
         spread = {{ stiffness = 0.02, offset_m = 1e-4, load_gain = 0.005, load_bias_n = 50.0, skew_s = 2e-5, friction = 0.1 }}\n\
         [sensors.screw]\nnoise_rms = 3e-6\nresolution = 1.9e-6\n\
         [sensors.motor]\nnoise_rms = 1e-6\nresolution = 0.3e-6\n\
         [sensors.load]\nnoise_rms = 20.0\nresolution = 10.0\n",
        part("P-1"),
        part("P-2"),
    )
}

fn plant(flights: usize) -> Vec<Planted> {
    let middle = flights / 2;
    let change = || PlantedChange { from_flight: middle, ..PlantedChange::default() };
    let mut all = Vec::new();
    for tail in 1..=TAILS {
        let position = POSITIONS[tail % POSITIONS.len()];
        let of_unit = PlantedChange {
            tail: Some(format!("T{tail}")),
            position: Some(position.to_owned()),
            from_flight: 1,
            to_flight: Some(flights),
            ..change()
        };
        let name = format!("T{tail}/{position}");
        all.push(if tail.is_multiple_of(2) {
            Planted {
                what: "friction +20 % over the flights, a unit",
                change: PlantedChange { friction_factor: 1.2, ..of_unit },
                quantities: &["friction_n"],
                scope: "unit",
                name,
            }
        } else {
            Planted {
                what: "stiffness −10 % over the flights, a unit",
                change: PlantedChange { stiffness_factor: 0.9, ..of_unit },
                quantities: &["stiffness_n_per_m"],
                scope: "unit",
                name,
            }
        });
    }
    let of_tail = |tail: usize| PlantedChange { tail: Some(format!("T{tail}")), ..change() };
    let tail = |what, change: PlantedChange, quantities| Planted {
        what,
        name: change.tail.clone().unwrap_or_default(),
        change,
        quantities,
        scope: "tail",
    };
    let gain = PlantedChange { load_gain: 0.05, ..of_tail(2) };
    all.push(tail("load-cell gain +5 %, a tail", gain, &["stiffness_n_per_m", "friction_n"]));
    all.push(tail("screw delay +1 ms, a tail", PlantedChange { skew_s: 1e-3, ..of_tail(5) }, &["skew_s"]));
    let zero = PlantedChange { load_bias_n: 400.0, ..of_tail(7) };
    all.push(tail("load zero +400 N, a tail", zero, &["load_zero_n"]));
    all.push(Planted {
        what: "screw delay −1 ms, a part",
        change: PlantedChange {
            part_number: Some("P-2".to_owned()),
            from_flight: flights / 3,
            skew_s: -1e-3,
            ..change()
        },
        quantities: &["skew_s"],
        scope: "part",
        name: "P-2".to_owned(),
    });
    all
}

/// Simulates, runs and assesses a fleet.
fn changes_of(spec: &Spec) -> Result<Vec<QuantityChange>, Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    simulate::simulate(spec, folder.path(), None, &|_| {})?;
    let file = folder.path().join("pipeline.toml");
    let config = Config::read(&file).map_err(|found| format!("{found:?}"))?;
    let context = Context {
        program_version: env!("CARGO_PKG_VERSION"),
        holder: Holder::this_process(),
        wait: None,
        stop: &AtomicBool::new(false),
        watch: &|_| {},
    };
    scheduler::run(&config, &Request::default(), &context)?;
    let store = Store::open(folder.path().join("results"))?;
    let installations = scheduler::installations(&config)?;
    let ask = UnitSelection::default();
    Ok(trends::assess_store_with_quantities(&config, &installations, &store, &ask)?.followed.changes)
}

fn name_of(change: &QuantityChange) -> String {
    match change.scope {
        "unit" => {
            format!("{}/{}", change.tail_number.as_deref().unwrap_or_default(), change.positions.join(","))
        }
        "tail" => change.tail_number.clone().unwrap_or_default(),
        _ => change.part_number.clone().unwrap_or_default(),
    }
}

/// Whether a step is dated within one flight of a tail.
fn is_dated(change: &QuantityChange, spec: &Spec, planted: &Planted) -> bool {
    let Ok(plan) = simulator::Plan::new(spec) else { return false };
    let wanted = format!("-{:04}", planted.change.from_flight);
    let slot_us = spec.days_between_flights * 86_400e6;
    plan.flights
        .iter()
        .filter(|f| planted.change.tail.as_ref().is_none_or(|t| f.tail_number == *t))
        .filter(|f| f.flight_id.ends_with(&wanted))
        .any(|f| (change.since_utc.as_microsecond() - f.departure_us).abs() as f64 <= 1.5 * slot_us)
}
