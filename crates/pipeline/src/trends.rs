//! Trends of units: the store's records, per part and serial number across tails, as statements.

use std::collections::{BTreeMap, BTreeSet};

use fleet::{GapRecord, Installations, PartNumber, SerialNumber};
use jiff::Timestamp;
use job::Config;
use job::part::WearAxis;
use rayon::prelude::*;
use serde::Serialize;
use store::{Query, Store};
use trend::{Axis, FleetPrior, Observation, Series, Trend, Usage, classic};

use crate::changed::{Changed, changed};
use crate::error::Error;
use crate::maintenance;
use crate::unlogged::Unlogged;

/// A unit, by part and serial number.
pub type Unit = (PartNumber, SerialNumber);

/// A change point, as the contract names its fields.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChangePoint {
    /// The first flight after it.
    pub departure_utc: Timestamp,
    /// That flight.
    pub flight_id: Option<String>,
    /// `step`, `reset`, `onset` or `recorded`.
    pub kind: &'static str,
    /// Its size, m.
    pub step_m: f64,
    /// Standard error of its size, m.
    pub step_se_m: f64,
    /// Probability that it is one; 1 where the books say so.
    pub certainty: f64,
}

/// One unit's statement, as the contract names its columns.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[expect(missing_docs, reason = "each field is named for the contract's column, with its unit")]
pub struct TrendRow {
    pub part_number: Option<String>,
    pub serial_number: String,
    pub tail_number: Option<String>,
    pub position: Option<String>,
    pub as_of_utc: Timestamp,
    pub flights: i64,
    pub unit_hours: Option<f64>,
    pub gap_m: Option<f64>,
    pub gap_se_m: Option<f64>,
    pub estimates: i64,
    pub outliers: i64,
    pub noise_factor: f64,
    pub rate_m_per_hour: Option<f64>,
    pub rate_p05_m_per_hour: Option<f64>,
    pub rate_p95_m_per_hour: Option<f64>,
    pub trend: &'static str,
    pub growth_probability: Option<f64>,
    pub wear_law: Option<String>,
    pub wear_law_probability: Option<f64>,
    pub usage_axis: Option<String>,
    pub trend_p_value: Option<f64>,
    pub sen_rate_m_per_hour: Option<f64>,
    pub sen_low_m_per_hour: Option<f64>,
    pub sen_high_m_per_hour: Option<f64>,
    pub change_points: Vec<ChangePoint>,
    pub limit_m: Option<f64>,
    pub crossing_hours_p05: Option<f64>,
    pub crossing_hours_p50: Option<f64>,
    pub crossing_hours_p95: Option<f64>,
    pub crossing_flights_p05: Option<f64>,
    pub crossing_flights_p50: Option<f64>,
    pub crossing_flights_p95: Option<f64>,
    pub not_before_utc: Option<Timestamp>,
    pub likely_utc: Option<Timestamp>,
    pub not_after_utc: Option<Timestamp>,
    pub check_probability: Option<f64>,
    pub state: Option<&'static str>,
    pub reason: Option<String>,
    /// The estimated gaps in order of flights, at most a hundred means of neighbours, m: a sketch for people.
    #[serde(skip)]
    pub sketch_m: Vec<f64>,
}

impl TrendRow {
    pub(crate) fn name(&self) -> HistoryName {
        (self.part_number.clone(), self.serial_number.clone())
    }
}

/// A unit and a day.
#[derive(Debug, Clone, PartialEq)]
pub struct AsOf {
    /// The design, where the table says it.
    pub part_number: Option<String>,
    /// The unit.
    pub serial_number: String,
    /// The day; nothing later is looked at.
    pub as_of_utc: Timestamp,
}

/// Which units, and of which day, a statement is asked for.
#[derive(Debug, Clone, Default)]
pub struct Ask {
    /// Units on this tail at the end of the records only.
    pub tail_number: Option<String>,
    /// This serial number only.
    pub serial_number: Option<String>,
    /// This part number only.
    pub part_number: Option<String>,
    /// The day; the newest departure in the store when not given.
    pub as_of_utc: Option<Timestamp>,
}

impl Ask {
    /// Whether a unit of that name is asked for, wherever it flies.
    fn names(&self, name: &HistoryName) -> bool {
        self.serial_number.as_ref().is_none_or(|s| *s == name.1)
            && (self.part_number.is_none() || self.part_number == name.0)
    }

    /// Whether a statement of a unit so named is asked for: it has flown, and on the tail that is meant.
    fn fits(&self, row: &TrendRow) -> bool {
        row.flights > 0 && (self.tail_number.is_none() || row.tail_number == self.tail_number)
    }
}

/// States what is known of the asked units.
///
/// # Errors
/// When the store cannot be read, or a part's limits cannot be judged by.
pub fn of_store(
    config: &Config,
    installations: &Installations,
    store: &Store,
    ask: &Ask,
) -> Result<Vec<TrendRow>, Error> {
    // A statement leans on what the part's other units teach, so what is asked selects rows, not records.
    let flown = flown_in_store(installations, store)?;
    of_histories(config, installations, &histories(flown), ask)
}

/// States what is known of units whose records a run changed, on the newest day in the store, and what is
/// otherwise than without that run's records. Where the store holds no others, nothing is.
///
/// # Errors
/// As [`of_store`].
pub fn of_units(
    config: &Config,
    installations: &Installations,
    store: &Store,
    units: &[Unit],
    run_id: &str,
) -> Result<(Vec<TrendRow>, Vec<Changed>), Error> {
    if units.is_empty() {
        return Ok(Default::default());
    }
    let records = store.records(&Query::default())?.into_iter();
    let (tonight, earlier): (Vec<GapRecord>, Vec<GapRecord>) =
        records.partition(|r| r.provenance.run_id == run_id);
    let flown = |records: Vec<GapRecord>| records.into_iter().map(|r| Flown::of(r, installations)).collect();
    of_night(config, installations, flown(earlier), flown(tonight), units)
}

/// The same of flights that were known before a night, and those of the night.
///
/// # Errors
/// As [`of_flown`].
pub fn of_night(
    config: &Config,
    installations: &Installations,
    earlier: Vec<Flown>,
    tonight: Vec<Flown>,
    units: &[Unit],
) -> Result<(Vec<TrendRow>, Vec<Changed>), Error> {
    let names: BTreeSet<HistoryName> =
        units.iter().map(|(part, serial)| (Some(part.to_string()), serial.to_string())).collect();
    let newest = |flown: &[Flown]| flown.iter().map(|f| f.departure_utc).max();
    let before_utc = newest(&earlier);
    let Some(as_of) = before_utc.max(newest(&tonight)) else { return Ok(Default::default()) };
    let all = histories(earlier.iter().cloned().chain(tonight).collect());
    let days: Vec<Timestamp> = before_utc.into_iter().chain([as_of]).collect();
    let fleet = Fleet::new(config, installations, &all, &days)?;
    let mut now = fleet.statements(names.iter(), as_of)?;
    now.retain(|row| row.flights > 0);
    let Some(before_utc) = before_utc else { return Ok((now, Vec::new())) };
    let earlier: BTreeMap<HistoryName, Vec<Flown>> =
        histories(earlier).into_iter().filter(|(name, _)| names.contains(name)).collect();
    let fleet = Fleet { priors: fleet.priors, ..Fleet::read(config, installations, &earlier)? };
    let before = fleet.statements(earlier.keys(), before_utc)?;
    let before = before.into_iter().map(|row| (row.name(), row)).collect();
    let news = changed(&before, &now);
    Ok((now, news))
}

/// States what is known of the asked units of an estimates table made elsewhere.
///
/// # Errors
/// When a history or a part's limits cannot be judged.
pub fn of_flown(
    config: &Config,
    installations: &Installations,
    flown: Vec<Flown>,
    ask: &Ask,
) -> Result<Vec<TrendRow>, Error> {
    of_histories(config, installations, &histories(flown), ask)
}

/// All that a report says of the asked units.
#[derive(Default)]
pub(crate) struct Told {
    /// Statements of the day.
    pub(crate) now: Vec<TrendRow>,
    /// What is drawn beside each of them.
    pub(crate) drawn: Vec<trend::Outlook>,
    /// Statements of so many days before, by days.
    pub(crate) before: BTreeMap<i64, Vec<TrendRow>>,
    /// What each part's units had taught, and by when.
    pub(crate) priors: Vec<(Option<String>, Timestamp, FleetPrior)>,
}

/// States what is known of the asked units, and what was known of them so many days before.
///
/// # Errors
/// As [`of_flown`].
pub(crate) fn told(
    config: &Config,
    installations: &Installations,
    histories: &BTreeMap<HistoryName, Vec<Flown>>,
    ask: &Ask,
    days_before: &[i64],
) -> Result<Told, Error> {
    let newest = || histories.values().flatten().map(|f| f.departure_utc).max();
    let Some(as_of) = ask.as_of_utc.or_else(newest) else { return Ok(Told::default()) };
    let earlier = |days: &i64| (*days, as_of - jiff::SignedDuration::from_hours(24 * days));
    let earlier: Vec<(i64, Timestamp)> = days_before.iter().map(earlier).collect();
    let days: Vec<Timestamp> = earlier.iter().map(|(_, at)| *at).chain([as_of]).collect();
    let fleet = Fleet::new(config, installations, histories, &days)?;
    let now = fleet.statements(histories.keys().filter(|name| ask.names(name)), as_of)?;
    let now: Vec<TrendRow> = now.into_iter().filter(|row| ask.fits(row)).collect();
    let names: Vec<HistoryName> =
        now.iter().map(|row| (row.part_number.clone(), row.serial_number.clone())).collect();
    let drawn =
        names.par_iter().zip(&now).map(|(name, row)| fleet.outlook(name, row)).collect::<Result<_, _>>()?;
    let then = |(days, at): (i64, Timestamp)| Ok((days, fleet.statements(names.iter(), at)?));
    let before = earlier.into_iter().map(then).collect::<Result<_, Error>>()?;
    let asked: BTreeSet<Option<&str>> = names.iter().map(|name| name.0.as_deref()).collect();
    let taught = |part: Option<&str>| {
        let month = month_us(as_of);
        let prior = fleet.priors.get(&(month, part))?;
        Some((part.map(str::to_owned), Timestamp::from_microsecond(month).ok()?, prior.clone()))
    };
    let priors = asked.into_iter().filter_map(taught).collect();
    Ok(Told { now, drawn, before, priors })
}

/// One statement for each query, from nothing later than its date.
///
/// # Errors
/// When a table cannot be read, or a part's limits cannot be judged by.
pub fn of_queries(
    config: &Config,
    installations: &Installations,
    flown: Vec<Flown>,
    queries: &[AsOf],
) -> Result<Vec<TrendRow>, Error> {
    let histories = histories(flown);
    let days: Vec<Timestamp> = queries.iter().map(|query| query.as_of_utc).collect();
    let fleet = Fleet::new(config, installations, &histories, &days)?;
    let statement = |query: &AsOf| fleet.statement(&unit_of(query, &histories), query.as_of_utc);
    queries.par_iter().map(statement).collect()
}

/// The unit a query means; one that never flew has a name all the same.
fn unit_of(query: &AsOf, histories: &BTreeMap<HistoryName, Vec<Flown>>) -> HistoryName {
    let fits = |unit: &&HistoryName| {
        unit.1 == query.serial_number && (query.part_number.is_none() || unit.0 == query.part_number)
    };
    histories.keys().find(fits).cloned().unwrap_or((query.part_number.clone(), query.serial_number.clone()))
}

/// Every flight of the store, for queries of several days.
///
/// # Errors
/// When the store cannot be read.
pub fn flown_in_store(installations: &Installations, store: &Store) -> Result<Vec<Flown>, Error> {
    Ok(store.records(&Query::default())?.into_iter().map(|record| Flown::of(record, installations)).collect())
}

/// One flight of one unit, wherever its gap was estimated.
#[derive(Debug, Clone, PartialEq)]
#[expect(missing_docs, reason = "each field is named for the contract's column, with its unit")]
pub struct Flown {
    pub part_number: Option<String>,
    pub serial_number: String,
    pub tail_number: Option<String>,
    pub position: Option<String>,
    pub flight_id: Option<String>,
    pub departure_utc: Timestamp,
    /// The stay on the tail that the flight belongs to, where the books know it.
    pub installed_utc: Option<Timestamp>,
    pub flight_hours: Option<f64>,
    pub tail_hours_end: Option<f64>,
    pub load_reversals: Option<u64>,
    pub gap_m: Option<f64>,
    pub gap_se_m: Option<f64>,
}

impl Flown {
    pub(crate) fn of(record: GapRecord, installations: &Installations) -> Self {
        let flight = record.flight;
        let stay = installations.at(&flight.tail_number, &record.position, flight.departure_utc);
        Self {
            part_number: Some(record.part_number.to_string()),
            serial_number: record.serial_number.to_string(),
            installed_utc: stay.map(|s| s.installed_utc),
            tail_number: Some(flight.tail_number.to_string()),
            position: Some(record.position.to_string()),
            flight_id: Some(flight.flight_id.to_string()),
            departure_utc: flight.departure_utc,
            flight_hours: flight.flight_hours,
            tail_hours_end: flight.tail_hours_end,
            load_reversals: u64::try_from(record.estimate.load_reversals).ok(),
            gap_m: record.estimate.gap_m,
            gap_se_m: record.estimate.gap_se_m,
        }
    }
}

/// Part number where known, and serial number.
pub(crate) type HistoryName = (Option<String>, String);

pub(crate) fn histories(flown: Vec<Flown>) -> BTreeMap<HistoryName, Vec<Flown>> {
    let mut units: BTreeMap<HistoryName, Vec<Flown>> = BTreeMap::new();
    for flight in flown {
        units.entry((flight.part_number.clone(), flight.serial_number.clone())).or_default().push(flight);
    }
    units
}

/// One statement for each asked unit, by part and serial number.
fn of_histories(
    config: &Config,
    installations: &Installations,
    histories: &BTreeMap<HistoryName, Vec<Flown>>,
    ask: &Ask,
) -> Result<Vec<TrendRow>, Error> {
    let newest = || histories.values().flatten().map(|f| f.departure_utc).max();
    let Some(as_of) = ask.as_of_utc.or_else(newest) else { return Ok(Vec::new()) };
    let fleet = Fleet::new(config, installations, histories, &[as_of])?;
    let mut rows = fleet.statements(histories.keys().filter(|name| ask.names(name)), as_of)?;
    rows.retain(|row| ask.fits(row));
    Ok(rows)
}

/// Part numbers that share a prior.
type Parts<'a> = Vec<Option<&'a str>>;

/// All units, and what each part's units had taught about the next by each month.
pub(crate) struct Fleet<'a> {
    config: &'a Config,
    units: BTreeMap<&'a HistoryName, (Vec<&'a Flown>, Series)>,
    priors: BTreeMap<(i64, Option<&'a str>), FleetPrior>,
}

/// The last month's turn by a day, microseconds since 1970 UTC: months of thirty days.
///
/// A prior moves slowly and costs as much as its fleet's statements: that of the turn serves the month.
fn month_us(as_of: Timestamp) -> i64 {
    const MONTH_US: i64 = 30 * 86_400_000_000;
    as_of.as_microsecond().div_euclid(MONTH_US) * MONTH_US
}

impl<'a> Fleet<'a> {
    /// Reads all histories and learns for every month among `days`, each from nothing later.
    pub(crate) fn new(
        config: &'a Config,
        installations: &Installations,
        histories: &'a BTreeMap<HistoryName, Vec<Flown>>,
        days: &[Timestamp],
    ) -> Result<Self, Error> {
        let mut fleet = Self::read(config, installations, histories)?;
        let parts: BTreeSet<Option<&str>> = fleet.units.keys().map(|name| name.0.as_deref()).collect();
        let months: BTreeSet<i64> = days.iter().map(|day| month_us(*day)).collect();
        let taught: Vec<_> = months.par_iter().map(|month| (*month, fleet.taught(*month, &parts))).collect();
        for (month, groups) in taught {
            for (parts, prior) in groups {
                fleet.priors.extend(parts.into_iter().map(|part| ((month, part), prior.clone())));
            }
        }
        Ok(fleet)
    }

    /// Reads all histories and learns nothing.
    fn read(
        config: &'a Config,
        installations: &Installations,
        histories: &'a BTreeMap<HistoryName, Vec<Flown>>,
    ) -> Result<Self, Error> {
        let file = config.document.logs.maintenance.as_ref();
        let book = file.map(|file| maintenance::read(&config.path(file))).transpose()?.unwrap_or_default();
        let unlogged = Unlogged::of_table(&config.flights);
        let read = |(name, flown): (&'a HistoryName, &'a Vec<Flown>)| {
            let mut flown: Vec<&Flown> = flown.iter().collect();
            flown.sort_by_key(|f| f.departure_utc);
            let stays = || installations.iter().filter(|stay| is_of(stay, name));
            let unlogged = unlogged.of_unit(stays(), &flown);
            let first = stays().min_by_key(|stay| stay.installed_utc);
            let unit_hours_at_start = first.and_then(|stay| stay.unit_hours_at_install);
            let series = series(flown.iter().copied().chain(&unlogged), unit_hours_at_start)?;
            let series = series.with_book(booked(&book, name));
            Ok((name, (flown, series)))
        };
        let units = histories.par_iter().map(read).collect::<Result<Vec<_>, Error>>()?;
        Ok(Self { config, units: units.into_iter().collect(), priors: BTreeMap::new() })
    }

    /// What the parts had taught by a month, those alike together.
    fn taught(&self, month_us: i64, parts: &BTreeSet<Option<&'a str>>) -> Vec<(Parts<'a>, FleetPrior)> {
        let parts: Vec<Option<&str>> = parts.iter().copied().collect();
        let alone = parts.into_par_iter().map(|part| (part, self.learn(month_us, &[part]))).collect();
        let alike = self.alike(alone);
        alike.into_par_iter().map(|(parts, own)| self.pooled(month_us, parts, own)).collect()
    }

    /// Parts in groups that share what they teach: of one limit, along one axis where that is configured,
    /// with lives within a factor of two.
    ///
    /// Two part numbers of one design have the same laws, and more units tell them better: pooling took
    /// the median error on one simulated fleet of two designs from 23 to 21 %.
    fn alike<'b>(&self, mut learned: Vec<(Option<&'b str>, FleetPrior)>) -> Vec<(Parts<'b>, FleetPrior)> {
        const ALIKE: f64 = 2.0;
        learned.sort_by(|(a, a_prior), (b, b_prior)| {
            let lives = a_prior.median_life_hours().total_cmp(&b_prior.median_life_hours());
            let limits = self.limit_m(*a).total_cmp(&self.limit_m(*b));
            limits.then(self.axis(*a).cmp(&self.axis(*b))).then(lives).then(a.cmp(b))
        });
        let mut groups: Vec<(Parts<'b>, FleetPrior)> = Vec::new();
        for (part, prior) in learned {
            let fits = |(parts, first): &&mut (Parts<'b>, FleetPrior)| {
                self.limit_m(parts[0]).to_bits() == self.limit_m(part).to_bits()
                    && self.axis(parts[0]) == self.axis(part)
                    && prior.median_life_hours() <= ALIKE * first.median_life_hours()
            };
            match groups.last_mut().filter(fits) {
                Some((parts, _)) => parts.push(part),
                None => groups.push((vec![part], prior)),
            }
        }
        groups
    }

    /// What several parts teach together; one alone has said it already.
    fn pooled<'b>(&self, month_us: i64, parts: Parts<'b>, own: FleetPrior) -> (Parts<'b>, FleetPrior) {
        let prior = if parts.len() == 1 { own } else { self.learn(month_us, &parts) };
        (parts, prior)
    }

    fn learn(&self, month_us: i64, parts: &[Option<&str>]) -> FleetPrior {
        let of_parts = self.units.iter().filter(|(name, _)| parts.contains(&name.0.as_deref()));
        let first = parts.first().copied().flatten();
        let (limit_m, axis) = (self.limit_m(first), self.axis(first));
        FleetPrior::learn(of_parts.map(|(_, (_, series))| series), month_us, limit_m, axis)
    }

    /// What wear of a part is said to follow; nothing where its histories decide.
    fn axis(&self, part: Option<&str>) -> Option<Axis> {
        let configured = self.part(part).and_then(|p| p.axis).or(self.config.document.trend.axis)?;
        Some(match configured {
            WearAxis::Hours => Axis::Hours,
            WearAxis::Flights => Axis::Flights,
            WearAxis::Reversals => Axis::Reversals,
        })
    }

    fn limit_m(&self, part: Option<&str>) -> f64 {
        settings(self.config, self.part(part)).limit_m
    }

    fn part(&self, number: Option<&str>) -> Option<&'a job::Part> {
        number
            .and_then(|number| PartNumber::new(number).ok())
            .and_then(|number| self.config.parts.get(&number))
    }

    /// A unit's flights.
    pub(crate) fn series(&self, name: &HistoryName) -> Option<&Series> {
        self.units.get(name).map(|(_, series)| series)
    }

    /// What a unit is judged by.
    pub(crate) fn settings(&self, name: &HistoryName) -> trend::Settings {
        settings(self.config, self.part(name.0.as_deref()))
    }

    /// What was known of a unit's like on a day.
    pub(crate) fn prior(&self, name: &HistoryName, as_of: Timestamp) -> Option<&FleetPrior> {
        let (flown, _) = self.units.get_key_value(name)?;
        self.priors.get(&(month_us(as_of), flown.0.as_deref()))
    }

    fn statements<'b>(
        &self,
        names: impl Iterator<Item = &'b HistoryName>,
        as_of: Timestamp,
    ) -> Result<Vec<TrendRow>, Error> {
        let names: Vec<&HistoryName> = names.collect();
        names.par_iter().map(|name| self.statement(name, as_of)).collect()
    }

    fn statement(&self, name: &HistoryName, as_of: Timestamp) -> Result<TrendRow, Error> {
        let nothing = (Vec::new(), Series::new([], &Usage::default())?);
        let (flown, series) = self.units.get(name).unwrap_or(&nothing);
        let flown = &flown[..flown.partition_point(|f| f.departure_utc <= as_of)];
        let part = self.part(name.0.as_deref());
        let prior = self.prior(name, as_of);
        let settings = self.settings(name);
        let trend = trend::remembered(series, as_of.as_microsecond(), &settings, prior)?;
        let usage_axis = prior.filter(|_| !flown.is_empty()).map(|prior| prior.axis().to_string());
        let row = row(name, flown, series, part.and_then(|p| p.limit_m), &trend, as_of);
        Ok(TrendRow { usage_axis, ..row })
    }

    /// What is drawn beside a statement: as far ahead as its crossing, within sight of what was flown.
    fn outlook(&self, name: &HistoryName, row: &TrendRow) -> Result<trend::Outlook, Error> {
        const STEPS: u32 = 24;
        let Some(series) = self.series(name) else { return Ok(trend::Outlook::default()) };
        let as_of_us = row.as_of_utc.as_microsecond();
        let flown = series.until(as_of_us);
        let span_hours = flown.first().zip(flown.last()).map_or(0.0, |(a, b)| b.hours - a.hours);
        let far = row
            .crossing_hours_p95
            .map_or(span_hours, |h| (1.1 * h).clamp(0.3 * span_hours, 2.0 * span_hours));
        let steps = (0..=STEPS).map(|step| far * f64::from(step) / f64::from(STEPS));
        let prior = self.prior(name, row.as_of_utc);
        Ok(trend::outlook(series, as_of_us, &self.settings(name), prior, steps)?)
    }
}

/// What the maintenance book says of a unit; of one whose part number is not known, nothing.
fn booked(book: &maintenance::Book, (part, serial): &HistoryName) -> Vec<trend::Booked> {
    part.clone().and_then(|part| book.get(&(part, serial.clone())).cloned()).unwrap_or_default()
}

/// Without a limit there is still a level and a rate; only crossings and states need one.
fn settings(config: &Config, part: Option<&job::Part>) -> trend::Settings {
    /// A gap no actuator has: a stand-in that is never met and never shown.
    const NEVER_M: f64 = 1.0;
    let of = &config.document.trend;
    let base = trend::Settings::for_limit(part.and_then(|p| p.limit_m).unwrap_or(NEVER_M));
    trend::Settings {
        watch_m: part.and_then(|p| p.watch_m).unwrap_or(base.watch_m),
        planning_horizon_hours: of.planning_horizon_hours,
        horizon_hours: of.horizon_hours,
        stale_after_days: of.stale_after_days,
        check_interval_hours: of.next_check_hours,
        ..base
    }
}

/// Whether a stay is this unit's; where its part number is not known, its serial number says so.
fn is_of(stay: &fleet::Installation, (part, serial): &HistoryName) -> bool {
    stay.serial_number.as_str() == serial
        && part.as_deref().is_none_or(|part| stay.part_number.as_str() == part)
}

fn series<'a>(
    flown: impl Iterator<Item = &'a Flown>,
    unit_hours_at_start: Option<f64>,
) -> Result<Series, Error> {
    let mut stays = BTreeMap::new();
    let observations = flown.map(|f| {
        let count = stays.len() as u32;
        Observation {
            departure_us: f.departure_utc.as_microsecond(),
            installation: *stays.entry((&f.tail_number, &f.position, f.installed_utc)).or_insert(count),
            flight_hours: f.flight_hours,
            tail_hours_end: f.tail_hours_end,
            load_reversals: f.load_reversals,
            gap_m: f.gap_m,
            gap_se_m: f.gap_se_m.filter(|se| *se > 0.0),
        }
    });
    Ok(Series::new(observations, &Usage { unit_hours_at_start, ..Usage::default() })?)
}

/// Means of neighbours, at most so many.
fn sketched(gaps_m: &[f64]) -> Vec<f64> {
    const MOST: usize = 100;
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
    gaps_m.chunks(gaps_m.len().div_ceil(MOST).max(1)).map(mean).collect()
}

fn row(
    name: &HistoryName,
    flown: &[&Flown],
    series: &Series,
    limit_m: Option<f64>,
    trend: &Trend,
    as_of: Timestamp,
) -> TrendRow {
    let last = flown.iter().max_by_key(|f| f.departure_utc);
    let (hours, gaps): (Vec<f64>, Vec<f64>) =
        series.until(trend.as_of_us).iter().filter_map(|f| Some((f.hours, f.gap?.gap_m))).unzip();
    let sen = classic::theil_sen(&hours, &gaps, 0.90).ok();
    let crossing = trend.crossing.filter(|_| limit_m.is_some());
    let flights = |hours: Option<f64>| Some(hours? / trend.pace?.hours_per_flight);
    let last_flown = series.until(trend.as_of_us).last();
    let last_flown = last_flown.and_then(|f| Timestamp::from_microsecond(f.departure_us).ok());
    let day = |hours: Option<f64>| after(last_flown?, hours? / trend.pace?.hours_per_day);
    TrendRow {
        part_number: name.0.clone(),
        serial_number: name.1.clone(),
        tail_number: last.and_then(|f| f.tail_number.clone()),
        position: last.and_then(|f| f.position.clone()),
        as_of_utc: as_of,
        flights: trend.flights as i64,
        unit_hours: trend.unit_hours,
        gap_m: trend.level.map(|l| l.gap_m),
        gap_se_m: trend.level.map(|l| l.se_m),
        estimates: trend.estimates as i64,
        outliers: trend.outliers_us.len() as i64,
        noise_factor: trend.noise_factor,
        rate_m_per_hour: trend.rate.map(|r| r.m_per_hour),
        rate_p05_m_per_hour: trend.rate.map(|r| r.p05_m_per_hour),
        rate_p95_m_per_hour: trend.rate.map(|r| r.p95_m_per_hour),
        trend: wear(trend.wear),
        growth_probability: trend.growth_probability,
        wear_law: trend.law.map(|(law, _)| law.to_string()),
        wear_law_probability: trend.law.map(|(_, share)| share),
        usage_axis: None,
        trend_p_value: classic::mann_kendall(&gaps).ok().map(|test| test.p_value),
        sen_rate_m_per_hour: sen.map(|s| s.slope),
        sen_low_m_per_hour: sen.map(|s| s.slope_low),
        sen_high_m_per_hour: sen.map(|s| s.slope_high),
        change_points: trend.changes.iter().filter_map(|c| change_point(c, flown)).collect(),
        limit_m,
        crossing_hours_p05: crossing.and_then(|c| c.p05_hours),
        crossing_hours_p50: crossing.and_then(|c| c.p50_hours),
        crossing_hours_p95: crossing.and_then(|c| c.p95_hours),
        crossing_flights_p05: flights(crossing.and_then(|c| c.p05_hours)),
        crossing_flights_p50: flights(crossing.and_then(|c| c.p50_hours)),
        crossing_flights_p95: flights(crossing.and_then(|c| c.p95_hours)),
        not_before_utc: day(crossing.and_then(|c| c.p05_hours)),
        likely_utc: day(crossing.and_then(|c| c.p50_hours)),
        not_after_utc: day(crossing.and_then(|c| c.p95_hours)),
        check_probability: trend.check_probability.filter(|_| limit_m.is_some()),
        state: trend.state.filter(|_| limit_m.is_some()).map(state_word),
        reason: Some(if limit_m.is_some() {
            trend.reason.to_string()
        } else {
            "no limit is configured".into()
        }),
        sketch_m: sketched(&gaps),
    }
}

/// A day so many days later; nothing beyond the calendar.
fn after(from: Timestamp, days: f64) -> Option<Timestamp> {
    const DAY_S: f64 = 86_400.0;
    from.checked_add(jiff::SignedDuration::try_from_secs_f64((days * DAY_S).round()).ok()?).ok()
}

fn change_point(change: &trend::Change, flown: &[&Flown]) -> Option<ChangePoint> {
    let flight = flown.iter().find(|f| f.departure_utc.as_microsecond() == change.departure_us);
    Some(ChangePoint {
        departure_utc: Timestamp::from_microsecond(change.departure_us).ok()?,
        flight_id: flight.and_then(|f| f.flight_id.clone()),
        kind: match change.kind {
            trend::ChangeKind::Step => "step",
            trend::ChangeKind::Reset => "reset",
            trend::ChangeKind::Onset => "onset",
            trend::ChangeKind::Recorded => "recorded",
        },
        step_m: change.step_m,
        step_se_m: change.se_m,
        certainty: change.certainty,
    })
}

fn wear(wear: trend::Wear) -> &'static str {
    match wear {
        trend::Wear::Wearing => "wearing",
        trend::Wear::Steady => "steady",
        trend::Wear::Unknown => "unknown",
    }
}

fn state_word(state: trend::State) -> &'static str {
    match state {
        trend::State::Normal => "normal",
        trend::State::Watch => "watch",
        trend::State::Plan => "plan",
        trend::State::Act => "act",
    }
}
