//! Work list: selected requests with the present assessments of their units.

use std::collections::BTreeMap;

use jiff::Timestamp;
use job::Config;
use records::{TrendRow, WorkRequest};
use store::Store;

use crate::assess::trends::{UnitSelection, assess_store};
use crate::error::Error;
use crate::findings::finding::GAP;
use crate::findings::work_requests::requests;
use crate::fleet::histories::UnitKey;

/// Which requests to list; those without a status are all but closed ones.
#[derive(Debug, Clone, Default)]
pub struct WorkSelection {
    /// `open`, `acknowledged`, `deferred`, `closed` or `all`.
    pub status: Option<String>,
    /// Units of the requests.
    pub units: UnitSelection,
}

impl WorkSelection {
    fn fits(&self, request: &WorkRequest) -> bool {
        let is_wanted = match self.status.as_deref() {
            None => request.is_open(),
            Some("all") => true,
            Some(status) => request.status == status,
        };
        is_wanted && self.units.names(&request.unit()) && self.units.is_on(request.tail_number.as_ref())
    }
}

/// The selected requests with the units of the open ones: closed requests last, the others by due date and
/// age. An open request has the state, reason and date of its unit's present assessment, not those of the last run.
///
/// # Errors
/// When the store cannot be read, or a part's limits are invalid.
pub fn work_list(
    config: &Config,
    selection: &WorkSelection,
) -> Result<(Vec<WorkRequest>, BTreeMap<UnitKey, TrendRow>), Error> {
    let mut found = requests(&Store::open(config.store())?.work_events()?, Timestamp::now());
    found.retain(|request| selection.fits(request));
    let mut units = BTreeMap::new();
    if found.iter().any(WorkRequest::is_open) {
        let installations = crate::run::scheduler::installations(config)?;
        let store = crate::open_store(config, &installations)?;
        let rows = assess_store(config, &installations, &store, &UnitSelection::default())?.now;
        units.extend(rows.into_iter().map(|row| (row.unit(), row)));
    }
    for request in found.iter_mut().filter(|request| request.is_open() && request.quantity == GAP) {
        if let Some(row) = units.get(&request.unit()) {
            request.state = row.state.map(str::to_owned);
            (request.finding, request.due_utc) = (row.reason.clone(), row.due_utc);
        }
    }
    let due = |request: &WorkRequest| request.due_utc.unwrap_or(Timestamp::MAX);
    found.sort_by_key(|request| (!request.is_open(), due(request), request.opened_utc));
    Ok((found, units))
}
