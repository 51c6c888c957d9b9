//! Work requests on the pages of the fleet and of a unit.

use records::WorkRequest;

use crate::format::{NO_DATA, date};
use crate::model::UnitView;

/// A work request as a row.
pub(crate) struct RequestRow {
    pub(crate) id: String,
    pub(crate) opened: String,
    pub(crate) place: String,
    pub(crate) status: String,
    pub(crate) by: String,
    pub(crate) remark: String,
}

/// Request and status as one cell of the work list.
pub(crate) fn request_badge(request: &WorkRequest) -> String {
    format!("{} {}", request.request_id, status(request))
}

/// Requests of a unit, latest first.
pub(crate) fn request_rows(unit: &UnitView) -> Vec<RequestRow> {
    let row = |request: &WorkRequest| RequestRow {
        id: request.request_id.clone(),
        opened: date(request.opened_utc),
        place: match (&request.tail_number, &request.position) {
            (Some(tail), Some(position)) => format!("{tail} {position}"),
            (Some(tail), None) => tail.clone(),
            (None, _) => NO_DATA.to_owned(),
        },
        status: status(request),
        by: request.by.clone().unwrap_or_default(),
        remark: request.reason.clone().unwrap_or_default(),
    };
    unit.work_requests.iter().rev().map(row).collect()
}

fn status(request: &WorkRequest) -> String {
    match (request.status, request.until_utc, request.closed_utc) {
        ("deferred", Some(until), _) => format!("deferred to {}", date(until)),
        ("open", Some(until), _) => format!("open, was deferred to {}", date(until)),
        ("closed", _, Some(closed)) => {
            format!("{} {}", request.closed_by.as_deref().unwrap_or("closed"), date(closed))
        }
        (other, ..) => other.to_owned(),
    }
}
