//! A configuration is checked whole: every diagnostic at once, each with its line and a remedy.

use std::path::Path;

use job::Config;
use records::{Diagnostic, PartNumber};

const GOOD: &str = include_str!("../data/good.toml");

fn parse(text: &str) -> Result<Config, Vec<Diagnostic>> {
    Config::parse(text, Path::new("pipeline.toml"), Path::new("fleet"))
}

/// Each row of `refused.json`: a line of the good text, what replaces it, and the code.
#[test]
fn what_cannot_be_meant_is_refused_by_a_stable_code() {
    let cases: Vec<[String; 3]> = serde_json::from_str(include_str!("../data/refused.json")).unwrap();
    assert!(cases.len() > 40);
    for [line, by, code] in cases {
        assert!(GOOD.contains(&line), "{line} is not in the text");
        let found = parse(&GOOD.replacen(&line, &by, 1)).unwrap_err();
        assert_eq!(found.into_iter().map(|diagnostic| diagnostic.code).collect::<Vec<_>>(), [code], "{by}");
    }
}

/// P₀ is diag(V_d, (0.01 m/s)², (1 mm)²) unless a key gives it.
#[test]
fn the_initial_covariance_is_that_of_the_keys() {
    let ema = PartNumber::new("EMA").unwrap();
    let initial = |keys: &str| {
        let text = GOOD.replacen("bandwidth_hz = 10.0", &format!("bandwidth_hz = 10.0\n{keys}"), 1);
        job::flight_log::part_of(&parse(&text).unwrap(), &ema).unwrap().initial
    };
    assert_eq!(initial(""), estimator::InitialVariances::default());
    let given = initial(
        "initial_position_rms_m = 2e-3\ninitial_speed_rms_m_per_s = 0.5\ninitial_backlash_rms_m = 2e-4",
    );
    let position_m2 = given.position_m2.unwrap();
    assert!((position_m2 - 4e-6).abs() < 1e-18 && (given.speed_m2_per_s2 - 0.25).abs() < 1e-12);
    assert!((given.backlash_m2 - 4e-8).abs() < 1e-20, "{given:?}");
}

/// A part's digest follows what can move its number, and nothing else.
#[test]
fn the_digest_follows_what_moves_a_number() {
    let ema = PartNumber::new("EMA").unwrap();
    let digest = |line: &str, by: &str| parse(&GOOD.replacen(line, by, 1)).unwrap().digest_of_part(&ema);
    let base = digest("", "");
    for (line, by) in [
        ("stiffness_n_per_m = 5.0e7", "stiffness_n_per_m = 5.1e7"),
        ("bandwidth_hz = 10.0", "bandwidth_hz = 11.0"),
        ("bandwidth_hz = 10.0", "bandwidth_hz = 10.0\ninitial_backlash_rms_m = 1e-4"),
        ("unit = \"mm\"", "unit = \"m\""),
        ("column = \"t\"", "column = \"t\"\nrate_hz = 250.0"),
    ] {
        assert_ne!(digest(line, by), base, "{by}");
    }
    let second = GOOD[GOOD.find("[part.EMA]").unwrap()..].replace("part.EMA", "part.EMB");
    for (line, by) in [
        ("limit_m = 150e-6", "limit_m = 160e-6"),
        ("files = [\"logs/*.parquet\"]", "files = [\"elsewhere/*.parquet\"]"),
        ("[part.EMA]", "[part.EMA] # a comment"),
        ("[part.EMA]", &format!("{second}\n[part.EMA]")),
    ] {
        assert_eq!(digest(line, by), base, "{by}");
    }
}

#[test]
fn a_rotary_part_takes_radians_and_newton_metres() {
    let start = GOOD.find("[part.EMA]").unwrap();
    let rotary = r#"
[part.GEAR]
kind = "rotary"
stiffness_nm_per_rad = 2.0e4
damping_nm_s_per_rad = 1.5
inertia_kg_m2 = 0.02
reference_radius_m = 0.1

[part.GEAR.noise]
screw_rms_rad = 2e-4
motor_rms_rad = 1e-4
unknown_torque_nm = 4.0
bandwidth_hz = 8.0
"#;
    let config = parse(&format!("{}{rotary}", &GOOD[..start])).unwrap();
    let part = &config.parts[&PartNumber::new("GEAR").unwrap()];
    let estimator::NoiseModel::Sensors(s) = part.noise else { panic!("{:?}", part.noise) };
    // 0.2 mrad at 0.1 m is 20 µm; 4 N·m there is 40 N; 2·10⁴ N·m/rad is 2·10⁶ N/m.
    assert!((s.screw_rms_m - 20e-6).abs() < 1e-18);
    assert!((s.unknown_force_n - 40.0).abs() < 1e-12);
    assert!((part.actuator.stiffness_n_per_m() - 2e6).abs() < 1e-6);
}

/// Every example of `docs/map-my-logs.md`, completed from its first layout, is a configuration.
#[test]
fn every_layout_of_the_documentation_is_read() {
    let page = include_str!("../../../../docs/map-my-logs.md");
    let examples: Vec<&str> = page.split("```toml\n").skip(1).filter_map(|t| t.split("```").next()).collect();
    assert!(examples.len() >= 12, "{} examples", examples.len());
    let wide = *examples.iter().find(|e| e.contains("{position}_motor_deg")).unwrap();
    let tail = "\n[part.EMA]\nstiffness_n_per_m = 5e7\ndamping_n_s_per_m = 2e3\nscrew_mass_kg = 8.0\nlead_m_per_rev = 0.005\n\
        noise = { screw_rms_m = 3e-6, screw_resolution_m = 1e-6, motor_rms_m = 1e-6, motor_resolution_m = 1e-6, \
        unknown_force_n = 200.0, bandwidth_hz = 10.0 }\n";
    for example in examples {
        let logs = "installations = \"installations.csv\"\n";
        let text = if example.contains("[logs]\nfiles") {
            example.replacen("[logs]\n", &format!("[logs]\n{logs}"), 1)
        } else if example.contains("[logs]\n") {
            example.replacen("[logs]\n", &format!("[logs]\nfiles = [\"*.parquet\"]\n{logs}"), 1)
        } else {
            format!("[logs]\nfiles = [\"*.parquet\"]\n{logs}\n{example}")
        };
        // Tables that the example omits are those of the wide layout, without positions where rows or files name them.
        let named_elsewhere = ["position_column", "?<position>", "position ="];
        let is_named_elsewhere = named_elsewhere.iter().any(|word| example.contains(word));
        let left_out = wide.split("\n\n").filter(|table| {
            let heading = table.lines().next().unwrap();
            !text.lines().any(|line| line == heading)
        });
        let left_out: String = left_out.flat_map(|table| ["\n", table, "\n"]).collect();
        let left_out = if is_named_elsewhere { left_out.replace("{position}_", "") } else { left_out };
        // An override is for a part that is configured.
        let whole = text.replace("\"EMA-27-1060\"", "\"EMA\"") + &left_out + tail;
        assert!(parse(&whole).is_ok(), "{:?} in\n{whole}", parse(&whole).err());
    }
}
