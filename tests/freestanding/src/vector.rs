//! Set `a_nominal_250hz` of the estimator's reference vectors, made by mpmath in 50 digits. Written by
//! `make_vector.py`; not to be edited.

/// K, N/m; f, N·s/m; m_s, kg.
pub const ACTUATOR: [f64; 3] = [50000000.0, 2000.0, 8.0];
/// Step, s.
pub const STEP_S: f64 = 0.004;
/// W_d, 3×3.
pub const W_D: [[f64; 3]; 3] = [
    [3.7415673789168046e-11, -1.981729558986472e-08, 0.0],
    [-1.981729558986472e-08, 1.0496275082710573e-05, -0.0],
    [0.0, -0.0, 2.0319570789378415e-12],
];
/// V_d, m².
pub const V_D_M2: f64 = 1.6e-11;
/// ΔS, m.
pub const GAP_M: f64 = 0.00012280965042262714;
/// δX, m, load, N, and S, m, of each sample.
pub const SAMPLES: [[f64; 3]; 300] = include!("samples.txt");
