//! Work requests on the pages of the fleet and of a unit.

use records::WorkRequest;

use crate::format::date;

/// Status with its date.
pub(crate) fn status(request: &WorkRequest) -> String {
    match (request.status, request.until_utc, request.closed_utc) {
        ("deferred", Some(until), _) => format!("deferred to {}", date(until)),
        ("open", Some(until), _) => format!("open, was deferred to {}", date(until)),
        ("closed", _, Some(closed)) => {
            format!("{} {}", request.closed_by.as_deref().unwrap_or("closed"), date(closed))
        }
        (other, ..) => other.to_owned(),
    }
}
