//! Simulated fleets on disk: logs, installations, the truth, and a configuration that reads them.

use std::path::Path;

use ingest::parquet::writer::{Column, write_parquet};
use jiff::Timestamp;
use rayon::prelude::*;
use records::Diagnostic;
use serde_json::{Map, Value, json};
use simulator::{
    ActuatorLog, ChannelUnit, FaultKind, MotorLogFormat, Plan, PlannedActuator, PlannedFlight, ScrewLogUnit,
    Spec,
};

use crate::{Error, Event};

/// Reads a spec, or takes the sample fleet's.
///
/// # Errors
/// [`Error::Refused`] when it cannot be read or cannot be flown.
pub fn spec(file: Option<&Path>, seed: Option<u64>) -> Result<Spec, Error> {
    let shown = file.map_or_else(|| "the built-in spec".to_owned(), |f| f.display().to_string());
    let text = match file {
        None => simulator::SAMPLE_SPEC.to_owned(),
        Some(file) => std::fs::read_to_string(file).map_err(|e| {
            let what = format!("the spec cannot be read: {e}");
            Error::refused(Diagnostic::new("spec_unreadable", what).in_file(&shown))
        })?,
    };
    let mut spec: Spec = toml::from_str(&text).map_err(|e| {
        let diagnostic = Diagnostic::new("bad_spec", e.message()).in_file(&shown);
        Error::refused(diagnostic.hint("docs/simulator.md lists every key"))
    })?;
    spec.seed = seed.unwrap_or(spec.seed);
    Ok(spec)
}

/// Simulates a fleet and writes its data and a `pipeline.toml` that reads them. Returns the number of logs.
///
/// The same spec and seed give the same files, whatever the number of workers.
///
/// # Errors
/// [`Error::Refused`] when the spec cannot be flown or a file cannot be written.
pub fn simulate(
    spec: &Spec,
    folder: &Path,
    jobs: Option<usize>,
    watch: &(dyn Fn(Event) + Sync),
) -> Result<usize, Error> {
    let (logs, tables) = write_data(spec, folder, jobs, watch)?;
    text(&folder.join("pipeline.toml"), &configuration(spec, &tables)?)?;
    Ok(logs)
}

/// Configuration of the sample fleet, whose data lie in the folder [`SAMPLE_FOLDER`] next to it.
const SAMPLE_CONFIGURATION: &str = include_str!("../../templates/sample.toml");

/// Folder of the sample fleet's data.
pub const SAMPLE_FOLDER: &str = "sample-data";

/// Writes the sample fleet: `pipeline.toml` and the folder [`SAMPLE_FOLDER`]. Returns the number of logs.
///
/// # Errors
/// [`Error::Refused`] when a file cannot be written.
pub fn write_sample(folder: &Path, watch: &(dyn Fn(Event) + Sync)) -> Result<usize, Error> {
    let (logs, _) = write_data(&spec(None, None)?, &folder.join(SAMPLE_FOLDER), None, watch)?;
    text(&folder.join("pipeline.toml"), SAMPLE_CONFIGURATION)?;
    Ok(logs)
}

/// Simulates every flight that has a log, and writes logs, tables and `truth.parquet`. Returns the number of logs and the
/// names of the tables.
fn write_data(
    spec: &Spec,
    folder: &Path,
    jobs: Option<usize>,
    watch: &(dyn Fn(Event) + Sync),
) -> Result<(usize, Vec<&'static str>), Error> {
    let plan = Plan::new(spec).map_err(|e| Error::refused(Diagnostic::new("bad_spec", e)))?;
    let logged: Vec<usize> = (0..plan.flights.len()).filter(|&index| plan.flights[index].has_log).collect();
    watch(Event::Planned { logs: logged.len(), bytes: 0 });
    let pool = rayon::ThreadPoolBuilder::new().num_threads(jobs.unwrap_or(0)).build()?;
    pool.install(|| {
        logged.par_iter().try_for_each(|&index| {
            let name = write_flight(&plan, index, folder)?;
            watch(Event::Finished { log: name, bytes: 0, estimated: 0, refused: 0, diagnostics: Vec::new() });
            Ok::<(), Error>(())
        })
    })?;
    let tables = tables(&plan, spec);
    for (name, table) in &tables {
        text(&folder.join(format!("{name}.csv")), table)?;
    }
    write_parquet(&folder.join("truth.parquet"), &truth(&plan), &[])?;
    Ok((logged.len(), tables.into_iter().map(|(name, _)| name).collect()))
}

/// The tables of a fleet, by name; only installations are always there.
fn tables(plan: &Plan, spec: &Spec) -> Vec<(&'static str, String)> {
    let tables = [
        ("installations", true, installations(plan)),
        ("flights", spec.flights_per_log > 1, flights(plan)),
        ("maintenance", spec.reshims.iter().any(|shim| shim.is_recorded), maintenance(plan)),
        ("inspections", !spec.play_checks.is_empty(), inspections(plan)),
    ];
    tables.into_iter().filter(|(_, is_there, _)| *is_there).map(|(name, _, table)| (name, table)).collect()
}

/// Simulates one flight and writes its log: a column for each channel of each actuator.
fn write_flight(plan: &Plan, index: usize, folder: &Path) -> Result<String, Error> {
    let planned = &plan.flights[index];
    let flight = plan.simulate_flight(planned).map_err(|e| Error::refused(Diagnostic::new("bad_spec", e)))?;
    let mut columns = vec![("time_s".to_owned(), Column::Real(flight.time_s))];
    for actuator in flight.actuators {
        columns.extend(channels(actuator));
    }
    let name = log_name(planned);
    let is_truncated = planned.log_fault == Some(FaultKind::Truncated);
    let logs = folder.join(if is_truncated { "arrives-later" } else { "logs" });
    let file = logs.join(&name);
    write_parquet(&file, &columns, &facts(planned))?;
    match planned.log_fault {
        Some(FaultKind::Duplicate) => copy(&file)?,
        Some(FaultKind::Truncated) => truncate(&file)?,
        None => {}
    }
    Ok(name)
}

fn copy(file: &Path) -> Result<(), Error> {
    let name = file.file_stem().unwrap_or_default().to_string_lossy();
    let second = file.with_file_name(format!("{name}_copy.parquet"));
    std::fs::copy(file, &second).map(|_| ()).map_err(|e| not_written(&second, &e))
}

/// Keeps the first quarter of a file, as after a transfer that stopped.
fn truncate(file: &Path) -> Result<(), Error> {
    let cut = || {
        let open = std::fs::OpenOptions::new().write(true).open(file)?;
        open.set_len(open.metadata()?.len() / 4)
    };
    cut().map_err(|e| not_written(file, &e))
}

/// `N412FP/20260907T061500Z_FP0001.parquet`.
fn log_name(flight: &PlannedFlight) -> String {
    let departure = instant(flight.departure_us).strftime("%Y%m%dT%H%M%SZ");
    format!("{}/{departure}_{}.parquet", flight.tail_number, flight.flight_id)
}

fn facts(flight: &PlannedFlight) -> Vec<(String, String)> {
    vec![
        ("tail_number".to_owned(), flight.tail_number.clone()),
        ("flight_id".to_owned(), flight.flight_id.clone()),
        ("departure_utc".to_owned(), instant(flight.departure_us).to_string()),
        ("flight_hours".to_owned(), flight.flight_hours.to_string()),
        ("tail_hours_end".to_owned(), flight.tail_hours_end.to_string()),
    ]
}

/// The channels in the units of a recorder: degrees, millimetres, newtons or newton metres.
fn channels(actuator: ActuatorLog) -> [(String, Column); 3] {
    let named = |channel: &str, unit: ChannelUnit, values: Vec<f64>| {
        let (suffix, factor) = recorded(unit);
        (
            format!("{}_{channel}_{suffix}", actuator.position),
            Column::Single(values.into_iter().map(|v| v * factor).collect()),
        )
    };
    [
        named("motor", actuator.motor_unit, actuator.motor),
        named("screw", actuator.screw_unit, actuator.screw),
        named("load", actuator.load_unit, actuator.load),
    ]
}

fn recorded(unit: ChannelUnit) -> (&'static str, f64) {
    match unit {
        ChannelUnit::Metre => ("mm", 1e3),
        ChannelUnit::Micrometre => ("um", 1.0),
        ChannelUnit::Radian => ("deg", 180.0 / std::f64::consts::PI),
        ChannelUnit::Newton => ("n", 1.0),
        ChannelUnit::NewtonMetre => ("nm", 1.0),
    }
}

fn csv<R>(columns: &str, rows: &[R], line: impl Fn(&R) -> String) -> String {
    rows.iter().fold(format!("{columns}\n"), |table, row| table + &line(row) + "\n")
}

fn installations(plan: &Plan) -> String {
    let columns = "tail_number,position,part_number,serial_number,installed_utc,removed_utc,unit_hours_at_install,\
                   tail_hours_at_install";
    csv(columns, &plan.installations, |of| {
        let removed = of.removed_us.map(|us| instant(us).to_string()).unwrap_or_default();
        let names = [&of.tail_number, &of.position, &of.part_number, &of.serial_number].map(String::as_str);
        let (installed, hours) = (instant(of.installed_us), of.unit_hours_at_install);
        format!("{},{installed},{removed},{hours:.1},{:.1}", names.join(","), of.tail_hours_at_install)
    })
}

fn flights(plan: &Plan) -> String {
    csv("tail_number,flight_id,departure_utc,flight_hours,tail_hours_end", &plan.flights, |of| {
        let (names, departure) = (format!("{},{}", of.tail_number, of.flight_id), instant(of.departure_us));
        format!("{names},{departure},{:.2},{:.2}", of.flight_hours, of.tail_hours_end)
    })
}

fn maintenance(plan: &Plan) -> String {
    csv("part_number,serial_number,utc,kind", &plan.maintenance, |of| {
        format!("{},{},{},reshim", of.part_number, of.serial_number, instant(of.at_us))
    })
}

fn inspections(plan: &Plan) -> String {
    csv("part_number,serial_number,date_utc,play_m,instrument,force_n", &plan.inspections, |of| {
        let (unit, date) = (format!("{},{}", of.part_number, of.serial_number), instant(of.at_us));
        format!("{unit},{date},{:e},{},{}", of.play_m, of.instrument, of.force_n)
    })
}

/// The contract's columns of a truth table: actuators of the flights whose logs are whole.
fn truth(plan: &Plan) -> Vec<(String, Column)> {
    let all = || {
        let whole =
            |flight: &&PlannedFlight| flight.has_log && flight.log_fault != Some(FaultKind::Truncated);
        let flights = plan.flights.iter().filter(whole);
        flights.flat_map(|flight| flight.actuators.iter().map(move |actuator| (flight, actuator)))
    };
    let text = |of: &dyn Fn(&PlannedFlight, &PlannedActuator) -> String| {
        Column::Text(all().map(|(f, a)| of(f, a)).collect())
    };
    let real = |of: &dyn Fn(&PlannedActuator) -> f64| Column::Real(all().map(|(_, a)| of(a)).collect());
    let expected = |a: &PlannedActuator| if a.profile.is_one_sided() { "refuse" } else { "estimate" };
    [
        ("tail_number", text(&|f, _| f.tail_number.clone())),
        ("flight_id", text(&|f, _| f.flight_id.clone())),
        ("position", text(&|_, a| a.position.clone())),
        ("part_number", text(&|_, a| plan.parts[a.part].part_number.clone())),
        ("serial_number", text(&|_, a| a.serial_number.clone())),
        ("departure_utc", Column::Instant(all().map(|(f, _)| instant(f.departure_us)).collect())),
        ("gap_m", real(&|a| a.plant.contact.gap_m)),
        ("stiffness_n_per_m", real(&|a| a.plant.contact.stiffness_n_per_m)),
        ("skew_s", real(&|a| a.sensors.skew_s())),
        ("expected", text(&|_, a| expected(a).to_owned())),
    ]
    .map(|(name, column)| (name.to_owned(), column))
    .into()
}

/// A configuration that reads these logs: nominal parts, the sensors' own facts.
fn configuration(spec: &Spec, tables: &[&str]) -> Result<String, Error> {
    let facts = ["tail_number", "flight_id", "departure_utc", "flight_hours", "tail_hours_end"];
    let parts = spec.parts.iter().map(|part| (part.part_number.clone(), part_table(part, spec)));
    let mut document = json!({
        "logs": { "files": ["logs/**/*.parquet"] },
        "store": { "path": "results" },
        "identity": { "metadata": facts.map(|name| (name.to_owned(), json!(name))).into_iter().collect::<Map<_, _>>() },
        "clock": { "column": "time_s", "unit": "s" },
        "part": parts.collect::<Map<_, _>>(),
    });
    for name in tables {
        document["logs"][*name] = json!(format!("{name}.csv"));
    }
    if let Some(first) = spec.parts.first() {
        let usual = channel_tables(first);
        // Parts that are logged in other units are read by other columns.
        let others = spec.parts.iter().map(|part| (part, channel_tables(part)));
        let others = others.filter(|(_, own)| *own != usual);
        let others: Vec<Value> = others
            .map(|(part, channels)| json!({ "parts": [part.part_number], "channel": channels }))
            .collect();
        if !others.is_empty() {
            document["override"] = json!(others);
        }
        document["channel"] = usual;
    }
    let text = toml::to_string(&document).map_err(|e| Error::refused(Diagnostic::new("output_failed", e)))?;
    Ok(format!(
        "# Written with the simulated logs beside it: `freeplay run --config` on this file reads them.\n\n{text}"
    ))
}

fn channel_tables(part: &simulator::Part) -> Value {
    let rotary = part.reference_radius_m.is_some();
    let unit = |angle: bool| if angle { ("deg", "deg") } else { ("mm", "mm") };
    let is_micrometre = !rotary && part.screw_log == ScrewLogUnit::Micrometre;
    let column = |name: &str, (suffix, unit): (&str, &str)| json!({ "column": format!("{{position}}_{name}_{suffix}"), "unit": unit });
    let mut motor = column("motor", unit(rotary || part.motor_log != MotorLogFormat::Position));
    if part.motor_log == MotorLogFormat::WrappedAngle {
        motor["wraps_at"] = json!(360.0);
    }
    if let Some(radius_m) = part.reference_radius_m {
        // A motor turns so often for one turn of the part.
        motor["gear_ratio"] = json!(std::f64::consts::TAU * radius_m / part.lead_m);
    }
    json!({
        "motor_position": motor,
        "screw_position": column("screw", if is_micrometre { ("um", "um") } else { unit(rotary) }),
        "load": column("load", if rotary { ("nm", "N.m") } else { ("n", "N") }),
    })
}

fn part_table(part: &simulator::Part, spec: &Spec) -> Value {
    let (plant, contact) = (&part.plant, &part.plant.contact);
    let (screw, motor) = (&spec.sensors.screw, &spec.sensors.motor);
    // Friction that the filter does not know is of the order of a fortieth of the load.
    let unknown_n = spec.profile.load_n / 40.0;
    // The values of a rotary part are angles and torques at its reference radius.
    let r = part.reference_radius_m.unwrap_or(1.0);
    let square = r * r;
    let key = |linear, rotary| if part.reference_radius_m.is_some() { rotary } else { linear };
    let mut table = json!({
        (key("stiffness_n_per_m", "stiffness_nm_per_rad")): contact.stiffness_n_per_m * square,
        (key("damping_n_s_per_m", "damping_nm_s_per_rad")): contact.damping_n_s_per_m * square,
        (key("screw_mass_kg", "inertia_kg_m2")): plant.screw_mass_kg * square,
        "limit_m": part.limit_m,
        "noise": {
            (key("screw_rms_m", "screw_rms_rad")): screw.noise_rms / r,
            (key("screw_resolution_m", "screw_resolution_rad")): screw.resolution / r,
            (key("motor_rms_m", "motor_rms_rad")): motor.noise_rms / r,
            (key("motor_resolution_m", "motor_resolution_rad")): motor.resolution / r,
            (key("unknown_force_n", "unknown_torque_nm")): unknown_n * r,
            "bandwidth_hz": 10.0,
        },
    });
    if let Some(radius_m) = part.reference_radius_m {
        (table["kind"], table["reference_radius_m"]) = (json!("rotary"), json!(radius_m));
    } else {
        (table["lead_m_per_rev"], table["watch_m"]) = (json!(part.lead_m), json!(part.limit_m * 0.75));
    }
    table
}

/// A planned instant always lies within the calendar.
fn instant(us: i64) -> Timestamp {
    Timestamp::from_microsecond(us).unwrap_or(Timestamp::UNIX_EPOCH)
}

fn text(file: &Path, text: &str) -> Result<(), Error> {
    std::fs::write(file, text).map_err(|e| not_written(file, &e))
}

fn not_written(file: &Path, error: &std::io::Error) -> Error {
    let what = format!("the file cannot be written: {error}");
    Error::refused(Diagnostic::new("output_failed", what).in_file(file.display()))
}
