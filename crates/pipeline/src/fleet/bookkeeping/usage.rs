//! Accumulated usage of a unit: its rows, flights without a row, and recorded maintenance.

use jiff::Timestamp;
use job::Config;
use records::{Installation, Installations};
use trend::{Observation, Series, UsageDefaults, UsageSource};

use crate::error::Error;
use crate::fleet::bookkeeping::hour_meter::drop_contradicting;
use crate::fleet::bookkeeping::installation_index::InstallationIndex;
use crate::fleet::bookkeeping::maintenance_log;
use crate::fleet::bookkeeping::unlogged_flights::UnloggedFlights;
use crate::fleet::flight_row::FlightRow;
use crate::fleet::histories::{History, TailPosition, UnitKey};

/// Sources of usage in addition to rows: installations, maintenance, flights without a log.
pub(crate) struct UsageSources<'a> {
    maintenance: maintenance_log::MaintenanceLog,
    unlogged: UnloggedFlights<'a>,
    installations: InstallationIndex<'a>,
}

impl<'a> UsageSources<'a> {
    pub(crate) fn read(config: &'a Config, installations: &'a Installations) -> Result<Self, Error> {
        let file = config.document.logs.maintenance.as_ref();
        let maintenance = file.map(|file| maintenance_log::read(&config.path(file))).transpose()?;
        Ok(Self {
            maintenance: maintenance.unwrap_or_default(),
            unlogged: UnloggedFlights::of_table(&config.flights),
            installations: InstallationIndex::new(installations),
        })
    }

    /// Where the hours of a unit are known from.
    fn source(&self, history: &History) -> UsageSource {
        let has_meter = || history.flights().iter().any(|f| history.extras(f).tail_hours_end().is_some());
        if history.tails().any(|tail| self.unlogged.has_tail(tail)) {
            UsageSource::FlightsTable
        } else if has_meter() {
            UsageSource::TailHourMeter
        } else {
            UsageSource::LoggedFlights
        }
    }

    /// A unit's flights, added up.
    pub(crate) fn series(&self, name: &UnitKey, history: &History, is_booked: bool) -> Result<Series, Error> {
        let installations = self.installations.of(name);
        let installed = if is_booked { &installations[..] } else { &[] };
        let first = installations.iter().min_by_key(|installation| installation.installed_utc);
        let unit_hours_at_start = first.and_then(|installation| installation.unit_hours_at_install);
        let mut observations = observations(history, installed, &self.unlogged.of_unit(history, installed));
        let dropped = drop_contradicting(&mut observations);
        let source = self.source(history);
        let usage = UsageDefaults { unit_hours_at_start, source, ..UsageDefaults::default() };
        let mut series = Series::new(observations, &usage)?;
        series.faults.meter_readings = dropped;
        Ok(series.with_maintenance(maintenance_events(&self.maintenance, name)))
    }
}

/// Recorded maintenance of a unit; nothing for a unit without a part number.
fn maintenance_events(
    maintenance: &maintenance_log::MaintenanceLog,
    (part, serial): &UnitKey,
) -> Vec<trend::MaintenanceEvent> {
    part.clone().and_then(|part| maintenance.get(&(part, serial.clone())).cloned()).unwrap_or_default()
}

/// A unit's flights as the trend knows them, those that left no record among them.
fn observations(
    history: &History,
    installations: &[&Installation],
    unlogged: &[(&Installation, &records::Flight)],
) -> Vec<Observation> {
    let mut numbers = InstallationIds::default();
    let seen = history.flights().iter().map(|f| {
        let extras = history.extras(f);
        Observation {
            departure_us: f.departure_us(),
            installation: numbers.of_flown(f, history, installations),
            flight_hours: extras.flight_hours(),
            tail_hours_end: extras.tail_hours_end(),
            load_reversals: extras.load_reversals(),
            gap_m: f.gap_m(),
            gap_se_m: extras.gap_se_m().filter(|se| *se > 0.0),
            is_doubtful: extras.is_disputed(),
        }
    });
    let mut observations: Vec<Observation> = seen.collect();
    observations.extend(unlogged.iter().map(|(installation, flight)| Observation {
        departure_us: flight.departure_utc.as_microsecond(),
        installation: numbers.of(&TailPosition::of(installation), Some(installation)),
        flight_hours: flight.flight_hours,
        tail_hours_end: flight.tail_hours_end,
        ..Observation::default()
    }));
    observations
}

/// Installations of one unit, numbered as they come.
#[derive(Default)]
struct InstallationIds<'a> {
    known: Vec<(TailPosition, Option<Timestamp>)>,
    /// Position and installation of the previous flight, and their number.
    last: Option<(u32, &'a Installation, u32)>,
}

impl<'a> InstallationIds<'a> {
    /// Installation number of a flight. Installations of one position do not overlap, so most flights have that of the
    /// previous flight.
    fn of_flown(&mut self, flown: &FlightRow, history: &History, installations: &[&'a Installation]) -> u32 {
        let is_here =
            |last: &(u32, &Installation, u32)| last.0 == flown.place && last.1.covers(flown.departure_utc());
        if let Some((_, _, number)) = self.last.filter(is_here) {
            return number;
        }
        let installation = history.installation(flown, installations);
        let number = self.of(history.place(flown), installation);
        self.last = installation.map(|installation| (flown.place, installation, number));
        number
    }

    fn of(&mut self, place: &TailPosition, installation: Option<&Installation>) -> u32 {
        let installed_utc = installation.map(|installation| installation.installed_utc);
        let known = self.known.iter().rposition(|(p, at)| p == place && *at == installed_utc);
        let number = known.unwrap_or_else(|| {
            self.known.push((place.clone(), installed_utc));
            self.known.len() - 1
        });
        number as u32
    }
}
