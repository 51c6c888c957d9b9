//! Trends of units: the store's records, per part and serial number across tails, as statements.

use std::collections::{BTreeMap, BTreeSet};

use fleet::{Installation, Installations, PartNumber, SerialNumber};
use jiff::Timestamp;
use job::Config;
use job::part::WearAxis;
use rayon::prelude::*;
use serde::Serialize;
use store::{Query, Store};
use trend::{Axis, Each, FleetPrior, Observation, Series, Trend, Usage, classic};

use crate::changed::{Changed, changed};
use crate::error::Error;
use crate::histories::{Flown, Gathering, Histories, History, HistoryName, Place};
use crate::lately::{Lately, lately};
use crate::maintenance;
use crate::parts::read_each;
use crate::recorder::{Moved, moved, moved_in_store};
use crate::stays::Stays;
use crate::tail_wide::TailWide;
use crate::unlogged::Unlogged;

/// What a prior asks of each unit, done by all workers.
struct AtOnce;

impl Each for AtOnce {
    fn each<T: Sync, R: Send>(&self, things: &[T], work: impl Fn(&T) -> R + Send + Sync) -> Vec<R> {
        things.par_iter().map(work).collect()
    }
}

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
    /// Whether the tail's other actuators changed with it, or what is fitted of all of them did: a matter of a
    /// sensor or a recorder, not of wear.
    pub tail_wide: bool,
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
    pub hamed_rao_p_value: Option<f64>,
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
    /// Theil–Sen and Hamed–Rao as well: their time grows with the square of a history's length.
    pub statistics: bool,
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
    let mut histories = in_store(store)?;
    let Some(as_of) = ask.as_of_utc.or_else(|| histories.newest_utc()) else { return Ok(Vec::new()) };
    let moved = moved_in_store(store, as_of)?;
    let fleet = Fleet::alone(config, installations, &mut histories, &[as_of])?.beside(moved);
    fleet.asked(ask, as_of)
}

/// What a run's units say.
#[derive(Debug, Default)]
pub struct Night {
    /// Statements of the newest day in the store.
    pub now: Vec<TrendRow>,
    /// What of them is otherwise than without the run's records. Where the store holds no others, nothing is.
    pub changed: Vec<Changed>,
    /// What the last months say beside gaps, of all tails.
    pub lately: Lately,
}

/// States what is known of units whose records a run changed.
///
/// # Errors
/// As [`of_store`].
pub fn of_units(
    config: &Config,
    installations: &Installations,
    store: &Store,
    units: &[Unit],
    run_id: &str,
) -> Result<Night, Error> {
    if units.is_empty() {
        return Ok(Night::default());
    }
    let query = Query { run_id: Some(run_id.to_owned()), ..Query::default() };
    let (all, tonight) = (in_store(store)?, gathered(store, &query)?);
    let lately = all.newest_utc().map(|newest| lately(store, newest)).transpose()?.unwrap_or_default();
    let moved = moved(&lately);
    let (now, changed) = of_night(config, installations, all, &tonight, units, moved)?;
    Ok(Night { now, changed, lately })
}

/// The same of all flights that are known after a night, and those of the night.
///
/// # Errors
/// As [`of_histories`].
pub fn of_night(
    config: &Config,
    installations: &Installations,
    mut all: Histories,
    tonight: &Histories,
    units: &[Unit],
    moved: Vec<Moved>,
) -> Result<(Vec<TrendRow>, Vec<Changed>), Error> {
    let names: BTreeSet<HistoryName> =
        units.iter().map(|(part, serial)| (Some(part.to_string()), serial.to_string())).collect();
    let Some(as_of) = all.newest_utc() else { return Ok(Default::default()) };
    let before_utc = all.newest_without_utc(tonight);
    let days: Vec<Timestamp> = before_utc.into_iter().chain([as_of]).collect();
    // Flights later than all others change nothing of what is said of a day before them; but where a flights
    // table is given, those without a row are counted from a unit's rows.
    let is_later =
        config.flights.iter().next().is_none() && before_utc.is_none_or(|before| tonight.are_later(before));
    let earlier = if is_later { Histories::default() } else { all.without(&names, tonight) };
    let fleet = Fleet::alone(config, installations, &mut all, &days)?.beside(moved);
    let mut now = fleet.statements(names.iter(), as_of)?;
    now.retain(|row| row.flights > 0);
    let Some(before_utc) = before_utc else { return Ok((now, Vec::new())) };
    let before = if is_later {
        fleet.statements(names.iter(), before_utc)?
    } else {
        let read = Fleet::read(config, installations, &earlier)?;
        let fleet = Fleet { priors: fleet.priors, turns: fleet.turns, ..read };
        fleet.statements(earlier.names(), before_utc)?
    };
    let before = before.into_iter().filter(|row| row.flights > 0).map(|row| (row.name(), row)).collect();
    let news = changed(&before, &now);
    Ok((now, news))
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
/// As [`of_histories`].
pub(crate) fn told(
    config: &Config,
    installations: &Installations,
    histories: &Histories,
    ask: &Ask,
    days_before: &[i64],
    moved: Vec<Moved>,
) -> Result<Told, Error> {
    let newest = || histories.newest_utc();
    let Some(as_of) = ask.as_of_utc.or_else(newest) else { return Ok(Told::default()) };
    let earlier = |days: &i64| (*days, as_of - jiff::SignedDuration::from_hours(24 * days));
    let earlier: Vec<(i64, Timestamp)> = days_before.iter().map(earlier).collect();
    let days: Vec<Timestamp> = earlier.iter().map(|(_, at)| *at).chain([as_of]).collect();
    let fleet = Fleet::new(config, installations, histories, &days)?.beside(moved);
    let now = fleet.asked(ask, as_of)?;
    let names: Vec<HistoryName> =
        now.iter().map(|row| (row.part_number.clone(), row.serial_number.clone())).collect();
    let drawn =
        names.par_iter().zip(&now).map(|(name, row)| fleet.outlook(name, row)).collect::<Result<_, _>>()?;
    let then = |(days, at): (i64, Timestamp)| Ok((days, fleet.statements(names.iter(), at)?));
    let before = earlier.into_iter().map(then).collect::<Result<_, Error>>()?;
    let asked: BTreeSet<Option<&str>> = names.iter().map(|name| name.0.as_deref()).collect();
    let taught = |part: Option<&str>| {
        let turn = fleet.turns.by(as_of)?;
        let prior = fleet.priors.get(&(turn, part))?;
        Some((part.map(str::to_owned), Timestamp::from_microsecond(turn).ok()?, prior.clone()))
    };
    let priors = asked.into_iter().filter_map(taught).collect();
    Ok(Told { now, drawn, before, priors })
}

/// One statement for each query, from nothing later than its date.
///
/// # Errors
/// When a history or a part's limits cannot be judged.
pub fn of_queries(
    config: &Config,
    installations: &Installations,
    histories: &Histories,
    queries: &[AsOf],
    statistics: bool,
) -> Result<Vec<TrendRow>, Error> {
    let days: Vec<Timestamp> = queries.iter().map(|query| query.as_of_utc).collect();
    let fleet = Fleet::new(config, installations, histories, &days)?;
    let statement = |query: &AsOf| fleet.statement(&unit_of(query, histories), query.as_of_utc);
    let mut rows: Vec<TrendRow> = queries.par_iter().map(statement).collect::<Result<_, _>>()?;
    fleet.add_statistics(&mut rows, statistics);
    Ok(rows)
}

/// The unit a query means; one that never flew has a name all the same.
fn unit_of(query: &AsOf, histories: &Histories) -> HistoryName {
    let named = (query.part_number.clone(), query.serial_number.clone());
    if query.part_number.is_some() || histories.get(&named).is_some() {
        return named;
    }
    histories.names().find(|name| name.1 == query.serial_number).cloned().unwrap_or(named)
}

/// Every unit's flights in the store.
///
/// # Errors
/// When the store cannot be read.
pub fn in_store(store: &Store) -> Result<Histories, Error> {
    gathered(store, &Query::default())
}

fn gathered(store: &Store, query: &Query) -> Result<Histories, Error> {
    let stored: Vec<&str> =
        Gathering::COLUMNS.into_iter().filter(|name| !["serial", "tail"].contains(name)).collect();
    let mut gathering = Gathering::default();
    read_each(&store.parts(query, &stored)?, |batch| gathering.add_stored(batch))?;
    Ok(gathering.booked())
}

/// One statement for each asked unit, by part and serial number.
///
/// # Errors
/// When a history or a part's limits cannot be judged.
pub fn of_histories(
    config: &Config,
    installations: &Installations,
    histories: &Histories,
    ask: &Ask,
) -> Result<Vec<TrendRow>, Error> {
    let Some(as_of) = ask.as_of_utc.or_else(|| histories.newest_utc()) else { return Ok(Vec::new()) };
    Fleet::new(config, installations, histories, &[as_of])?.asked(ask, as_of)
}

/// Part numbers that share a prior.
type Parts<'a> = Vec<Option<&'a str>>;

/// All units, and what each part's units had taught about the next by each turn.
pub(crate) struct Fleet<'a> {
    config: &'a Config,
    units: BTreeMap<&'a HistoryName, (&'a History, Series)>,
    turns: Turns,
    priors: BTreeMap<(i64, Option<&'a str>), FleetPrior>,
    /// What moved on whole aircraft beside gaps.
    moved: Vec<Moved>,
}

/// The days on which priors are learned, microseconds since 1970 UTC: every thirty days from a fleet's first
/// departure on, and when it has grown older by a tenth.
///
/// A prior moves slowly and costs as much as its fleet's statements: that of a turn serves until the next.
#[derive(Debug, Clone, Default)]
struct Turns(Vec<i64>);

impl Turns {
    fn of(first_us: i64, last_us: i64) -> Self {
        const MONTH_US: i64 = 30 * 86_400_000_000;
        const GROWN: i64 = 10;
        let next = |turn: &i64| Some(turn + MONTH_US.max((turn - first_us) / GROWN));
        Self(std::iter::successors(Some(first_us), next).take_while(|turn| *turn <= last_us).collect())
    }

    /// The last turn by a day.
    fn by(&self, as_of: Timestamp) -> Option<i64> {
        self.0[..self.0.partition_point(|turn| *turn <= as_of.as_microsecond())].last().copied()
    }
}

impl<'a> Fleet<'a> {
    /// Reads all histories and learns by the turn before each of the `days`, each from nothing later.
    pub(crate) fn new(
        config: &'a Config,
        installations: &Installations,
        histories: &'a Histories,
        days: &[Timestamp],
    ) -> Result<Self, Error> {
        Ok(Self::read(config, installations, histories)?.taught_by(days))
    }

    /// The same where nobody else needs the histories: of each flight what is in its series is forgotten.
    fn alone(
        config: &'a Config,
        installations: &Installations,
        histories: &'a mut Histories,
        days: &[Timestamp],
    ) -> Result<Self, Error> {
        let books = Books::read(config, installations)?;
        let is_booked = histories.is_booked();
        let read = |(name, history): (&HistoryName, &mut History)| {
            let series = books.series(name, history, is_booked)?;
            history.forget();
            Ok(series)
        };
        let units: Vec<_> = histories.iter_mut().collect();
        let series = units.into_par_iter().map(read).collect::<Result<Vec<_>, Error>>()?;
        Ok(Self::of(config, histories, series).taught_by(days))
    }

    /// Reads all histories and learns nothing.
    fn read(
        config: &'a Config,
        installations: &Installations,
        histories: &'a Histories,
    ) -> Result<Self, Error> {
        let books = Books::read(config, installations)?;
        let is_booked = histories.is_booked();
        let units: Vec<_> = histories.iter().collect();
        let read = |(name, history)| books.series(name, history, is_booked);
        let series = units.into_par_iter().map(read).collect::<Result<Vec<_>, Error>>()?;
        Ok(Self::of(config, histories, series))
    }

    /// Histories, and what each adds up to.
    fn of(config: &'a Config, histories: &'a Histories, series: Vec<Series>) -> Self {
        let units = histories.iter().zip(series);
        let units = units.map(|((name, history), series)| (name, (history, series))).collect();
        Self { config, units, turns: Turns::default(), priors: BTreeMap::new(), moved: Vec::new() }
    }

    /// The same with what was learned by the turn before each of the days.
    fn taught_by(mut self, days: &[Timestamp]) -> Self {
        let parts: BTreeSet<Option<&str>> = self.units.keys().map(|name| name.0.as_deref()).collect();
        let first = self.units.values().filter_map(|(_, series)| series.flights().first());
        if let Some((first_us, last)) = first.map(|f| f.departure_us).min().zip(days.iter().max()) {
            self.turns = Turns::of(first_us, last.as_microsecond());
        }
        let turns: BTreeSet<i64> = days.iter().filter_map(|day| self.turns.by(*day)).collect();
        let taught: Vec<_> = turns.par_iter().map(|turn| (*turn, self.taught(*turn, &parts))).collect();
        for (turn, groups) in taught {
            for (parts, prior) in groups {
                self.priors.extend(parts.into_iter().map(|part| ((turn, part), prior.clone())));
            }
        }
        self
    }

    /// What the parts had taught by a turn, those alike together.
    fn taught(&self, turn_us: i64, parts: &BTreeSet<Option<&'a str>>) -> Vec<(Parts<'a>, FleetPrior)> {
        let parts: Vec<Option<&str>> = parts.iter().copied().collect();
        let alone = parts.into_par_iter().map(|part| (part, self.learn(turn_us, &[part]))).collect();
        let alike = self.alike(alone);
        alike.into_par_iter().map(|(parts, own)| self.pooled(turn_us, parts, own)).collect()
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
    fn pooled<'b>(&self, turn_us: i64, parts: Parts<'b>, own: FleetPrior) -> (Parts<'b>, FleetPrior) {
        let prior = if parts.len() == 1 { own } else { self.learn(turn_us, &parts) };
        (parts, prior)
    }

    fn learn(&self, turn_us: i64, parts: &[Option<&str>]) -> FleetPrior {
        let of_parts = self.units.iter().filter(|(name, _)| parts.contains(&name.0.as_deref()));
        let first = parts.first().copied().flatten();
        let (limit_m, axis) = (self.limit_m(first), self.axis(first));
        FleetPrior::learn_by(of_parts.map(|(_, (_, series))| series), turn_us, limit_m, axis, &AtOnce)
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
        self.priors.get(&(self.turns.by(as_of)?, flown.0.as_deref()))
    }

    /// The same, with what moved on whole aircraft beside gaps.
    pub(crate) fn beside(self, moved: Vec<Moved>) -> Self {
        Self { moved, ..self }
    }

    /// The statements that are asked for, with the statistics if they are.
    fn asked(&self, ask: &Ask, as_of: Timestamp) -> Result<Vec<TrendRow>, Error> {
        let names = self.units.keys().copied();
        let mut rows = self.statements(names.filter(|name| ask.names(name)), as_of)?;
        rows.retain(|row| ask.fits(row));
        self.add_statistics(&mut rows, ask.statistics);
        Ok(rows)
    }

    fn statements<'b>(
        &self,
        names: impl Iterator<Item = &'b HistoryName>,
        as_of: Timestamp,
    ) -> Result<Vec<TrendRow>, Error> {
        let names: BTreeSet<&HistoryName> = names.collect();
        // A change is a tail's when its other units made it too, so they are judged with those asked for.
        let judged: Vec<&HistoryName> = self.mates(&names).union(&names).copied().collect();
        let trends: Vec<Trend> =
            judged.par_iter().map(|name| self.trend(name, as_of)).collect::<Result<_, _>>()?;
        let known = judged.iter().zip(&trends).filter_map(|(name, t)| Some((self.units.get(*name)?.0, t)));
        let wide = TailWide::new(&known.collect::<Vec<_>>(), &self.moved);
        let asked = judged.iter().zip(&trends).filter(|(name, _)| names.contains(*name));
        Ok(asked.map(|(name, trend)| self.row(name, trend, as_of, &wide)).collect())
    }

    /// The units that have flown on the tails of some.
    fn mates(&self, names: &BTreeSet<&HistoryName>) -> BTreeSet<&HistoryName> {
        let history = |name: &&HistoryName| self.units.get(*name).map(|unit| unit.0);
        let tails: BTreeSet<&str> = names.iter().filter_map(history).flat_map(History::tails).collect();
        let is_mate = |unit: &(&'a History, Series)| unit.0.tails().any(|tail| tails.contains(tail));
        self.units.iter().filter(|(_, unit)| is_mate(unit)).map(|(name, _)| *name).collect()
    }

    fn trend(&self, name: &HistoryName, as_of: Timestamp) -> Result<Trend, Error> {
        let nothing = (&History::default(), Series::new([], &Usage::default())?);
        let (_, series) = self.units.get(name).unwrap_or(&nothing);
        let prior = self.prior(name, as_of);
        Ok(trend::remembered(series, as_of.as_microsecond(), &self.settings(name), prior)?)
    }

    /// What engineers know, and no alarm is made from.
    fn add_statistics(&self, rows: &mut [TrendRow], are_asked: bool) {
        let add = |row: &mut TrendRow| {
            let Some(series) = self.series(&row.name()) else { return };
            let known = series.until(row.as_of_utc.as_microsecond()).iter();
            let (hours, gaps_m): (Vec<f64>, Vec<f64>) =
                known.filter_map(|f| Some((f.hours, f.gap?.gap_m))).unzip();
            let sen = classic::theil_sen(&hours, &gaps_m, 0.90).ok();
            row.sen_rate_m_per_hour = sen.map(|s| s.slope);
            row.sen_low_m_per_hour = sen.map(|s| s.slope_low);
            row.sen_high_m_per_hour = sen.map(|s| s.slope_high);
            row.hamed_rao_p_value = classic::hamed_rao(&gaps_m).ok().map(|test| test.p_value);
        };
        if are_asked {
            rows.par_iter_mut().for_each(add);
        }
    }

    /// One unit's statement, whatever its tail's others made.
    fn statement(&self, name: &HistoryName, as_of: Timestamp) -> Result<TrendRow, Error> {
        Ok(self.row(name, &self.trend(name, as_of)?, as_of, &TailWide::default()))
    }

    fn row(&self, name: &HistoryName, trend: &Trend, as_of: Timestamp, wide: &TailWide) -> TrendRow {
        let unit = self.units.get(name);
        let nobody = History::default();
        let (history, series) = unit.map_or((&nobody, None), |(history, series)| (*history, Some(series)));
        let limit_m = self.part(name.0.as_deref()).and_then(|p| p.limit_m);
        let prior = self.prior(name, as_of).filter(|_| trend.flights > 0);
        let usage_axis = prior.map(|prior| prior.axis().to_string());
        let row = row(name, history, series, limit_m, trend, as_of, wide);
        TrendRow { usage_axis, ..row }
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

/// What the books say of units beside their rows.
struct Books<'a> {
    maintenance: maintenance::Book,
    unlogged: Unlogged<'a>,
    stays: Stays<'a>,
}

impl<'a> Books<'a> {
    fn read(config: &'a Config, installations: &'a Installations) -> Result<Self, Error> {
        let file = config.document.logs.maintenance.as_ref();
        let maintenance = file.map(|file| maintenance::read(&config.path(file))).transpose()?;
        Ok(Self {
            maintenance: maintenance.unwrap_or_default(),
            unlogged: Unlogged::of_table(&config.flights),
            stays: Stays::new(installations),
        })
    }

    /// A unit's flights, added up.
    fn series(&self, name: &HistoryName, history: &History, is_booked: bool) -> Result<Series, Error> {
        let stays = self.stays.of(name);
        let booked = if is_booked { &stays[..] } else { &[] };
        let first = stays.iter().min_by_key(|stay| stay.installed_utc);
        let unit_hours_at_start = first.and_then(|stay| stay.unit_hours_at_install);
        let observations = observed(history, booked, &self.unlogged.of_unit(history, booked));
        let usage = Usage { unit_hours_at_start, ..Usage::default() };
        Ok(Series::new(observations, &usage)?.with_book(booked_work(&self.maintenance, name)))
    }
}

/// What the maintenance book says of a unit; of one whose part number is not known, nothing.
fn booked_work(book: &maintenance::Book, (part, serial): &HistoryName) -> Vec<trend::Booked> {
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

/// A unit's flights as the trend knows them, those that left no record among them.
fn observed(
    history: &History,
    stays: &[&Installation],
    unlogged: &[(&Installation, &fleet::Flight)],
) -> Vec<Observation> {
    let mut numbers = Numbers::default();
    let seen = history.flights().iter().map(|f| {
        let beside = history.beside(f);
        Observation {
            departure_us: f.departure_us(),
            installation: numbers.of_flown(f, history, stays),
            flight_hours: beside.flight_hours(),
            tail_hours_end: beside.tail_hours_end(),
            load_reversals: beside.load_reversals(),
            gap_m: f.gap_m(),
            gap_se_m: beside.gap_se_m().filter(|se| *se > 0.0),
        }
    });
    let mut observations: Vec<Observation> = seen.collect();
    observations.extend(unlogged.iter().map(|(stay, flight)| Observation {
        departure_us: flight.departure_utc.as_microsecond(),
        installation: numbers.of(&Place::of(stay), Some(stay)),
        flight_hours: flight.flight_hours,
        tail_hours_end: flight.tail_hours_end,
        load_reversals: None,
        gap_m: None,
        gap_se_m: None,
    }));
    observations
}

/// Installations of one unit, numbered as they come.
#[derive(Default)]
struct Numbers<'a> {
    known: Vec<(Place, Option<Timestamp>)>,
    /// Place and stay of the flight before, and their number.
    last: Option<(u32, &'a Installation, u32)>,
}

impl<'a> Numbers<'a> {
    /// That of a flight. Stays of one place do not overlap, so most flights are of the stay of the one before.
    fn of_flown(&mut self, flown: &Flown, history: &History, stays: &[&'a Installation]) -> u32 {
        let is_here =
            |last: &(u32, &Installation, u32)| last.0 == flown.place && last.1.covers(flown.departure_utc());
        if let Some((_, _, number)) = self.last.filter(is_here) {
            return number;
        }
        let stay = history.stay(flown, stays);
        let number = self.of(history.place(flown), stay);
        self.last = stay.map(|stay| (flown.place, stay, number));
        number
    }

    fn of(&mut self, place: &Place, stay: Option<&Installation>) -> u32 {
        let installed_utc = stay.map(|stay| stay.installed_utc);
        let known = self.known.iter().rposition(|(p, at)| p == place && *at == installed_utc);
        let number = known.unwrap_or_else(|| {
            self.known.push((place.clone(), installed_utc));
            self.known.len() - 1
        });
        number as u32
    }
}

/// Means of neighbours, at most so many.
fn sketched(gaps_m: &[f64]) -> Vec<f64> {
    const MOST: usize = 100;
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
    gaps_m.chunks(gaps_m.len().div_ceil(MOST).max(1)).map(mean).collect()
}

fn row(
    name: &HistoryName,
    history: &History,
    series: Option<&Series>,
    limit_m: Option<f64>,
    trend: &Trend,
    as_of: Timestamp,
    wide: &TailWide,
) -> TrendRow {
    let last = history.until(as_of).last().map(|flown| history.place(flown));
    let gaps_m = series.map(|series| series.gaps_m(trend.as_of_us)).unwrap_or_default();
    let crossing = trend.crossing.filter(|_| limit_m.is_some());
    let flights = |hours: Option<f64>| Some(hours? / trend.pace?.hours_per_flight);
    let last_flown = series.and_then(|series| series.until(trend.as_of_us).last());
    let last_flown = last_flown.and_then(|f| Timestamp::from_microsecond(f.departure_us).ok());
    let day = |hours: Option<f64>| after(last_flown?, hours? / trend.pace?.hours_per_day);
    TrendRow {
        part_number: name.0.clone(),
        serial_number: name.1.clone(),
        tail_number: last.and_then(|place| place.tail_number.clone()),
        position: last.and_then(|place| place.position.clone()),
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
        trend_p_value: classic::mann_kendall(&gaps_m).ok().map(|test| test.p_value),
        sen_rate_m_per_hour: None,
        sen_low_m_per_hour: None,
        sen_high_m_per_hour: None,
        hamed_rao_p_value: None,
        change_points: trend.changes.iter().filter_map(|c| change_point(c, history, wide)).collect(),
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
        reason: Some(match limit_m {
            Some(_) => reason(trend, history, wide),
            None => "no limit is configured".into(),
        }),
        sketch_m: sketched(&gaps_m),
    }
}

/// A day so many days later; nothing beyond the calendar.
fn after(from: Timestamp, days: f64) -> Option<Timestamp> {
    const DAY_S: f64 = 86_400.0;
    from.checked_add(jiff::SignedDuration::try_from_secs_f64((days * DAY_S).round()).ok()?).ok()
}

/// Why a state; a change that the tail's other units made as well is named for what it is.
fn reason(trend: &Trend, history: &History, wide: &TailWide) -> String {
    let unknown = trend.changes.iter().rev().find(|c| c.kind != trend::ChangeKind::Recorded);
    match (trend.reason, unknown.and_then(|change| wide.tail(change, history))) {
        (trend::Reason::Changed { kind, days }, Some(tail)) => format!(
            "{kind} {days:.0} days ago with all actuators of {tail} at once: a sensor or recorder, not wear"
        ),
        (other, _) => other.to_string(),
    }
}

fn change_point(change: &trend::Change, history: &History, wide: &TailWide) -> Option<ChangePoint> {
    let departure_utc = Timestamp::from_microsecond(change.departure_us).ok()?;
    let flight = history.at(departure_utc);
    Some(ChangePoint {
        departure_utc,
        flight_id: flight.and_then(|f| history.flight_id(f)).map(str::to_owned),
        kind: match change.kind {
            trend::ChangeKind::Step => "step",
            trend::ChangeKind::Reset => "reset",
            trend::ChangeKind::Onset => "onset",
            trend::ChangeKind::Recorded => "recorded",
        },
        step_m: change.step_m,
        step_se_m: change.se_m,
        certainty: change.certainty,
        tail_wide: wide.tail(change, history).is_some(),
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
