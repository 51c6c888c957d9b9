//! Followed quantities of all units: series, steps, drift, and whose changes they are.

use std::collections::BTreeMap;

use jiff::Timestamp;
use rayon::prelude::*;
use records::{ChangeScope, Quantity, QuantityChange, QuantityRow};
use store::ColumnScan;
use trend::quantity::MIN_FLIGHTS;
use trend::quantity::changes::{QuantityChanges, QuantityStep};
use trend::quantity::common_curve::CommonCurve;
use trend::quantity::covariates::Slopes;

use crate::assess::limits::Limits;
use crate::assess::quantities::attribution::common_steps;
use crate::assess::quantities::limits::Treatment;
use crate::assess::quantities::rows;
use crate::assess::quantities::subject::{QuantityColumns, Subject, fit_all};
use crate::assess::quantities::values::{self, Covariates, FollowedUnits, READ, Units, by_position};
use crate::error::Error;
use crate::findings::monitoring::recent::RecentFlights;

/// A common step matters from this share of the limit on: all units of a tail agree about it.
const COMMON_SHARE: f64 = 0.3;
/// Fewest units of a tail whose drifts in one direction are the tail's.
const MIN_DRIFTING: usize = 3;
/// Their share of the limit.
const DRIFT_SHARE: f64 = 0.5;
/// Standard errors of a rate from which a unit departs from what its part shares.
const DEPARTS_SE: f64 = 3.0;
/// Share of a tail's units that make a drift the tail's.
const SHARE: f64 = 0.75;

/// Followed quantities, and their changes.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FollowedQuantities {
    /// One row for each unit and quantity.
    pub rows: Vec<QuantityRow>,
    /// What changed, by date, the newest first.
    pub changes: Vec<QuantityChange>,
}

/// Follows the quantities of all units, and adds their values to the recent flights.
pub(crate) fn follow(
    units: &FollowedUnits<'_>,
    fleet: &Units<'_>,
    (stored, covariates): (&ColumnScan, &[Covariates]),
    recent: &mut RecentFlights<'_>,
    limits: Limits<'_>,
    as_of: Timestamp,
) -> Result<FollowedQuantities, Error> {
    let positions = by_position(units);
    let mut all = FollowedQuantities::default();
    // One after the other: the values of one quantity of a whole fleet take hundreds of megabytes.
    for (index, (quantity, _)) in READ.into_iter().enumerate() {
        let usual = Treatment::of(quantity, &limits.quantities(None));
        let units = if usual.is_of_channel { &positions } else { units };
        // In `READ`, its parts follow the friction.
        let parts = match quantity {
            Quantity::FrictionN => {
                Some([values::quantity(stored, index + 1)?, values::quantity(stored, index + 2)?])
            }
            _ => None,
        };
        let columns =
            QuantityColumns { quantity, values: values::quantity(stored, index)?, parts, covariates };
        for flight in recent.values_mut().flatten() {
            flight.values[index] = columns.values[flight.row as usize].0;
        }
        let subjects = units
            .par_iter()
            .filter_map(|(name, unit)| Subject::new(name, unit, &fleet.get(*name)?.1, limits, &columns));
        let subjects = subjects.collect();
        drop(columns);
        let of_quantity = follow_quantity(subjects, usual.limit, as_of);
        all.rows.extend(of_quantity.rows);
        all.changes.extend(of_quantity.changes);
    }
    all.changes.sort_by(|a, b| b.since_utc.cmp(&a.since_utc).then_with(|| a.quantity.cmp(b.quantity)));
    Ok(all)
}

/// Follows one quantity of all units, sorted by part. `limit` is the usual change, over the scale, from which there is a
/// state.
fn follow_quantity(
    mut subjects: Vec<Subject<'_>>,
    limit: Option<f64>,
    as_of: Timestamp,
) -> FollowedQuantities {
    let mut found = FollowedQuantities::default();
    adjust(&mut subjects);
    for scope in [ChangeScope::Part, ChangeScope::Tail] {
        let Some(limit) = limit else { break };
        fit_all(&mut subjects);
        let steps = common_steps(&subjects, scope, COMMON_SHARE * limit);
        found.changes.extend(steps.iter().filter_map(|step| rows::of_step(step, &subjects)));
        // Each unit's own size of the step.
        for (subject, step) in steps.iter().flat_map(|common| &common.members).map(|of| (of.subject, of.step))
        {
            subjects[subject].take_off(step, scope);
        }
        if scope == ChangeScope::Part {
            take_off_moves(&mut subjects);
            take_off_curves(&mut subjects);
        }
    }
    fit_all(&mut subjects);
    let drifting_tails = drifting_tails(&subjects);
    for subject in &subjects {
        let Some(fit) = &subject.fit else { continue };
        let is_tails = subject.tail().is_some_and(|tail| drifting_tails.contains_key(tail));
        let row = rows::of_unit(subject, fit, as_of, is_tails);
        found.changes.extend(rows::change_of_unit(subject, fit, &row));
        found.rows.push(row);
    }
    let drifts = drifting_tails.iter().filter_map(|(tail, members)| rows::of_drift(tail, members));
    found.changes.extend(drifts);
    found
}

/// The subjects of each part, which workers share.
fn parts<'s, 'a>(subjects: &'s mut [Subject<'a>]) -> impl ParallelIterator<Item = &'s mut [Subject<'a>]> {
    let parts: Vec<_> = subjects.chunk_by_mut(|a, b| a.name.0 == b.name.0).collect();
    parts.into_par_iter()
}

/// Takes temperature and load level off, by slopes that the units of a part share.
fn adjust(subjects: &mut [Subject<'_>]) {
    parts(subjects).for_each(|part| {
        let slopes = Slopes::fit(part.iter().map(|subject| subject.values.as_slice()));
        part.iter_mut().flat_map(|s| &mut s.values).for_each(|v| v.value = slopes.adjusted(v));
    });
}

/// Takes steps off that a unit made with its move to another tail, whose sensors are others.
fn take_off_moves(subjects: &mut [Subject<'_>]) {
    for subject in subjects {
        let Some(fit) = &subject.fit else { continue };
        let is_move = |step: &&QuantityStep| {
            let before = subject.values.iter().rev().find(|v| v.departure_us < step.departure_us);
            before.is_some_and(|v| subject.tail_at(v.departure_us) != subject.tail_at(step.departure_us))
        };
        let moves: Vec<QuantityStep> = fit.steps.iter().filter(is_move).copied().collect();
        moves.into_iter().for_each(|step| subject.take_off(step, ChangeScope::Tail));
    }
}

/// Takes the curve that the units of a part share off each of them. Units that depart from it have no part in the curve.
fn take_off_curves(subjects: &mut [Subject<'_>]) {
    parts(subjects).for_each(|part| {
        let all = curve(part.iter());
        let fitted = |subject: &Subject<'_>| {
            if all == CommonCurve::default() && subject.is_fitted {
                return subject.fit.clone();
            }
            let mut left = subject.values.clone();
            all.take_off(&mut left);
            subject.fitted(&left)
        };
        let fits: Vec<Option<QuantityChanges>> = part.par_iter().map(fitted).collect();
        let follows = |fit: &Option<QuantityChanges>| {
            fit.as_ref().is_none_or(|fit| {
                fit.change == 0.0 && fit.rate_per_hour.is_none_or(|(rate, se)| rate.abs() <= DEPARTS_SE * se)
            })
        };
        let common =
            curve(part.iter().zip(&fits).filter_map(|(subject, fit)| follows(fit).then_some(subject)));
        let is_same = common == all;
        part.par_iter_mut().zip(fits).for_each(|(subject, fit)| {
            common.take_off(&mut subject.values);
            (subject.fit, subject.is_fitted) = (fit, is_same);
        });
    });
}

/// The common curve of some units of a part.
fn curve<'s, 'a: 's>(subjects: impl Iterator<Item = &'s Subject<'a>>) -> CommonCurve {
    let mut tails: BTreeMap<Option<&str>, usize> = BTreeMap::new();
    CommonCurve::fit(subjects.map(|subject| {
        let count = tails.len();
        (*tails.entry(subject.tail()).or_insert(count), subject.values.as_slice())
    }))
}

/// Tails whose units drift in one direction, with these units.
fn drifting_tails<'s, 'a>(subjects: &'s [Subject<'a>]) -> BTreeMap<&'a str, Vec<&'s Subject<'a>>> {
    let mut tails: BTreeMap<&str, ([Vec<&Subject<'_>>; 2], usize)> = BTreeMap::new();
    for subject in subjects {
        let (Some(fit), Some(tail)) = (&subject.fit, subject.tail()) else { continue };
        let (drifting, able) = tails.entry(tail).or_default();
        *able += usize::from(fit.flights >= MIN_FLIGHTS);
        if fit.is_drifting && subject.limit().is_some_and(|limit| fit.change.abs() >= DRIFT_SHARE * limit) {
            drifting[usize::from(fit.change > 0.0)].push(subject);
        }
    }
    let whole = |(tail, ([down, up], able)): (_, ([Vec<_>; 2], usize))| {
        let members = if up.len() >= down.len() { up } else { down };
        let is_tails = members.len() >= MIN_DRIFTING && members.len() as f64 >= SHARE * able as f64;
        is_tails.then_some((tail, members))
    };
    tails.into_iter().filter_map(whole).collect()
}
