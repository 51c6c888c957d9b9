//! The operator's tables, and the accumulated usage of a unit: its rows, flights without a row, and recorded maintenance.

use std::collections::HashSet;

use ingest::Flights;
use jiff::Timestamp;
use job::Config;
use records::{Installation, Installations};
use trend::{Observation, Series, UsageSource};

use crate::error::Error;
use crate::fleet::bookkeeping::hour_meter::drop_contradicting;
use crate::fleet::bookkeeping::inspections::{self, InspectionRow};
use crate::fleet::bookkeeping::maintenance_log;
use crate::fleet::bookkeeping::unlogged_flights::unlogged_flights;
use crate::fleet::flight_row::{DAY_US, FlightRow, is_day};
use crate::fleet::histories::{History, UnitKey};

pub(crate) struct OperatorTables<'a> {
    maintenance: maintenance_log::MaintenanceLog,
    flights: &'a Flights,
    installations: &'a Installations,
    pub(crate) inspections: Vec<InspectionRow>,
    /// Whether the installations and inspections tables apply; they do not to external estimates.
    is_booked: bool,
}

impl<'a> OperatorTables<'a> {
    pub(crate) fn read(
        config: &'a Config,
        installations: &'a Installations,
        is_booked: bool,
    ) -> Result<Self, Error> {
        Ok(Self {
            maintenance: maintenance_log::read(config, installations)?,
            flights: &config.flights,
            installations,
            inspections: if is_booked { inspections::read(config, installations)? } else { Vec::new() },
            is_booked,
        })
    }

    /// The installations table; `None` if it does not apply.
    pub(crate) fn installations(&self) -> Option<&'a Installations> {
        self.is_booked.then_some(self.installations)
    }

    /// Source of a unit's flight hours.
    fn source(&self, history: &History) -> UsageSource {
        let has_meter = || history.extras.iter().any(|f| !f.tail_hours_end.is_nan());
        if history.tails().any(|tail| self.flights.of_tail(tail).next().is_some()) {
            UsageSource::FlightsTable
        } else if has_meter() {
            UsageSource::TailHourMeter
        } else {
            UsageSource::LoggedFlights
        }
    }

    /// A unit's flights with their accumulated usage and recorded maintenance. Flights with several records keep one.
    pub(crate) fn series(&self, name: &UnitKey, history: &mut History) -> Result<Series, Error> {
        // Estimates made elsewhere may still have the former name of a unit.
        let today = (!self.is_booked).then(|| self.installations.unit_today(name.clone(), Timestamp::MAX));
        let name = today.as_ref().unwrap_or(name);
        let installations: Vec<&Installation> = self.installations.of_unit(name).collect();
        let installed = if self.is_booked { &installations[..] } else { &[] };
        if self.is_booked {
            history.keep_one_record_a_flight(installed);
        }
        let unlogged = unlogged_flights(self.flights, history, installed);
        let mut observations = observations(history, installed, &unlogged);
        if self.is_booked {
            count_samples_once(&mut observations);
        }
        let dropped = drop_contradicting(&mut observations);
        let mut series = Series::new(observations)?;
        series.unit_hours_at_start = installations.first().and_then(|first| first.unit_hours_at_install);
        series.source = self.source(history);
        series.faults.meter_readings = dropped;
        // The maintenance table has no rows of a unit without a part number.
        let mut events = self.maintenance.get(name).cloned().unwrap_or_default();
        // Maintenance with a date alone counts as done after the last flight of that day.
        for event in events.iter_mut().filter(|event| is_day(event.utc_us)) {
            let of_day = series.flights_until(event.utc_us + DAY_US - 1);
            event.utc_us = of_day.last().map_or(event.utc_us, |last| event.utc_us.max(last.departure_us + 1));
        }
        Ok(series.with_maintenance(events))
    }
}

/// Removes the gap of each flight whose gap and error are bitwise equal to those of an earlier flight: the same log was stored
/// again with another departure, and the same samples must neither confirm nor clear an exceedance.
fn count_samples_once(observations: &mut [Observation]) {
    let mut seen = HashSet::new();
    for row in observations {
        let bits = row.gap_m.zip(row.gap_se_m).map(|(gap_m, se_m)| [gap_m, se_m].map(f64::to_bits));
        if bits.is_some_and(|bits| !seen.insert(bits)) {
            (row.gap_m, row.gap_se_m, row.is_doubtful) = (None, None, false);
        }
    }
}

/// A unit's flights as observations of the trend, with the flights that have no record.
fn observations(
    history: &History,
    installations: &[&Installation],
    unlogged: &[(usize, &records::Flight)],
) -> Vec<Observation> {
    let outside = history.place_ranks();
    let mut before: Option<(&FlightRow, u32)> = None;
    let seen = history.flights().iter().zip(&history.extras).map(|(f, extras)| {
        // Records with the same date and no time are different flights if their flight ids differ.
        let flight = match before.filter(|(last, _)| last.departure_us() == f.departure_us()) {
            Some((last, number)) if is_day(f.departure_us()) => {
                number + u32::from(history.flight_id(last) != history.flight_id(f))
            }
            _ => 0,
        };
        before = Some((f, flight));
        // Numbers beyond the installations stand for positions without an installation.
        let installation = history.installation(f, installations);
        let installation = installation.unwrap_or_else(|| installations.len() + outside[f.place as usize]);
        extras.observation(f, installation as u32, flight)
    });
    let mut observations: Vec<Observation> = seen.collect();
    let numbers = observations.len() as u32..;
    observations.extend(unlogged.iter().zip(numbers).map(|((installation, flight), number)| Observation {
        departure_us: flight.departure_utc.as_microsecond(),
        installation: *installation as u32,
        // The flights table reads a date alone as noon.
        flight: if is_day(flight.departure_utc.as_microsecond() - DAY_US / 2) { number } else { 0 },
        flight_hours: flight.flight_hours,
        tail_hours_end: flight.tail_hours_end,
        ..Observation::default()
    }));
    observations
}
