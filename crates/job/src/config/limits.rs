//! What any setting's value must be.

use std::ops::RangeInclusive;

use records::Diagnostic;

/// A value that must be above zero when it is given.
pub(crate) fn positive(key: &str, value: Option<f64>) -> Option<Diagnostic> {
    let value = value.filter(|v| !(v.is_finite() && *v > 0.0))?;
    Some(Diagnostic::new("not_positive", format!("`{key}` is {value}, which must be a number above zero")))
}

/// A limit of free play, which is positive and plausible when it is given.
pub(crate) fn plausible_limit(key: &str, value: Option<f64>) -> Option<Diagnostic> {
    let value = value?;
    positive(key, Some(value)).or_else(|| {
        let found = plausible_limit_m(value).err()?;
        let hint = "limits are in metres: 150 µm is 150e-6";
        Some(Diagnostic::new("implausible_limit", format!("`{key}`: {found}")).hint(hint))
    })
}

/// A parameter within its physical range when it is given.
pub(crate) fn in_range(
    key: &str,
    value: Option<f64>,
    range: &RangeInclusive<f64>,
    unit: &str,
) -> Option<Diagnostic> {
    let value = value.filter(|v| v.is_finite() && *v > 0.0 && !range.contains(v))?;
    let what = format!(
        "`{key}` is {value:e} {unit}; actuators have {:e} to {:e} {unit}",
        range.start(),
        range.end()
    );
    Some(Diagnostic::new("implausible_parameter", what).hint(format!("give `{key}` in {unit}")))
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
        Err(format!("{limit_m} m is not a plausible limit of free play: 150 µm is 150e-6"))
    }
}
