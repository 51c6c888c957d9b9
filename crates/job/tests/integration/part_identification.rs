//! Part parameters identified from logs, against the parameters with which another engine made the logs.

use job::part_identification::IdentifiedParams;
use job::{Config, flight_log};
use records::PartNumber;

use crate::fixtures::{flights, installations, open};

/// `truth.json`: noise of 3 and 1 µm, steps of 2.3 and 0.3 µm, K of 5·10⁷ and 4.6·10⁷ N/m.
#[test]
fn noise_resolution_and_stiffness_are_read_off_the_logs() {
    let config = Config::read(&flights().join("pipeline.toml")).unwrap();
    let installations = installations();
    for (log, part, stiffness) in
        [("A_nominal", "A", 5e7), ("B_worn_stiffness_assumed_15pc_high", "B", 4.6e7)]
    {
        let opened = open(log, &config).unwrap();
        let part = flight_log::part_of(&config, &PartNumber::new(part).unwrap()).unwrap();
        let at = opened.actuators(&installations).next().unwrap();
        let channels = opened.channels(at, part).unwrap();
        let found = job::estimate::contact_regression(&channels, part).unwrap();
        let facts = IdentifiedParams::of(&channels, found.as_deref().ok());
        let near = |found: Option<f64>, wanted: f64, share: f64| {
            assert!(
                (found.unwrap() / wanted - 1.0).abs() < share,
                "{log}: {found:?}, not {wanted}: {facts:?}"
            );
        };
        near(facts.screw_rms_m, 3e-6, 0.1);
        near(facts.motor_rms_m, 1e-6, 0.2);
        near(facts.screw_resolution_m, 2.3e-6, 0.01);
        near(facts.motor_resolution_m, 0.3e-6, 0.01);
        near(facts.stiffness_n_per_m, stiffness, 0.01);
        let keys: Vec<&str> = facts.comparisons(part).iter().map(|p| p.key).collect();
        assert_eq!(keys[0], "stiffness_n_per_m");
        assert!(keys.contains(&"noise.motor_resolution_m"));
    }
}

#[test]
fn medians_pass_over_what_a_flight_did_not_show() {
    let facts = |k: Option<f64>| IdentifiedParams { stiffness_n_per_m: k, ..IdentifiedParams::default() };
    let medians =
        IdentifiedParams::medians(&[facts(Some(3.0)), facts(None), facts(Some(1.0)), facts(Some(2.0))]);
    assert_eq!(medians.stiffness_n_per_m, Some(2.0));
    assert_eq!(medians.screw_rms_m, None);
}
