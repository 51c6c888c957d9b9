//! What any setting's value must be.

use fleet::Complaint;

/// A value that must be above zero when it is given.
pub(crate) fn positive(key: &str, value: Option<f64>) -> Option<Complaint> {
    let value = value.filter(|v| !(v.is_finite() && *v > 0.0))?;
    Some(Complaint::new("not_positive", format!("`{key}` is {value}, which must be a number above zero")))
}
