//! Part parameters identified from logs, against the parameters with which another engine made the logs.

use job::part_identification::IdentifiedParams;
use job::{Config, flight_log};
use records::PartNumber;

use crate::fixtures::{flights, open};

/// `truth.json`: noise of 3 and 1 µm, steps of 2.3 and 0.3 µm, K of 5·10⁷ and 4.6·10⁷ N/m.
#[test]
fn noise_resolution_and_stiffness_are_read_off_the_logs() {
    let config = Config::read(&flights().join("pipeline.toml")).unwrap();
    for (log, part, stiffness) in
        [("A_nominal", "A", 5e7), ("B_worn_stiffness_assumed_15pc_high", "B", 4.6e7)]
    {
        let opened = open(log, &config).unwrap();
        let part = flight_log::part_of(&config, &PartNumber::new(part).unwrap()).unwrap();
        let at = opened.actuators().next().unwrap();
        let channels = opened.channels(at, part).unwrap();
        let found = job::estimate::contact_regression(&channels, part).unwrap();
        let found = IdentifiedParams::of(&channels, found.as_deref().ok()).comparisons(part);
        let near = |key: &str, wanted: f64, share: f64| {
            let of_key = found.iter().find(|param| param.key == key).unwrap();
            assert!((of_key.identified / wanted - 1.0).abs() < share, "{log}: {of_key:?}, not {wanted}");
        };
        near("noise.screw_rms_m", 3e-6, 0.1);
        near("noise.motor_rms_m", 1e-6, 0.2);
        near("noise.screw_resolution_m", 2.3e-6, 0.01);
        near("noise.motor_resolution_m", 0.3e-6, 0.01);
        near("stiffness_n_per_m", stiffness, 0.01);
    }
}
