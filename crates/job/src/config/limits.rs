//! What any setting's value must be.

use records::Diagnostic;

/// Least and largest plausible value of each physical setting, by key: one to several orders of magnitude beyond any
/// actuator, sensor or recorder. A value outside was given in another unit, and could leave the numbers of a filter.
/// A least value of zero bounds the amount only from above; keys with a sign are compared by their amount.
pub const PLAUSIBLE: &[(&str, f64, f64)] = &[
    ("stiffness_n_per_m", 1e3, 1e12),
    ("damping_n_s_per_m", 0.0, 1e9),
    ("screw_mass_kg", 1e-4, 1e6),
    ("lead_m_per_rev", 1e-5, 10.0),
    ("stiffness_nm_per_rad", 1e-2, 1e12),
    ("damping_nm_s_per_rad", 0.0, 1e10),
    ("inertia_kg_m2", 1e-9, 1e8),
    ("reference_radius_m", 1e-4, 100.0),
    ("reference_load_n", 1e-3, 1e9),
    ("limit_m", PLAUSIBLE_LIMIT_M.0, PLAUSIBLE_LIMIT_M.1),
    ("watch_m", PLAUSIBLE_LIMIT_M.0, PLAUSIBLE_LIMIT_M.1),
    ("screw_rms_m", 0.0, 0.1),
    ("screw_resolution_m", 0.0, 0.1),
    ("motor_rms_m", 0.0, 0.1),
    ("motor_resolution_m", 0.0, 0.1),
    ("unknown_force_n", 0.0, 1e8),
    ("screw_rms_rad", 0.0, 1.0),
    ("screw_resolution_rad", 0.0, 1.0),
    ("motor_rms_rad", 0.0, 1.0),
    ("motor_resolution_rad", 0.0, 1.0),
    ("unknown_torque_nm", 0.0, 1e8),
    ("bandwidth_hz", 1e-4, 1e4),
    ("v_d_m2", 1e-26, 1e-2),
    ("w_d", 0.0, 1e6),
    ("force_psd_n2_s", 0.0, 1e15),
    ("backlash_rate_psd_m2_per_s", 0.0, 1.0),
    ("initial_position_rms_m", 1e-9, 1.0),
    ("initial_speed_rms_m_per_s", 1e-9, 1e3),
    ("initial_backlash_rms_m", 1e-9, 1.0),
    ("rate_hz", 1e-6, 1e6),
    ("max_back_s", 1e-9, 1e9),
    ("max_gap_s", 1.0, 1e9),
    ("tick_s", 1e-9, 1e4),
    ("wraps_at", 1e-6, 1e20),
    ("gear_ratio", 1e-6, 1e6),
    ("scale", 1e-12, 1e12),
    ("offset", 0.0, 1e12),
    ("latency_s", 0.0, 1e3),
    ("instant_s", 0.0, 1e3),
    ("planning_horizon_hours", 1e-3, 1e7),
    ("horizon_hours", 1e-3, 1e7),
    ("stale_after_days", 1e-3, 1e5),
    ("next_check_hours", 1e-3, 1e7),
    ("stiffness_share", 1e-4, 10.0),
    ("friction_share", 1e-4, 100.0),
    ("lost_motion_share", 1e-4, 100.0),
    ("delay_s", 1e-7, 1.0),
    ("load_zero_share", 1e-5, 10.0),
    ("load_delay_s", 1e-7, 10.0),
    ("nis_share", 1e-3, 1e4),
    ("log_timeout_s", 1e-3, 86_400.0),
    ("max_rows", 1.0, 1e11),
];

/// Keys whose value may be of any size above zero.
const POSITIVE: [&str; 2] = ["timeout_s", "give_up_s"];

/// Keys whose zero, negative and non-finite values have diagnostics of their own: the part's model and the channel refuse
/// them.
const REFUSED_ELSEWHERE: [&str; 7] = [
    "stiffness_n_per_m",
    "screw_mass_kg",
    "stiffness_nm_per_rad",
    "inertia_kg_m2",
    "reference_radius_m",
    "v_d_m2",
    "scale",
];

pub(super) fn implausible(key: &str, value: f64) -> Option<Diagnostic> {
    let range = PLAUSIBLE.iter().find(|(name, ..)| *name == key);
    let is_signed = range.is_some_and(|(_, least, _)| *least == 0.0) || REFUSED_ELSEWHERE.contains(&key);
    let is_positive = POSITIVE.contains(&key) || range.is_some() && !is_signed;
    if is_positive && !(value.is_finite() && value > 0.0) {
        let what = format!("`{key}` is {value}, which must be a number above zero");
        return Some(Diagnostic::new("not_positive", what));
    }
    let (_, least, most) = range.filter(|_| value.is_finite() && value != 0.0)?;
    if (*least..=*most).contains(&value.abs()) {
        return None;
    }
    let what = format!("`{key}` is {value:e}, outside the plausible range {least:e} to {most:e}");
    Some(Diagnostic::new("out_of_range", what).hint(match key {
        "limit_m" | "watch_m" => "limits are in metres: 150 µm is 150e-6",
        "stiffness_n_per_m" => "stiffness is in N/m: 50 N/µm is 5e7; ranges are in docs/keys.md",
        _ => "check the unit that ends the key's name; ranges are in docs/keys.md",
    }))
}

/// Smallest and largest plausible limit of free play, m: one beyond them was given in another unit.
pub const PLAUSIBLE_LIMIT_M: (f64, f64) = (1e-6, 0.01);

/// A limit that an aircraft may be grounded by, m.
///
/// # Errors
/// In words, when it is so small or so large that it was meant in another unit.
pub fn plausible_limit_m(limit_m: f64) -> Result<f64, String> {
    if (PLAUSIBLE_LIMIT_M.0..=PLAUSIBLE_LIMIT_M.1).contains(&limit_m) {
        Ok(limit_m)
    } else {
        Err(format!("{limit_m} m is not a plausible limit of free play: 150 µm is 150e-6"))
    }
}
