//! Time to read every actuator of a long log: `long_log LOG.parquet NAME_COLUMN VALUE_COLUMN TIME_COLUMN`.
//!
//! Names are `POSITION_motor_deg`, `POSITION_screw_mm` and `POSITION_load_n`; times are in seconds. With the value column
//! `-` a row is an instant of one position, which NAME_COLUMN names, and the channels are columns of these names.
//! `docs/performance.md` compares the CPU time of the process with that of a filter in Polars.

#![expect(clippy::print_stdout, reason = "an example prints what it measured")]

use std::sync::Arc;
use std::time::Instant;

use ingest::mapping::units::{TimeUnit, Unit};
use ingest::{ChannelMapping, Channels, ClockMapping, Geometry, Layout, Log, LogFiles, Mapping};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let [log, name, value, time] = args.as_slice() else { return Err("four arguments are needed".into()) };
    let is_by_position = value == "-";
    let prefix = if is_by_position { "" } else { "{position}_" };
    let channel = |column: &str, unit| ChannelMapping {
        column: format!("{prefix}{column}"),
        unit,
        ..Default::default()
    };
    let mapping = Arc::new(Mapping {
        clock: ClockMapping {
            column: Some(time.clone()),
            unit: Some(TimeUnit::Second),
            ..Default::default()
        },
        layout: if is_by_position {
            Layout { position_column: Some(name.clone()), ..Layout::default() }
        } else {
            Layout { name_column: Some(name.clone()), value_column: Some(value.clone()), ..Layout::default() }
        },
        channels: Channels {
            motor_position: channel("motor_deg", Unit::Degree),
            screw_position: Some(channel("screw_mm", Unit::Millimetre)),
            load: channel("load_n", Unit::Newton),
            ..Channels::default()
        },
        ..Mapping::default()
    });
    let begun = Instant::now();
    let log = Log::open(&LogFiles::one(log), &mapping)?;
    let actuators = log.actuators(&mapping.channels, None)?;
    let used: Vec<_> = actuators
        .iter()
        .filter(|at| at.lacking.is_empty() && at.position.as_str().starts_with('a'))
        .map(|at| (&mapping.channels, at))
        .collect();
    log.announce(&used)?;
    let mut samples = 0;
    for (channels, at) in &used {
        let read = log.read_actuator(at, channels, Geometry::Linear { lead_m_per_rev: Some(0.005) })?;
        samples += read.dx_m.len();
        read.recycle_buffers();
    }
    println!("{} actuators, {samples} samples, {:.3} s", used.len(), begun.elapsed().as_secs_f64());
    Ok(())
}
