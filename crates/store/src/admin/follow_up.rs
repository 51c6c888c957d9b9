//! Alerts, work events and states of units: small tables that are created with their first row.

use records::row_schema::{FromCells, Row};
use records::{AlertRecord, UnitState, WorkEvent};

use crate::delta::table::Table;
use crate::error::Error;
use crate::handle::Store;
use crate::write::writer::{self, Writer};

impl Store {
    /// The newest row of every alert and channel, by time, unit and channel; none of a store without alerts.
    ///
    /// # Errors
    /// As [`Store::records`].
    pub fn alerts(&self) -> Result<Vec<AlertRecord>, Error> {
        let mut alerts =
            self.rows(&self.alerts, |alert: &AlertRecord| format!("{} {}", alert.alert_id, alert.channel))?;
        // Identifiers end in a digest of their run: their order is by chance.
        let order = |a: &AlertRecord| {
            let unit = (a.part_number.clone(), a.serial_number.clone(), a.tail_number.clone());
            (a.as_of_utc, unit, a.quantity.clone(), a.change_number, a.channel.clone())
        };
        alerts.sort_by_cached_key(order);
        Ok(alerts)
    }

    /// Every event of every work request, earliest first.
    ///
    /// # Errors
    /// As [`Store::records`].
    pub fn work_events(&self) -> Result<Vec<WorkEvent>, Error> {
        // Two commands on a bucket, which has no lock, may have chosen the same number.
        let name = |event: &WorkEvent| {
            format!("{:012} {} {}", event.number, event.request_id, event.recorded_utc.as_microsecond())
        };
        self.rows(&self.work, name)
    }

    /// The newest state of every unit; none before the first run that ended.
    ///
    /// # Errors
    /// As [`Store::records`].
    pub fn states(&self) -> Result<Vec<UnitState>, Error> {
        self.rows(&self.states, |state: &UnitState| {
            format!("{} {}", state.part_number.as_deref().unwrap_or_default(), state.serial_number)
        })
    }

    fn rows<R: Row + FromCells>(&self, table: &Table, name: impl Fn(&R) -> String) -> Result<Vec<R>, Error> {
        if table.exists()? { self.newest(table, &[], name) } else { Ok(Vec::new()) }
    }
}

impl Writer {
    /// Writes rows of alerts; each takes the place of the row with the same identifier and channel.
    ///
    /// # Errors
    /// As [`Writer::commit`].
    pub fn write_alerts(&mut self, alerts: &[AlertRecord]) -> Result<(), Error> {
        append(&self.store().alerts, alerts)
    }

    /// Writes states of units; each takes the place of the unit's earlier one.
    ///
    /// # Errors
    /// As [`Writer::commit`].
    pub fn write_states(&mut self, states: &[UnitState]) -> Result<(), Error> {
        append(&self.store().states, states)
    }

    /// Adds events of work requests, in one commit.
    ///
    /// # Errors
    /// As [`Writer::commit`].
    pub fn add_work_events(&mut self, events: &[WorkEvent]) -> Result<(), Error> {
        append(&self.store().work, events)
    }
}

fn append<R: Row + FromCells>(table: &Table, rows: &[R]) -> Result<(), Error> {
    if !rows.is_empty() && !table.exists()? {
        table.create()?;
    }
    writer::account(table, rows)
}
