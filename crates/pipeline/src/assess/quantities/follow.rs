//! Followed quantities of all units: series, steps, drift, and whose changes they are.

use std::collections::BTreeMap;

use jiff::Timestamp;
use rayon::prelude::*;
use records::{ChangeScope, Quantity, QuantityChange, QuantityRow, QuantityStep, TrendRow};
use trend::Series;
use trend::quantity::changes::{self, QuantityChanges};
use trend::quantity::common_curve::CommonCurve;
use trend::quantity::covariates::Slopes;
use trend::quantity::{MIN_FLIGHTS, QuantityValue};

use crate::assess::limits::Limits;
use crate::assess::quantities::attribution::{self, CommonStep};
use crate::assess::quantities::limits::{Scale, Treatment};
use crate::assess::quantities::subject::Subject;
use crate::assess::quantities::values::{FleetValues, FlightValues, READ, UnitValues, by_position};
use crate::findings::monitoring::median;
use crate::fleet::histories::{History, UnitKey};

/// A common step matters from this share of the limit on: all units of a tail agree about it.
const COMMON_SHARE: f64 = 0.3;
/// Standard errors by which a change must exceed its limit.
const BEYOND_SE: f64 = 0.5;
/// Fewest units of a tail whose drifts in one direction are the tail's.
const MIN_DRIFTING: usize = 3;
/// Their share of the limit.
const DRIFT_SHARE: f64 = 0.5;
/// Standard errors of a rate from which a unit departs from what its part shares.
const DEPARTS_SE: f64 = 3.0;
/// Share of a tail's units that make a drift the tail's.
const SHARE: f64 = 0.75;

/// Units by name: their flights, and the same by usage with their maintenance.
pub(crate) type Units<'a> = BTreeMap<&'a UnitKey, (&'a History, Series)>;

/// What is known of units in addition to the values.
#[derive(Clone, Copy)]
pub(crate) struct UnitFacts<'a> {
    pub(crate) units: &'a Units<'a>,
    pub(crate) limits: Limits<'a>,
}

impl<'a> UnitFacts<'a> {
    fn series(self, unit: &UnitKey) -> Option<&'a Series> {
        self.units.get(unit).map(|(_, series)| series)
    }

    /// Name of a unit's flight.
    fn flight_id(self, unit: &UnitKey, departure_us: i64) -> Option<String> {
        let history = self.units.get(unit)?.0;
        history.flight_id(history.at(utc(departure_us)?)?).map(str::to_owned)
    }
}

/// Followed quantities, and their changes.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FollowedQuantities {
    /// One row for each unit and quantity.
    pub rows: Vec<QuantityRow>,
    /// What changed, by date, the newest first.
    pub changes: Vec<QuantityChange>,
}

/// Follows all quantities of all units.
pub(crate) fn follow(fleet: &FleetValues, facts: UnitFacts<'_>, as_of: Timestamp) -> FollowedQuantities {
    let positions = by_position(fleet);
    let followed: Vec<FollowedQuantities> = (0..READ.len())
        .into_par_iter()
        .map(|index| follow_quantity((fleet, &positions), facts, as_of, index))
        .collect();
    let mut all = FollowedQuantities::default();
    for of_quantity in followed {
        all.rows.extend(of_quantity.rows);
        all.changes.extend(of_quantity.changes);
    }
    all.changes.sort_by(|a, b| b.since_utc.cmp(&a.since_utc).then_with(|| a.quantity.cmp(b.quantity)));
    all
}

fn follow_quantity(
    (units, positions): (&FleetValues, &FleetValues),
    facts: UnitFacts<'_>,
    as_of: Timestamp,
    index: usize,
) -> FollowedQuantities {
    let quantity = READ[index].0;
    let usual = Treatment::of(quantity, &facts.limits.quantities(None));
    let fleet = if usual.is_of_channel { positions } else { units };
    let made: Vec<Option<Subject<'_>>> =
        fleet.par_iter().map(|(name, unit)| subject(name, unit, facts, index)).collect();
    let mut subjects: Vec<Subject<'_>> = made.into_iter().flatten().collect();
    adjust(&mut subjects);
    let fit = |s: &Subject<'_>| changes::fit(&s.values, usual.least_scatter * s.scale);
    let is_signed = quantity != Quantity::LoadZeroN;
    let mut common = Vec::new();
    for scope in [ChangeScope::Part, ChangeScope::Tail] {
        let Some(limit) = usual.limit else { break };
        subjects.par_iter_mut().for_each(|s| s.fit = fit(s));
        let steps = attribution::common_steps(&subjects, scope, COMMON_SHARE * limit, is_signed);
        common.extend(steps.iter().map(|step| of_common(step, &subjects, quantity, facts)));
        take_off(&mut subjects, &steps);
        if scope == ChangeScope::Part {
            take_off_moves(&mut subjects);
            take_off_curves(&mut subjects, &fit);
        }
    }
    subjects.par_iter_mut().for_each(|s| s.fit = fit(s));
    let drifting_tails = drifting_tails(&subjects);
    let mut found = FollowedQuantities { rows: Vec::new(), changes: common };
    for subject in &subjects {
        let Some(fit) = &subject.fit else { continue };
        let assessed = Assessed { subject, fit, quantity, facts };
        let is_tails = subject.tail().is_some_and(|tail| drifting_tails.contains_key(tail));
        found.rows.push(assessed.row(as_of, is_tails));
        found.changes.extend(assessed.change(is_tails));
    }
    let drifts = drifting_tails.iter().map(|(tail, members)| of_drift(tail, members, &subjects, quantity));
    found.changes.extend(drifts);
    found
}

/// The series of one quantity of one unit; none without a value.
fn subject<'a>(
    name: &'a UnitKey,
    unit: &'a UnitValues,
    facts: UnitFacts<'_>,
    index: usize,
) -> Option<Subject<'a>> {
    let quantity = READ[index].0;
    let treatment = Treatment::of(quantity, &facts.limits.quantities(name.0.as_deref()));
    let last = unit.flights.last()?;
    let usual_load_n = unit.usual_load_n;
    let series = facts.series(name).filter(|_| !treatment.is_of_channel);
    let maintained_us = series.and_then(|s| Some(s.maintenance_until(last.departure_us).last()?.utc_us));
    let hours = |us: i64| Some(series?.flights_until(us).last()?.hours);
    let moved = unit.flights.iter().rposition(|f| f.place != last.place);
    let begin = moved.filter(|_| treatment.is_of_position).map_or(0, |k| k + 1);
    let followed =
        unit.flights[begin..].iter().filter(|f| maintained_us.is_none_or(|us| f.departure_us >= us));
    let value = |(k, flight): (usize, &FlightValues)| {
        let (value, se) = value_of(quantity, flight, index, usual_load_n)?;
        let known = |number: f32| number.is_finite().then_some(f64::from(number));
        Some(QuantityValue {
            departure_us: flight.departure_us,
            usage_hours: hours(flight.departure_us).unwrap_or(k as f64),
            value,
            se,
            temperature_c: known(flight.temperature_c),
            ln_load: known(flight.load_p95_n).filter(|n| *n > 0.0).map(f64::ln),
        })
    };
    let values: Vec<QuantityValue> = followed.enumerate().filter_map(value).collect();
    let scale = match treatment.scale {
        Scale::One => 1.0,
        Scale::UsualLoad => usual_load_n?,
        Scale::Median => {
            let all: Vec<f64> = values.iter().map(|v| v.value.abs()).collect();
            if all.is_empty() { 0.0 } else { median(all) }
        }
    };
    (!values.is_empty() && scale > 0.0).then_some(Subject {
        name,
        unit,
        scale,
        treatment,
        values,
        fit: None,
        common: Vec::new(),
    })
}

/// Value and standard error of a flight. Friction is taken at the unit's usual load, so that a flight under less load
/// has not less friction.
fn value_of(
    quantity: Quantity,
    flight: &FlightValues,
    index: usize,
    usual_load_n: Option<f64>,
) -> Option<(f64, f64)> {
    let of = |quantity: Quantity| {
        let at = READ.iter().position(|(q, _)| *q == quantity)?;
        Some(f64::from(flight.values[at].0)).filter(|v| v.is_finite())
    };
    let (value, se) = flight.values[index];
    let se = if se.is_finite() { f64::from(se.max(0.0)) } else { 0.0 };
    if quantity == Quantity::FrictionN
        && let (Some(dry_n), Some(share), Some(load_n)) =
            (of(Quantity::FrictionDryN), of(Quantity::FrictionLoadShare), usual_load_n)
    {
        return Some((dry_n + share * load_n, se));
    }
    value.is_finite().then_some((f64::from(value), se))
}

/// Takes temperature and load level off, by slopes that the units of a part share.
fn adjust(subjects: &mut [Subject<'_>]) {
    let mut parts: BTreeMap<Option<String>, Vec<usize>> = BTreeMap::new();
    for (k, subject) in subjects.iter().enumerate() {
        parts.entry(subject.name.0.clone()).or_default().push(k);
    }
    for members in parts.values() {
        let slopes = Slopes::fit(members.iter().map(|&k| subjects[k].values.as_slice()));
        for &k in members {
            subjects[k].values.iter_mut().for_each(|v| v.value = slopes.adjusted(v));
        }
    }
}

/// Takes common steps off, each unit's own size.
fn take_off(subjects: &mut [Subject<'_>], common: &[CommonStep]) {
    for step in common {
        for member in &step.members {
            let subject = &mut subjects[member.subject];
            let Some(own) = subject.fit.as_ref().map(|fit| fit.steps[member.step]) else { continue };
            subject.take_off(own, step.scope);
        }
    }
}

/// Takes steps off that a unit made with its move to another tail, whose sensors are others.
fn take_off_moves(subjects: &mut [Subject<'_>]) {
    for subject in subjects {
        let Some(fit) = &subject.fit else { continue };
        let is_move = |step: &&changes::QuantityStep| {
            let before = subject.values.iter().rev().find(|v| v.departure_us < step.departure_us);
            before.is_some_and(|v| subject.tail_at(v.departure_us) != subject.tail_at(step.departure_us))
        };
        let moves: Vec<changes::QuantityStep> = fit.steps.iter().filter(is_move).copied().collect();
        moves.into_iter().for_each(|step| subject.take_off(step, ChangeScope::Tail));
    }
}

/// Takes the curve that the units of a part share off each of them. Units that depart from it have no part in the curve.
fn take_off_curves<'a>(
    subjects: &mut [Subject<'a>],
    fit: &(dyn Fn(&Subject<'a>) -> Option<QuantityChanges> + Sync),
) {
    let all = curves(subjects, &vec![true; subjects.len()]);
    let follows = |subject: &Subject<'a>| {
        let left = subject.without(all.get(&subject.name.0));
        fit(&left).is_none_or(|fit| {
            fit.change == 0.0 && fit.rate_per_hour.is_none_or(|(rate, se)| rate.abs() <= DEPARTS_SE * se)
        })
    };
    let follow: Vec<bool> = subjects.par_iter().map(follows).collect();
    let curves = curves(subjects, &follow);
    for subject in subjects {
        *subject = subject.without(curves.get(&subject.name.0));
    }
}

/// The common curve of each part, from those units that `follow` marks.
fn curves(subjects: &[Subject<'_>], follow: &[bool]) -> BTreeMap<Option<String>, CommonCurve> {
    let mut tails: BTreeMap<Option<&str>, usize> = BTreeMap::new();
    let mut parts: BTreeMap<Option<String>, Vec<(usize, &[QuantityValue])>> = BTreeMap::new();
    for (subject, _) in subjects.iter().zip(follow).filter(|(_, follows)| **follows) {
        let count = tails.len();
        let tail = *tails.entry(subject.tail()).or_insert(count);
        parts.entry(subject.name.0.clone()).or_default().push((tail, &subject.values));
    }
    // The scale of units differs little within a part, and is one for delays.
    parts.into_iter().map(|(part, units)| (part, CommonCurve::fit(units.into_iter()))).collect()
}

/// Tails whose units drift in one direction, with their subjects.
fn drifting_tails(subjects: &[Subject<'_>]) -> BTreeMap<String, Vec<usize>> {
    let mut tails: BTreeMap<&str, (Vec<usize>, Vec<usize>, usize)> = BTreeMap::new();
    for (k, subject) in subjects.iter().enumerate() {
        let (Some(fit), Some(tail)) = (&subject.fit, subject.tail()) else { continue };
        let entry = tails.entry(tail).or_default();
        entry.2 += usize::from(fit.flights >= MIN_FLIGHTS);
        let Some(limit) = subject.treatment.limit else { continue };
        if fit.is_drifting && fit.change.abs() >= DRIFT_SHARE * limit * subject.scale {
            if fit.change > 0.0 { entry.0.push(k) } else { entry.1.push(k) }
        }
    }
    let whole = |(tail, (up, down, able)): (&str, (Vec<usize>, Vec<usize>, usize))| {
        let members = if up.len() >= down.len() { up } else { down };
        (members.len() >= MIN_DRIFTING && members.len() as f64 >= SHARE * able as f64)
            .then(|| (tail.to_owned(), members))
    };
    tails.into_iter().filter_map(whole).collect()
}

/// One unit's fit of one quantity.
struct Assessed<'a> {
    subject: &'a Subject<'a>,
    fit: &'a QuantityChanges,
    quantity: Quantity,
    facts: UnitFacts<'a>,
}

impl Assessed<'_> {
    /// State of the unit's own change.
    fn state(&self) -> Option<&'static str> {
        let limit = self.subject.treatment.limit? * self.subject.scale;
        let (rise, fall) = self.subject.treatment.states;
        let is_beyond = self.fit.change.abs() > limit + BEYOND_SE * self.fit.change_se;
        if !is_beyond {
            return None;
        }
        if self.fit.change > 0.0 { rise } else { fall }
    }

    fn row(&self, as_of: Timestamp, is_tails: bool) -> QuantityRow {
        let Self { subject, fit, quantity, .. } = self;
        let place = subject.last_place();
        let own = fit.steps.iter().map(|step| (*step, ChangeScope::Unit));
        let mut steps: Vec<(changes::QuantityStep, ChangeScope)> =
            own.chain(subject.common.iter().copied()).collect();
        steps.sort_by_key(|(step, _)| step.departure_us);
        let common: f64 = subject.common.iter().map(|(step, _)| step.size).sum();
        // The channels of a position have no hours of their own.
        let rate = fit.rate_per_hour.filter(|_| !self.subject.treatment.is_of_channel);
        let state = self.state().filter(|_| !is_tails);
        QuantityRow {
            part_number: subject.name.0.clone(),
            serial_number: subject.name.1.clone(),
            tail_number: place.and_then(|p| p.tail_number.clone()),
            position: place.and_then(|p| p.position.clone()),
            as_of_utc: as_of,
            quantity: quantity.as_str(),
            flights: fit.flights as i64,
            outliers: fit.outliers as i64,
            since_utc: subject.values.first().and_then(|v| utc(v.departure_us)),
            baseline: Some(fit.baseline),
            level: Some(fit.level + common),
            level_se: Some(fit.level_se),
            change: Some(fit.change),
            change_se: Some(fit.change_se),
            rate_per_hour: rate.map(|(rate, _)| rate),
            rate_se_per_hour: rate.map(|(_, se)| se),
            change_limit: self.subject.treatment.limit.map(|limit| limit * subject.scale),
            steps: steps.into_iter().filter_map(|(step, scope)| self.step(step, scope)).collect(),
            state,
            reason: state.map(|_| self.evidence()),
        }
    }

    fn step(&self, step: changes::QuantityStep, scope: ChangeScope) -> Option<QuantityStep> {
        Some(QuantityStep {
            departure_utc: utc(step.departure_us)?,
            flight_id: self.facts.flight_id(self.subject.name, step.departure_us),
            size: step.size,
            size_se: step.size_se,
            scope: scope.as_str(),
        })
    }

    /// Departure of the largest step, or of the flight at which a drift passed half of its size.
    fn since_us(&self) -> Option<i64> {
        let largest = self.fit.steps.iter().max_by(|a, b| a.size.abs().total_cmp(&b.size.abs()));
        let values = &self.subject.values;
        largest.map(|step| step.departure_us).or_else(|| values.get(values.len() / 2).map(|v| v.departure_us))
    }

    fn evidence(&self) -> String {
        let Self { subject, fit, quantity, .. } = self;
        let how = match (self.fit.steps.is_empty(), self.fit.is_drifting) {
            (true, _) => "drifted",
            (false, false) => "stepped",
            (false, true) => "stepped and drifted",
        };
        let since = self.since_us().and_then(utc).map(day).unwrap_or_default();
        format!(
            "{} {how} by {} since {since} ({} to {}), shared neither by the tail nor by the part: {}",
            quantity.label(),
            shown_change(*quantity, fit.change, subject.scale),
            shown(*quantity, fit.baseline),
            shown(*quantity, fit.baseline + fit.change),
            self.cause(),
        )
    }

    /// Likely cause of the unit's own change: the wear where the quantity follows the gap.
    fn cause(&self) -> String {
        const FOLLOWS: f64 = 0.8;
        match self.gap_correlation() {
            Some(r) if r.abs() > FOLLOWS => format!("it follows the gap (r = {r:.2})"),
            _ if self.subject.treatment.is_of_position || self.subject.treatment.is_of_channel => {
                "its sensor or wiring".to_owned()
            }
            _ => ChangeScope::Unit.cause().to_owned(),
        }
    }

    /// Correlation with the gaps of the same flights.
    fn gap_correlation(&self) -> Option<f64> {
        let flights = self.facts.series(self.subject.name)?.flights();
        let pairs: Vec<(f64, f64)> = self
            .subject
            .values
            .iter()
            .filter_map(|v| {
                let at = flights.binary_search_by_key(&v.departure_us, |f| f.departure_us).ok()?;
                Some((v.value, flights[at].gap?.gap_m))
            })
            .collect();
        let count = pairs.len() as f64;
        let (x, y) = pairs.iter().fold((0.0, 0.0), |sum, (x, y)| (sum.0 + x / count, sum.1 + y / count));
        let sum = |of: &dyn Fn(f64, f64) -> f64| pairs.iter().map(|(a, b)| of(a - x, b - y)).sum::<f64>();
        let r = sum(&|a, b| a * b) / (sum(&|a, _| a * a) * sum(&|_, b| b * b)).sqrt();
        (pairs.len() >= 8).then_some(r).filter(|r| r.is_finite())
    }

    /// The unit's own change, where it has a state.
    fn change(&self, is_tails: bool) -> Option<QuantityChange> {
        let state = self.state().filter(|_| !is_tails)?;
        let Self { subject, fit, quantity, .. } = self;
        let place = subject.last_place();
        Some(QuantityChange {
            quantity: quantity.as_str(),
            scope: ChangeScope::Unit.as_str(),
            kind: if fit.steps.is_empty() { "drift" } else { "step" },
            part_number: subject.name.0.clone(),
            tail_number: place.and_then(|p| p.tail_number.clone()),
            serial_number: Some(subject.name.1.clone()),
            positions: place.and_then(|p| p.position.clone()).into_iter().collect(),
            units: 1,
            units_able: 1,
            since_utc: self.since_us().and_then(utc)?,
            from: fit.baseline,
            to: fit.baseline + fit.change,
            change_se: fit.change_se,
            state: Some(state),
            evidence: self.evidence(),
        })
    }
}

/// A step that a tail or a part made.
fn of_common(
    step: &CommonStep,
    subjects: &[Subject<'_>],
    quantity: Quantity,
    facts: UnitFacts<'_>,
) -> QuantityChange {
    let member = |m: &attribution::Found| &subjects[m.subject];
    let first = &step.members[0];
    let shares: Vec<f64> = step.members.iter().map(|m| m.share).collect();
    let levels = |m: &attribution::Found| {
        let fit = member(m).fit.as_ref()?;
        let before: f64 = fit.steps[..m.step].iter().map(|s| s.size).sum();
        Some((fit.baseline + before, fit.steps[m.step].size))
    };
    let (from, size): (Vec<f64>, Vec<f64>) = step.members.iter().filter_map(levels).unzip();
    let (from, size) = (median(from), median(size));
    let change_se = member(first).fit.as_ref().map_or(f64::NAN, |fit| fit.steps[first.step].size_se);
    let units: Vec<&Subject<'_>> = step.members.iter().map(member).collect();
    let flight = facts
        .flight_id(member(first).name, step.departure_us)
        .map(|f| format!(", flight {f}"))
        .unwrap_or_default();
    let since_utc = utc(step.departure_us).unwrap_or_default();
    QuantityChange {
        kind: "step",
        since_utc,
        from,
        to: from + size,
        change_se,
        evidence: format!(
            "{} of {} units of {} stepped in {} by {} on {}{flight}: {}",
            step.members.len(),
            step.able,
            step.name,
            quantity.label(),
            shown_range(quantity, &shares, member(first).scale),
            day(since_utc),
            step.scope.cause(),
        ),
        ..of_several(quantity, step.scope, &step.name, &units, step.able)
    }
}

/// What several units of a tail or a part share of a change that they made.
fn of_several(
    quantity: Quantity,
    scope: ChangeScope,
    name: &str,
    units: &[&Subject<'_>],
    able: usize,
) -> QuantityChange {
    let is_tail = scope == ChangeScope::Tail;
    let positions = units.iter().filter(|_| is_tail).filter_map(|unit| unit.position());
    let mut positions: Vec<String> = positions.map(str::to_owned).collect();
    positions.sort();
    QuantityChange {
        quantity: quantity.as_str(),
        scope: scope.as_str(),
        part_number: (!is_tail).then(|| name.to_owned()),
        tail_number: is_tail.then(|| name.to_owned()),
        positions,
        units: units.len() as i64,
        units_able: able as i64,
        state: scope.state(),
        ..QuantityChange::default()
    }
}

/// A drift that the units of a tail share.
fn of_drift(tail: &str, members: &[usize], subjects: &[Subject<'_>], quantity: Quantity) -> QuantityChange {
    let known: Vec<(&Subject<'_>, &QuantityChanges)> =
        members.iter().filter_map(|&k| Some((&subjects[k], subjects[k].fit.as_ref()?))).collect();
    let (from, change): (Vec<f64>, Vec<f64>) = known.iter().map(|(_, f)| (f.baseline, f.change)).unzip();
    let (from, change) = (median(from), median(change));
    let shares: Vec<f64> = known.iter().map(|(s, f)| f.change / s.scale).collect();
    let middle = |values: &[QuantityValue]| values.get(values.len() / 2).and_then(|v| utc(v.departure_us));
    let units: Vec<&Subject<'_>> = known.iter().map(|(subject, _)| *subject).collect();
    QuantityChange {
        kind: "drift",
        since_utc: known.first().and_then(|(s, _)| middle(&s.values)).unwrap_or_default(),
        from,
        to: from + change,
        change_se: known.first().map_or(f64::NAN, |(_, f)| f.change_se),
        evidence: format!(
            "{} units of {tail} drifted in {} by {}: {}",
            known.len(),
            quantity.label(),
            shown_range(quantity, &shares, known.first().map_or(1.0, |(s, _)| s.scale)),
            ChangeScope::Tail.cause(),
        ),
        ..of_several(quantity, ChangeScope::Tail, tail, &units, known.len())
    }
}

/// The row of the gap, which the trend itself assesses.
pub(crate) fn gap_row(row: &TrendRow) -> QuantityRow {
    let spread = row.rate_p05_m_per_hour.zip(row.rate_p95_m_per_hour).map(|(low, high)| 0.5 * (high - low));
    QuantityRow {
        part_number: row.part_number.clone(),
        serial_number: row.serial_number.clone(),
        tail_number: row.tail_number.clone(),
        position: row.position.clone(),
        as_of_utc: row.as_of_utc,
        quantity: Quantity::GapM.as_str(),
        flights: row.estimates,
        outliers: row.outliers,
        level: row.gap_m,
        level_se: row.gap_se_m,
        rate_per_hour: row.rate_m_per_hour,
        rate_se_per_hour: spread.map(|half| half / records::uncertainty::NORMAL_95),
        steps: row
            .change_points
            .iter()
            .map(|c| QuantityStep {
                departure_utc: c.departure_utc,
                flight_id: c.flight_id.clone(),
                size: c.step_m,
                size_se: c.step_se_m,
                scope: if c.tail_wide { ChangeScope::Tail } else { ChangeScope::Unit }.as_str(),
            })
            .collect(),
        ..QuantityRow::default()
    }
}

fn utc(us: i64) -> Option<Timestamp> {
    Timestamp::from_microsecond(us).ok()
}

fn day(at: Timestamp) -> String {
    at.strftime("%Y-%m-%d").to_string()
}

/// A value with its unit.
fn shown(quantity: Quantity, value: f64) -> String {
    let (unit, factor) = quantity.display_unit();
    let value = (value * factor * 1e3).round() / 1e3 + 0.0;
    format!("{} {unit}", short(value)).trim_end().to_owned()
}

/// A number with about three digits.
pub(crate) fn short(value: f64) -> String {
    let places = [100.0, 10.0].iter().filter(|least| value.abs() < **least).count();
    format!("{value:.places$}")
}

/// Whether changes of a quantity are shown as a share.
fn is_share(quantity: Quantity) -> bool {
    !matches!(quantity, Quantity::SkewS | Quantity::LoadZeroN | Quantity::LoadDelayS)
}

fn shown_change(quantity: Quantity, change: f64, scale: f64) -> String {
    if is_share(quantity) {
        format!("{:+.1} %", 100.0 * change / scale)
    } else if change < 0.0 {
        shown(quantity, change)
    } else {
        format!("+{}", shown(quantity, change))
    }
}

fn shown_range(quantity: Quantity, shares: &[f64], scale: f64) -> String {
    let low = shares.iter().copied().fold(f64::INFINITY, f64::min);
    let high = shares.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    format!(
        "{} to {}",
        shown_change(quantity, low * scale, scale),
        shown_change(quantity, high * scale, scale)
    )
}
