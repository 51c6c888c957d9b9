//! Estimates of the flights of another engine in `tests/data/flights`: what each method puts into a record, the parameters
//! that are identified, and logs and parts at the edge of what can be estimated.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use ingest::LogFiles;
use ingest::log::in_memory::ChannelArrays;
use ingest::tables::ColumnAliases;
use job::config::Method;
use job::estimate::{contact_regression, estimate, filter};
use job::part_identification::IdentifiedParams;
use job::{Config, FlightLog, Part, flight_log};
use records::{Diagnostic, GapEstimate, Installations, PartNumber, Position, Status};

/// The folder of the flights, with their configuration and installations table.
fn flights() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/flights")
}

/// The configuration of the flights, with some texts replaced by others.
fn config_with(edits: &[(&str, &str)]) -> Result<Config, Vec<Diagnostic>> {
    let file = flights().join("pipeline.toml");
    let mut text = std::fs::read_to_string(&file).unwrap();
    for (from, to) in edits {
        assert!(text.contains(from), "{from} is not in the configuration");
        text = text.replace(from, to);
    }
    Config::parse(&text, &file, &flights())
}

fn config() -> Config {
    config_with(&[]).unwrap()
}

fn open<'c>(log: &str, config: &'c Config) -> Result<FlightLog<'c>, Diagnostic> {
    static INSTALLATIONS: LazyLock<Installations> = LazyLock::new(|| {
        let file = flights().join("installations.csv");
        ingest::tables::installations(&file, &ColumnAliases::new()).unwrap()
    });
    let file = LogFiles::one(flights().join(format!("{log}.parquet")));
    FlightLog::open(&file, log, config, &INSTALLATIONS)
}

fn part<'c>(config: &'c Config, number: &str) -> &'c Part {
    flight_log::part_of(config, &PartNumber::new(number).unwrap()).unwrap()
}

/// `midrange` gives the published statistic alone, and refuses a load that never reverses without the regression, too.
#[test]
fn midrange_has_no_column_of_the_regression() {
    let of_first = |config: &Config, log: &str| {
        let opened = open(log, config).unwrap();
        let at = opened.actuators().next().unwrap();
        opened.estimate(at, opened.unit(at).unwrap().1).unwrap().0
    };
    let contact = config();
    let mut midrange = contact.clone();
    midrange.document.estimate.method = Method::Midrange;

    let (by_contact, found) = (of_first(&contact, "A_nominal"), of_first(&midrange, "A_nominal"));
    assert!(by_contact.stiffness_n_per_m.is_some() && by_contact.gap_se_m.is_some());
    assert_eq!(found.gap_m, by_contact.gap_midrange_m);
    let wanted = GapEstimate {
        status: Status::Estimated,
        gap_m: by_contact.gap_midrange_m,
        gap_midrange_m: by_contact.gap_midrange_m,
        load_reversals: by_contact.load_reversals,
        samples: by_contact.samples,
        samples_upper: by_contact.samples_upper,
        samples_lower: by_contact.samples_lower,
        load_p05_n: by_contact.load_p05_n,
        load_p95_n: by_contact.load_p95_n,
        nis: by_contact.nis,
        nis_se: by_contact.nis_se,
        ..GapEstimate::default()
    };
    assert_eq!(found, wanted);

    let refused = of_first(&midrange, "D_no_reversal");
    assert_eq!((refused.status, refused.reason.as_deref()), (Status::Refused, Some("no_load_reversal")));
    assert!(refused.gap_m.is_none() && refused.gap_midrange_m.is_some());
}

/// `truth.json`: noise of 3 and 1 µm, steps of 2.3 and 0.3 µm, K of 5·10⁷ and 4.6·10⁷ N/m.
#[test]
fn noise_resolution_and_stiffness_are_read_off_the_logs() {
    let config = config();
    for (log, number, stiffness) in
        [("A_nominal", "A", 5e7), ("B_worn_stiffness_assumed_15pc_high", "B", 4.6e7)]
    {
        let (opened, part) = (open(log, &config).unwrap(), part(&config, number));
        let channels = opened.channels(opened.actuators().next().unwrap(), part).unwrap();
        let found = contact_regression(&channels, part).unwrap();
        let found = IdentifiedParams::of(&channels, found.as_deref().ok()).comparisons(part);
        for (key, wanted, share) in [
            ("noise.screw_rms_m", 3e-6, 0.1),
            ("noise.motor_rms_m", 1e-6, 0.2),
            ("noise.screw_resolution_m", 2.3e-6, 0.01),
            ("noise.motor_resolution_m", 0.3e-6, 0.01),
            ("stiffness_n_per_m", stiffness, 0.01),
        ] {
            let of_key = found.iter().find(|param| param.key == key).unwrap();
            assert!((of_key.identified / wanted - 1.0).abs() < share, "{log}: {of_key:?}, not {wanted}");
        }
    }
}

/// One sample a second: the flight is rejected for its rate, before any noise model is made.
#[test]
fn a_slow_log_is_rejected_for_its_rate() {
    let config = config();
    let part = part(&config, "A");
    let time_s: Vec<f64> = (0..600).map(f64::from).collect();
    let wave = |amplitude: f64, phase: f64| -> Vec<f64> {
        time_s.iter().map(|t| amplitude * (0.05 * t + phase).sin()).collect()
    };
    let (motor_m, screw_m, load_n) = (wave(0.03, 0.0), wave(0.03, 1e-3), wave(8e3, 0.5));
    let arrays = ChannelArrays { time_s: &time_s, motor_m: &motor_m, screw_m: &screw_m, load_n: &load_n };
    let channels = arrays.to_channels(Position::new("rudder").unwrap()).unwrap();
    let found = estimate(&channels, part, &config.document.estimate).unwrap();
    assert_eq!(found.reason.as_deref(), Some("rate_too_low"));
    assert_eq!(filter(&channels, part).unwrap_err().code, "rate_too_low");
}

/// The configuration has no screw channel: δX is minus the motor position, and a screw position that is always zero does
/// not reject the flight.
#[test]
fn the_logs_of_a_locked_output_need_no_screw_position() {
    let no_screw = ("[channel.screw_position]\ncolumn = \"screw_position_m\"\nunit = \"m\"\n", "");
    assert_eq!(config_with(&[no_screw]).unwrap_err()[0].code, "key_missing");
    let locked = ("[part.A]\n", "[part.A]\noutput = \"locked\"\n");
    let config = config_with(&[no_screw, locked]).unwrap();
    let (opened, part) = (open("A_nominal", &config).unwrap(), part(&config, "A"));
    assert!(part.settings.output.is_locked());
    let channels = opened.channels(opened.actuators().next().unwrap(), part).unwrap();
    let is_minus_motor = |(dx, motor): (&f64, &f64)| dx.to_bits() == (0.0 - motor).to_bits();
    assert!(channels.output_locked && channels.dx_m.iter().zip(&channels.motor_m).all(is_minus_motor));
    let found = estimate(&channels, part, &config.document.estimate).unwrap();
    assert_ne!(found.reason.as_deref(), Some("channel_zero"));
    let moving = open("B_worn_stiffness_assumed_15pc_high", &config);
    assert!(moving.is_err(), "part B moves, and its screw is not mapped");
}
