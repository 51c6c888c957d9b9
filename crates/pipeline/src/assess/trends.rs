//! Fleet assessment: trends of units from the store's records, by part and serial number across tails.

use std::collections::{BTreeMap, BTreeSet};

use jiff::Timestamp;
use job::Config;
use job::config::AsOf;
use rayon::prelude::*;
use records::{Diagnostic, Installations, QuantityChange, QuantityRow, TrendRow, UnitState};
use store::{ColumnScan, Query, Store};
use trend::{Assessment, FleetPrior, Series};

use crate::assess::changes::{Changes, RunFacts, changes};
use crate::assess::limits::Limits;
use crate::assess::priors::FleetPriors;
use crate::assess::quantities::follow::{FollowedQuantities, follow};
use crate::assess::quantities::values::{Units, by_unit, covariates};
use crate::assess::quantities::{peers, rows};
use crate::assess::tail_wide_steps::TailWide;
use crate::error::Error;
use crate::findings::finding::Finding;
use crate::findings::monitoring::coverage;
use crate::findings::monitoring::mapping_faults::{self, MappingFault};
use crate::findings::monitoring::recent::{RecentFlights, recent_flights};
use crate::findings::monitoring::recorder_change::{RecorderChange, recorder_changes};
use crate::findings::monitoring::repeated_samples;
use crate::fleet::bookkeeping::inspections;
use crate::fleet::bookkeeping::join::open_store;
use crate::fleet::bookkeeping::usage::OperatorTables;
use crate::fleet::builder;
use crate::fleet::external_estimates::AsOfQuery;
use crate::fleet::flight_row::FlightRow;
use crate::fleet::histories::{Histories, History, UnitKey};
use crate::run::summary::RunSummary;

/// Assessments of units, and steps of the gap that whole tails made.
type Statements = (Vec<TrendRow>, Vec<QuantityChange>);

/// Which units to assess, and at which date.
#[derive(Debug, Clone, Default)]
pub struct UnitSelection {
    /// Units on this tail at the end of the records only.
    pub tail_number: Option<String>,
    /// This serial number only.
    pub serial_number: Option<String>,
    /// This part number only.
    pub part_number: Option<String>,
    /// The date; that of the configuration when not given.
    pub as_of_utc: Option<Timestamp>,
}

impl UnitSelection {
    /// Whether a unit of that name is selected, on any tail.
    pub(crate) fn names(&self, name: &UnitKey) -> bool {
        self.serial_number.as_ref().is_none_or(|s| *s == name.1)
            && (self.part_number.is_none() || self.part_number == name.0)
    }

    /// Whether a tail is selected.
    pub(crate) fn is_on(&self, tail_number: Option<&String>) -> bool {
        self.tail_number.is_none() || self.tail_number.as_ref() == tail_number
    }
}

/// The date of assessments: the given one, else that of the configuration, by default the time of the run. None without
/// a record.
pub(crate) fn as_of_date(
    config: &Config,
    given: Option<Timestamp>,
    histories: &Histories,
) -> Option<Timestamp> {
    let newest_utc = histories.newest_utc()?;
    Some(given.unwrap_or(match config.document.trend.as_of {
        AsOf::Now => Timestamp::now(),
        AsOf::NewestRecord => newest_utc,
    }))
}

/// Assessments of selected units with what was found about them in addition to gaps.
#[derive(Debug, Default)]
pub struct StoreAssessment {
    /// One assessment for each unit.
    pub now: Vec<TrendRow>,
    /// Their followed quantities, and what changed on their tails and parts.
    pub followed: FollowedQuantities,
    /// Wrong mappings that concern them.
    pub mapping_faults: Vec<MappingFault>,
    /// Limits and hours that their assessments lack, in words.
    pub notes: Vec<String>,
}

/// Assesses the selected units.
///
/// # Errors
/// When the store cannot be read, or a part's limits are invalid.
pub fn assess_store(
    config: &Config,
    installations: &Installations,
    store: &Store,
    ask: &UnitSelection,
) -> Result<StoreAssessment, Error> {
    let histories = load_histories(store, &config.parts_by_largest_gap())?;
    assess_histories(config, installations, histories, ask)
}

fn assess_histories(
    config: &Config,
    installations: &Installations,
    mut histories: Histories,
    ask: &UnitSelection,
) -> Result<StoreAssessment, Error> {
    let Some(as_of) = as_of_date(config, ask.as_of_utc, &histories) else {
        return Ok(StoreAssessment::default());
    };
    // An assessment uses the fleet prior of the part, so the selection applies to rows, not to records.
    let mut fleet = FleetContext::new(config, installations, &mut histories, &[as_of])?;
    fleet.add_diagnostics(as_of)?;
    let (now, tail_wide) = fleet.selected(ask, as_of)?;
    Ok(fleet.assessed(now, &tail_wide, ask.as_of_utc))
}

/// Assesses the fleet after a run, and adds to its summary the `touched` units, the work list of all units, and what differs
/// from the states after the run before. Returns the findings about all units, for alerts and work
/// requests, and the states to store for the next run.
pub(crate) fn assess_run(
    config: &Config,
    installations: &Installations,
    store: &Store,
    touched: &BTreeSet<UnitKey>,
    with_records: &BTreeSet<UnitKey>,
    summary: &mut RunSummary,
) -> Result<(Vec<Finding>, Vec<UnitState>), Error> {
    let mut histories = load_histories(store, &config.parts_by_largest_gap())?;
    let Some(as_of) = as_of_date(config, None, &histories) else { return Ok(Default::default()) };
    let mut fleet = FleetContext::new(config, installations, &mut histories, &[as_of])?;
    summary.samples_repeated = repeated_samples::detect(&fleet.add_diagnostics(as_of)?);
    let (mut now, tail_wide) = fleet.statements(fleet.units.keys().copied(), as_of)?;
    now.retain(|row| row.flights > 0);
    let mut quantity_changes = fleet.followed.changes.clone();
    quantity_changes.extend(tail_wide);
    quantity_changes.sort_by_key(|change| std::cmp::Reverse(change.since_utc));
    let run = RunFacts { run_id: &summary.run_id, with_records, moved: &summary.moved };
    let Changes { changed, states } = changes(config, &store.states()?, &now, run);
    let causes: BTreeMap<UnitKey, &String> =
        changed.iter().map(|change| (change.unit(), &change.because)).collect();
    let horizon_hours = config.document.trend.planning_horizon_hours;
    let gap = |row: &TrendRow| Finding {
        cause: causes.get(&row.unit()).map(|cause| (*cause).clone()),
        ..Finding::of_gap(row, fleet.latest_flight(&row.unit(), as_of), horizon_hours)
    };
    let of_common = Finding::of_common_changes(&quantity_changes, as_of);
    let findings =
        now.iter().map(gap).chain(Finding::of_quantities(&fleet.followed.rows)).chain(of_common).collect();
    summary.notes.extend(fleet.notes(&now, None));
    let newest_utc = now.iter().filter_map(|row| fleet.latest_flight(&row.unit(), as_of)).max();
    summary.add_assessments(now, touched, config.document.trend.stale_after_days);
    summary.add_quantity_changes(quantity_changes, newest_utc.unwrap_or(as_of));
    (summary.changed, summary.mapping_faults) = (changed, fleet.mapping_faults);
    Ok((findings, states))
}

/// Assessments of earlier dates, each with its forecast for the date of a report, by the number of days before and unit; of units
/// that had flown by then.
pub(crate) type EarlierAssessments = BTreeMap<i64, BTreeMap<UnitKey, (TrendRow, Option<trend::Interval>)>>;

/// Assessments of the selected units with everything that a report shows.
#[derive(Default)]
pub(crate) struct ReportAssessments {
    /// Assessments at the date, and what was found about the units.
    pub(crate) fleet: StoreAssessment,
    /// Plotted forecast of each of them.
    pub(crate) drawn: Vec<trend::Forecast>,
    pub(crate) earlier: EarlierAssessments,
    /// Fleet prior of each part, and its training cut-off.
    pub(crate) priors: Vec<(Option<String>, Timestamp, FleetPrior)>,
}

/// Assesses the selected units at the date, and at earlier dates given in days before, from the histories of the store.
pub(crate) fn assess_for_report(
    config: &Config,
    installations: &Installations,
    histories: &mut Histories,
    ask: &UnitSelection,
    days_before: &[i64],
) -> Result<ReportAssessments, Error> {
    let Some(as_of) = as_of_date(config, ask.as_of_utc, histories) else {
        return Ok(ReportAssessments::default());
    };
    let earlier = |days: &i64| (*days, as_of - jiff::SignedDuration::from_hours(24 * days));
    let earlier: Vec<(i64, Timestamp)> = days_before.iter().map(earlier).collect();
    let days: Vec<Timestamp> = earlier.iter().map(|(_, at)| *at).chain([as_of]).collect();
    let mut fleet = FleetContext::new(config, installations, histories, &days)?;
    fleet.add_diagnostics(as_of)?;
    let (now, tail_wide) = fleet.selected(ask, as_of)?;
    let names: Vec<UnitKey> = now.iter().map(TrendRow::unit).collect();
    let drawn =
        names.par_iter().zip(&now).map(|(name, row)| fleet.forecast(name, row)).collect::<Result<_, _>>()?;
    let then = |(days, at): (i64, Timestamp)| {
        let mut forecasts = fleet.forecasts(&names, at, as_of)?;
        let flown = fleet.statements(names.iter(), at)?.0.into_iter().filter(|row| row.flights > 0);
        let of_unit = flown.map(|row| (row.unit(), row)).map(|(unit, row)| {
            let forecast = forecasts.remove(&unit);
            (unit, (row, forecast))
        });
        Ok((days, of_unit.collect()))
    };
    let earlier = earlier.into_iter().map(then).collect::<Result<_, Error>>()?;
    let selected: BTreeSet<Option<&str>> = names.iter().map(|name| name.0.as_deref()).collect();
    let priors = |part: Option<&str>| {
        let (turn, prior) = fleet.priors.of(part, as_of)?;
        Some((part.map(str::to_owned), Timestamp::from_microsecond(turn).ok()?, prior.clone()))
    };
    let priors = selected.into_iter().filter_map(priors).collect();
    let fleet = fleet.assessed(now, &tail_wide, ask.as_of_utc);
    Ok(ReportAssessments { fleet, drawn, earlier, priors })
}

/// Assesses the selected units of the store, or of the `histories` of a table made elsewhere; with `queries`, the unit and
/// the date of each query instead.
///
/// # Errors
/// As [`assess_store`], and when a history is invalid.
pub fn assess(
    config: &Config,
    installations: &Installations,
    histories: Option<Histories>,
    queries: Option<&[AsOfQuery]>,
    ask: &UnitSelection,
) -> Result<StoreAssessment, Error> {
    let store = || open_store(config, installations);
    let Some(queries) = queries else {
        return match histories {
            Some(histories) => assess_histories(config, installations, histories, ask),
            None => assess_store(config, installations, &store()?, ask),
        };
    };
    let stored = || load_histories(&store()?, &config.parts_by_largest_gap());
    let mut histories = histories.map_or_else(stored, Ok)?;
    let days: Vec<Timestamp> = queries.iter().map(|(_, as_of)| *as_of).collect();
    let unit = |(named, as_of): &AsOfQuery| match histories.stored {
        Some(_) => unit_of(&installations.unit_today(named.clone(), *as_of), &histories),
        None => unit_of(named, &histories),
    };
    let selected = queries.iter().map(unit).collect::<Result<Vec<UnitKey>, Error>>()?;
    // A unit that never flew has an assessment all the same.
    for unit in &selected {
        histories.units.entry(unit.clone()).or_default();
    }
    let fleet = FleetContext::new(config, installations, &mut histories, &days)?;
    // One assessment for each query, without data later than its date and without the tail-wide steps.
    let row = |(unit, as_of): (&UnitKey, &Timestamp)| {
        Ok(fleet.row(unit, &fleet.trend(unit, *as_of)?, *as_of, &TailWide::default()))
    };
    let now = selected.par_iter().zip(&days).map(row).collect::<Result<_, Error>>()?;
    Ok(StoreAssessment { now, ..StoreAssessment::default() })
}

/// The unit that a query means; an error where several parts have its serial number and none is named.
fn unit_of(named: &UnitKey, histories: &Histories) -> Result<UnitKey, Error> {
    if named.0.is_some() || histories.units.contains_key(named) {
        return Ok(named.clone());
    }
    let mut known = histories.units.keys().filter(|name| name.1 == named.1);
    match (known.next(), known.next()) {
        (Some((Some(one), serial)), Some((Some(other), _))) => {
            let what = format!("parts {one} and {other} both have a unit {serial}");
            let hint = "name the part in a column `part_number` of the queries";
            Err(Error::refused(Diagnostic::new("bad_table", what).hint(hint)))
        }
        (known, _) => Ok(known.unwrap_or(named).clone()),
    }
}

/// Every unit's flights in the store; of the parts `by_largest`, with the largest gap along the stroke as the gap.
///
/// # Errors
/// When the store cannot be read.
pub fn load_histories(store: &Store, by_largest: &BTreeSet<String>) -> Result<Histories, Error> {
    builder::of_store(store, &Query::default(), by_largest)
}

/// All units, and the fleet prior of each part by training cut-off.
pub(crate) struct FleetContext<'a> {
    pub(super) limits: Limits<'a>,
    pub(super) units: Units<'a>,
    priors: FleetPriors<'a>,
    stored: Option<&'a ColumnScan>,
    /// Followed quantities of all units; nothing for external tables.
    followed: FollowedQuantities,
    /// Their states, by unit.
    pub(super) conditions: BTreeMap<UnitKey, Vec<String>>,
    /// Recorder changes of whole aircraft.
    moved: Vec<RecorderChange>,
    /// Wrong mappings of all units.
    pub(super) mapping_faults: Vec<MappingFault>,
    pub(super) tables: OperatorTables<'a>,
}

impl<'a> FleetContext<'a> {
    /// Adds up the usage of all units, and learns the priors of the cut-off before each of the `days`, without later data.
    /// Frees the columns of the histories that the sums hold.
    pub(crate) fn new(
        config: &'a Config,
        installations: &'a Installations,
        histories: &'a mut Histories,
        days: &[Timestamp],
    ) -> Result<Self, Error> {
        let tables = OperatorTables::read(config, installations, histories.stored.is_some())?;
        let read = |(name, history): (&UnitKey, &mut History)| {
            let series = tables.series(name, history)?;
            history.extras = Vec::new();
            Ok(series)
        };
        let units: Vec<_> = histories.units.iter_mut().collect();
        let series = units.into_par_iter().map(read).collect::<Result<Vec<_>, Error>>()?;
        let histories: &'a Histories = histories;
        let limits = Limits::new(config, series.iter());
        let parts = histories.units.keys().map(|name| name.0.as_deref()).zip(&series);
        let priors = FleetPriors::train(parts, limits, days);
        let units = histories.units.iter().zip(series);
        let units = units.map(|((name, history), series)| (name, (history, series))).collect();
        Ok(Self {
            limits,
            units,
            priors,
            stored: histories.stored.as_deref(),
            followed: FollowedQuantities::default(),
            conditions: BTreeMap::new(),
            moved: Vec::new(),
            mapping_faults: Vec::new(),
            tables,
        })
    }

    pub(crate) fn series(&self, name: &UnitKey) -> Option<&Series> {
        self.units.get(name).map(|(_, series)| series)
    }

    /// Departure of a unit's latest flight until a date.
    fn latest_flight(&self, name: &UnitKey, as_of: Timestamp) -> Option<Timestamp> {
        let (history, _) = self.units.get(name)?;
        history.until(as_of).last().map(FlightRow::departure_utc)
    }

    pub(crate) fn settings(&self, name: &UnitKey) -> trend::Settings {
        self.limits.settings(name.0.as_deref())
    }

    pub(crate) fn prior<'s>(&'s self, name: &'s UnitKey, as_of: Timestamp) -> Option<&'s FleetPrior> {
        Some(self.priors.of(name.0.as_deref(), as_of)?.1)
    }

    /// Adds what the values of flights show besides gaps: followed quantities, and wrong mappings. Returns the flights of the
    /// last months, which show these.
    fn add_diagnostics(&mut self, as_of: Timestamp) -> Result<RecentFlights<'a>, Error> {
        let Some(stored) = self.stored else { return Ok(RecentFlights::default()) };
        let covariates = covariates(stored)?;
        let units = by_unit(&self.units, &covariates, as_of);
        let mut recent = recent_flights(&units, &covariates, as_of);
        self.followed = follow(&units, &self.units, (stored, &covariates), &mut recent, self.limits, as_of)?;
        self.moved = recorder_changes(&self.followed.changes, as_of);
        for (row, state) in self.followed.rows.iter().filter_map(|row| Some((row, row.state?))) {
            self.conditions.entry(row.unit()).or_default().push(state.to_owned());
        }
        self.mapping_faults = mapping_faults::detect(&recent, |part| self.limits.stiffness_n_per_m(part));
        Ok(recent)
    }

    /// Assessments of some units, with what was found about them in addition to gaps.
    fn assessed(
        &self,
        now: Vec<TrendRow>,
        tail_wide: &[QuantityChange],
        given: Option<Timestamp>,
    ) -> StoreAssessment {
        let units: BTreeSet<UnitKey> = now.iter().map(TrendRow::unit).collect();
        let faults = self.mapping_faults.iter().filter(|fault| !fault.units.is_disjoint(&units));
        StoreAssessment {
            followed: self.followed_of(&now, &units, tail_wide),
            mapping_faults: faults.cloned().collect(),
            notes: self.notes(&now, given),
            now,
        }
    }

    /// What assessments lack, and what of their units differs from its peers, in words.
    /// The age of the newest log counts from a given date of assessment, else from today.
    fn notes(&self, rows: &[TrendRow], given: Option<Timestamp>) -> Vec<String> {
        let units: BTreeSet<UnitKey> = rows.iter().map(TrendRow::unit).collect();
        let newest_log = rows.iter().filter_map(|row| self.latest_flight(&row.unit(), row.as_of_utc)).max();
        let today = given.unwrap_or_else(Timestamp::now);
        let mut notes = coverage::notes(rows, newest_log, today, self.limits.config);
        let later =
            |row: &TrendRow| inspections::later_note(&self.tables.inspections, &units, row.as_of_utc, today);
        notes.extend(rows.first().and_then(later));
        notes.extend(peers::notes(&self.followed.rows, |row| units.contains(&row.unit())));
        notes
    }

    /// The followed quantities of some assessed units, the gap with them, and what changed on their tails and parts.
    fn followed_of(
        &self,
        rows: &[TrendRow],
        units: &BTreeSet<UnitKey>,
        tail_wide: &[QuantityChange],
    ) -> FollowedQuantities {
        let tails: BTreeSet<Option<&str>> = rows.iter().map(|row| row.tail_number.as_deref()).collect();
        let parts: BTreeSet<Option<&str>> = rows.iter().map(|row| row.part_number.as_deref()).collect();
        let mut of_units: Vec<QuantityRow> = rows.iter().map(rows::of_gap).collect();
        of_units.extend(self.followed.rows.iter().filter(|row| units.contains(&row.unit())).cloned());
        of_units.sort_by(|a, b| (&a.part_number, &a.serial_number).cmp(&(&b.part_number, &b.serial_number)));
        let concerns = |change: &&QuantityChange| match &change.serial_number {
            Some(serial) => units.contains(&(change.part_number.clone(), serial.clone())),
            None => match &change.tail_number {
                Some(tail) => tails.contains(&Some(tail.as_str())),
                None => parts.contains(&change.part_number.as_deref()),
            },
        };
        let all = self.followed.changes.iter().chain(tail_wide);
        let mut changes: Vec<QuantityChange> = all.filter(concerns).cloned().collect();
        changes.sort_by_key(|change| std::cmp::Reverse(change.since_utc));
        FollowedQuantities { rows: of_units, changes }
    }

    fn selected(&self, ask: &UnitSelection, as_of: Timestamp) -> Result<Statements, Error> {
        let names = self.units.keys().copied();
        let (mut rows, tail_wide) = self.statements(names.filter(|name| ask.names(name)), as_of)?;
        // A unit that flew later than the date asked for did not exist then; one whose records are all dated ahead of
        // today's clock does, and nothing is known of it.
        let now = Timestamp::now();
        let is_ahead =
            |row: &TrendRow| self.units.get(&row.unit()).is_some_and(|unit| unit.0.until(now).is_empty());
        rows.retain(|row| (row.flights > 0 || is_ahead(row)) && ask.is_on(row.tail_number.as_ref()));
        Ok((rows, tail_wide))
    }

    /// Assessments of some units, and one change of the gap for each step of a whole tail.
    fn statements<'b>(
        &self,
        names: impl Iterator<Item = &'b UnitKey>,
        as_of: Timestamp,
    ) -> Result<Statements, Error> {
        let names: BTreeSet<&UnitKey> = names.collect();
        // A change is a tail's when its other units made it too, so they are assessed with the selected ones.
        let judged: Vec<&UnitKey> = self.tail_mates(&names).union(&names).copied().collect();
        let trends: Vec<Assessment> =
            judged.par_iter().map(|name| self.trend(name, as_of)).collect::<Result<_, _>>()?;
        let known = judged.iter().zip(&trends).filter_map(|(name, t)| Some((self.units.get(*name)?.0, t)));
        let wide = TailWide::new(&known.collect::<Vec<_>>(), &self.moved);
        let selected = judged.par_iter().zip(&trends).filter(|(name, _)| names.contains(*name));
        let rows = selected.map(|(name, trend)| self.row(name, trend, as_of, &wide)).collect();
        Ok((rows, wide.changes().collect()))
    }

    /// All units that have flown on the tails of some units.
    fn tail_mates(&self, names: &BTreeSet<&UnitKey>) -> BTreeSet<&UnitKey> {
        let history = |name: &&UnitKey| self.units.get(*name).map(|unit| unit.0);
        let tails: BTreeSet<&str> = names.iter().filter_map(history).flat_map(History::tails).collect();
        let is_mate = |unit: &(&'a History, Series)| unit.0.tails().any(|tail| tails.contains(tail));
        self.units.iter().filter(|(_, unit)| is_mate(unit)).map(|(name, _)| *name).collect()
    }

    fn trend(&self, name: &UnitKey, as_of: Timestamp) -> Result<Assessment, Error> {
        let (_, series) = &self.units[name];
        let prior = self.prior(name, as_of);
        Ok(trend::assess(series, as_of.as_microsecond(), &self.settings(name), prior)?)
    }

    /// Forecasts of units at a date, for the hours flown until a later one.
    fn forecasts(
        &self,
        names: &[UnitKey],
        at: Timestamp,
        later: Timestamp,
    ) -> Result<BTreeMap<UnitKey, trend::Interval>, Error> {
        let forecast = |name: &UnitKey| {
            let Some(series) = self.series(name) else { return Ok(None) };
            let hours_until = |day: Timestamp| Some(series.flights_until(day.as_microsecond()).last()?.hours);
            let Some(hours) = hours_until(at).zip(hours_until(later)).map(|(a, b)| b - a) else {
                return Ok(None);
            };
            let (settings, prior) = (self.settings(name), self.prior(name, at));
            let made = trend::forecast(series, at.as_microsecond(), &settings, prior, [hours])?;
            Ok(made.ahead.first().map(|(_, interval)| (name.clone(), *interval)))
        };
        let made: Vec<Option<_>> = names.par_iter().map(forecast).collect::<Result<_, Error>>()?;
        Ok(made.into_iter().flatten().collect())
    }

    /// Plotted forecast of an assessment: to its crossing, limited to a multiple of the observed time.
    fn forecast(&self, name: &UnitKey, row: &TrendRow) -> Result<trend::Forecast, Error> {
        const STEPS: u32 = 24;
        let Some(series) = self.series(name) else { return Ok(trend::Forecast::default()) };
        let as_of_us = row.as_of_utc.as_microsecond();
        let flown = series.flights_until(as_of_us);
        let span_hours = flown.first().zip(flown.last()).map_or(0.0, |(a, b)| b.hours - a.hours);
        let far = row
            .crossing_hours_p95
            .map_or(span_hours, |h| (1.1 * h).clamp(0.3 * span_hours, 2.0 * span_hours));
        let steps = (0..=STEPS).map(|step| far * f64::from(step) / f64::from(STEPS));
        let prior = self.prior(name, row.as_of_utc);
        Ok(trend::forecast(series, as_of_us, &self.settings(name), prior, steps)?)
    }
}
