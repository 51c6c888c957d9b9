//! What any setting's value must be.

use records::Diagnostic;

/// A value that must be above zero when it is given.
pub(crate) fn positive(key: &str, value: Option<f64>) -> Option<Diagnostic> {
    let value = value.filter(|v| !(v.is_finite() && *v > 0.0))?;
    Some(Diagnostic::new("not_positive", format!("`{key}` is {value}, which must be a number above zero")))
}

/// Largest plausible gap, m: a limit beyond it was given in another unit.
pub const MAX_PLAUSIBLE_LIMIT_M: f64 = 0.01;

/// A limit that an aircraft may be grounded by, m.
///
/// # Errors
/// In words, when it is not above zero, or so large that it was meant in another unit.
pub fn plausible_limit_m(limit_m: f64) -> Result<f64, String> {
    if limit_m > 0.0 && limit_m <= MAX_PLAUSIBLE_LIMIT_M {
        Ok(limit_m)
    } else {
        Err(format!("{limit_m} m is no limit of free play: 150 µm is 150e-6"))
    }
}
