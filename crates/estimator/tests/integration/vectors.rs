//! Reference vectors by mpmath in 50 digits, compared with scipy and filterpy; `tests/data/lkf/README.md` documents
//! their origin and accuracy.

use estimator::{ActuatorModel, Filter, NoiseModel, SensorNoise, gap};
use nalgebra::{Matrix3, Vector3};
use serde_json::Value;

use crate::batch;
use crate::parquet_fixture::load;

pub(crate) const SETS: [&str; 4] =
    ["a_nominal_250hz", "b_stiff_light_1khz", "c_soft_heavy_100hz_missing", "d_rotary_200hz"];

pub(crate) struct Set {
    json: Value,
    pub(crate) columns: std::collections::BTreeMap<String, Vec<f64>>,
}

impl Set {
    pub(crate) fn load(name: &str) -> Self {
        let (json, columns) = load("tests/data/lkf", "vectors.json", name);
        Self { json, columns }
    }

    pub(crate) fn number(&self, key: &str) -> f64 {
        self.json[key].as_f64().unwrap()
    }

    fn matrix(value: &Value) -> Matrix3<f64> {
        Matrix3::from_fn(|i, j| value[i][j].as_f64().unwrap())
    }

    fn vector(value: &Value) -> Vector3<f64> {
        Vector3::from_fn(|i, _| value[i].as_f64().unwrap())
    }

    fn step_s(&self) -> f64 {
        self.number("sample_rate_hz").recip()
    }

    /// The vectors' own units; a rotary set is a linear one in radians.
    fn actuator(&self) -> ActuatorModel {
        ActuatorModel::linear(self.number("stiffness"), self.number("damping"), self.number("inertia"))
            .unwrap()
    }

    fn sensors(&self) -> NoiseModel {
        NoiseModel::Sensors(SensorNoise {
            screw_rms_m: self.number("sigma_y"),
            unknown_force_n: self.number("sigma_force"),
            bandwidth_hz: self.number("bandwidth_hz"),
            ..SensorNoise::default()
        })
    }

    /// The noise as the rows have it, so that a last digit of W_d is not blamed on the recursion.
    pub(crate) fn as_given(&self) -> NoiseModel {
        NoiseModel::PerStep { w_d: Self::matrix(&self.json["W_d"]), v_d_m2: self.number("V_d") }
    }

    pub(crate) fn filter(&self, noise: &NoiseModel) -> Filter {
        Filter::new(&self.actuator(), self.step_s(), noise).unwrap()
    }
}

/// Largest difference, held against the largest entry.
fn matrix_error(found: &Matrix3<f64>, wanted: &Matrix3<f64>) -> f64 {
    let scale = |i, j| if wanted[(i, j)] == 0.0 { wanted.amax() } else { f64::abs(wanted[(i, j)]) };
    (0..9)
        .map(|k| (found[(k / 3, k % 3)] - wanted[(k / 3, k % 3)]).abs() / scale(k / 3, k % 3))
        .fold(0.0, f64::max)
}

#[test]
fn matrices_agree_to_1e_13() {
    for name in SETS {
        let set = Set::load(name);
        let filter = set.filter(&set.sensors());
        let a = matrix_error(&filter.discrete().a_d, &Set::matrix(&set.json["A_d"]));
        let b_wanted = Set::vector(&set.json["B_d"]);
        let b = (filter.discrete().b_d - b_wanted)
            .component_div(&b_wanted.map(|v| if v == 0.0 { 1.0 } else { v }))
            .amax();
        let w = matrix_error(&filter.noise().w_d, &Set::matrix(&set.json["W_d"]));
        let v = (filter.noise().v_d_m2 / set.number("V_d") - 1.0).abs();
        assert!(
            a < 1e-13 && b < 1e-13 && w < 1e-13 && v < 1e-13,
            "{name}: A_d {a:e} B_d {b:e} W_d {w:e} V_d {v:e}"
        );
    }
}

#[test]
fn the_exact_covariance_of_white_noise_agrees() {
    for name in SETS {
        let set = Set::load(name);
        let loan = &set.json["van_loan"];
        let noise = NoiseModel::Continuous {
            force_psd_n2_s: loan["force_psd"].as_f64().unwrap(),
            backlash_rate_psd_m2_per_s: loan["backlash_rate_psd"].as_f64().unwrap(),
            v_d_m2: set.number("V_d"),
        };
        let (found, wanted) = (set.filter(&noise).noise().w_d, Set::matrix(&loan["Q_d"]));
        // A covariance has entries of several units: each is held against the spread of its own states.
        for i in 0..3 {
            for j in 0..3 {
                let scale = (wanted[(i, i)] * wanted[(j, j)]).sqrt();
                let error = (found[(i, j)] - wanted[(i, j)]).abs() / scale;
                assert!(error < 1e-13, "{name}: Q_d[{i}{j}] off by {error:e}");
            }
        }
    }
}

#[test]
fn every_step_of_the_recursion_agrees() {
    for name in SETS {
        let set = Set::load(name);
        let filter = set.filter(&set.as_given());
        let (y, u) = (&set.columns["y"], &set.columns["u"]);
        let first = y.iter().position(|y| !y.is_nan()).unwrap();
        let mut state = filter.initial_state(y[first], u[first]);
        // The vectors carry their own P₀, whose backlash entry is in the set's unit.
        state.p = Matrix3::from_diagonal(&Set::vector(&set.json["P0"]));
        let mut worst = Worst::default();
        for k in 0..y.len() {
            if k > 0 {
                state = filter.predict(&state, u[k - 1]);
            }
            let step = filter.update(&state, y[k]).unwrap();
            for i in 0..3 {
                worst.state(&set, &format!("x_pred_{i}"), k, step.prior.x[i]);
                worst.state(&set, &format!("x_filt_{i}"), k, step.posterior.x[i]);
                worst.gain(&set, i, k, step.gain[i]);
                for j in i..3 {
                    worst.covariance(&set, "p_pred", i, j, k, step.prior.p[(i, j)]);
                    worst.covariance(&set, "p_filt", i, j, k, step.posterior.p[(i, j)]);
                }
            }
            state = step.posterior;
        }
        assert!(worst.state < 1e-10, "{name}: states off by {:e} of the peak", worst.state);
        assert!(worst.gain < 1e-9, "{name}: gains off by {:e}", worst.gain);
        assert!(worst.covariance < 1e-9, "{name}: covariances off by {:e}", worst.covariance);
    }
}

#[derive(Default)]
struct Worst {
    state: f64,
    gain: f64,
    covariance: f64,
}

impl Worst {
    fn state(&mut self, set: &Set, column: &str, k: usize, found: f64) {
        let wanted = &set.columns[column];
        let peak = wanted.iter().fold(0.0, |p: f64, v| p.max(v.abs()));
        self.state = self.state.max((found - wanted[k]).abs() / peak);
    }

    fn gain(&mut self, set: &Set, i: usize, k: usize, found: f64) {
        let wanted = &set.columns[&format!("gain_{i}")];
        let peak = wanted.iter().fold(0.0, |p: f64, v| p.max(v.abs()));
        self.gain = self.gain.max((found - wanted[k]).abs() / peak);
    }

    fn covariance(&mut self, set: &Set, kind: &str, i: usize, j: usize, k: usize, found: f64) {
        let entry = |i: usize, j: usize| set.columns[&format!("{kind}_{i}{j}")][k];
        let scale = (entry(i, i) * entry(j, j)).sqrt();
        self.covariance = self.covariance.max((found - entry(i, j)).abs() / scale);
    }
}

#[test]
fn the_settled_gain_and_its_poles_agree() {
    for name in SETS {
        let set = Set::load(name);
        let filter = set.filter(&set.as_given());
        let (gain, _) = filter.steady_state_gain().unwrap();
        let wanted = Set::vector(&set.json["steady_gain"]);
        let error = (gain - wanted).component_div(&wanted).amax();
        assert!(error < 1e-9, "{name}: settled gain off by {error:e}");
        let radius = filter.spectral_radius().unwrap() / set.number("closed_loop_spectral_radius") - 1.0;
        assert!(radius.abs() < 1e-9, "{name}: spectral radius off by {radius:e}");
    }
}

/// The batch uses the steady-state gain where it can; it must agree with the 50-digit recursion.
#[test]
fn the_batch_and_the_gap_agree() {
    for name in SETS {
        let set = Set::load(name);
        if set.json["P0"][2].as_f64().unwrap() > 1e-6 {
            continue; // In radians, with a P₀ of its own: covered step by step above.
        }
        let (y, u) = (&set.columns["y"], &set.columns["u"]);
        let s_m = batch(&set.filter(&set.as_given()), y, u);
        let mut worst = Worst::default();
        (0..y.len()).for_each(|k| worst.state(&set, "x_filt_2", k, s_m[k]));
        assert!(worst.state < 1e-10, "{name}: S off by {:e} of the peak", worst.state);
        let found = gap::mid_range(&s_m).unwrap();
        assert!((found.gap_m / set.number("gap") - 1.0).abs() < 1e-10, "{name}: gap {found:?}");
        let count = |key: &str| set.json[key].as_u64().unwrap() as usize;
        assert_eq!((found.upper, found.lower), (count("n_upper"), count("n_lower")), "{name}");
        assert!((found.mid_range_m / set.number("mid_range") - 1.0).abs() < 1e-9, "{name}");
    }
}
