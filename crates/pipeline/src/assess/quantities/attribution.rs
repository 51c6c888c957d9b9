//! Whose a step is: steps of most units of a tail, or of a part, on the same days have a common cause.

use std::collections::{BTreeMap, BTreeSet};

use records::{ChangeScope, Quantity};
use trend::quantity::QuantityValue;
use trend::quantity::changes::QuantityStep;

use crate::assess::quantities::subject::Subject;
use crate::findings::monitoring::median;

/// Steps within these days are one: a tail's flights, or a fleet's first flights under new software.
const SAME_US: i64 = 3 * 86_400_000_000;
/// Minimum share of the units able to show a step that make it.
const SHARE: f64 = 0.75;
/// Fewest units of a tail, and of a part, that make it; those of a part from two tails at least.
const MIN_UNITS: (usize, usize) = (2, 3);
/// Fewest flights before a step and from it on with which a unit is able to show it.
const ABLE: (usize, usize) = (5, 3);
/// Flights on each side of a step between which it must show, and the share of its size that must show there.
const NEAR: usize = 8;
const SHARP: f64 = 0.6;

#[derive(Debug, Clone, Copy)]
pub(crate) struct Found {
    /// Index of the unit.
    pub(crate) subject: usize,
    pub(crate) step: QuantityStep,
}

/// A step that several units made together.
#[derive(Debug)]
pub(crate) struct CommonStep<'a> {
    pub(crate) scope: ChangeScope,
    /// The tail or the part.
    pub(crate) name: &'a str,
    /// Steps of the units, by departure.
    pub(crate) members: Vec<Found>,
    /// Number of units with flights enough to show it.
    pub(crate) able: usize,
}

/// Common steps of parts, or of tails. Steps below `least`, over the scale, are left to their units.
pub(crate) fn common_steps<'a>(
    subjects: &[Subject<'a>],
    scope: ChangeScope,
    least: f64,
) -> Vec<CommonStep<'a>> {
    let steps = |(subject, of): (usize, &Subject<'a>)| {
        let steps = of.fit.iter().flat_map(|fit| &fit.steps);
        steps.map(move |step| Found { subject, step: *step }).collect::<Vec<_>>()
    };
    let mut found: Vec<Found> = subjects.iter().enumerate().flat_map(steps).collect();
    found.sort_by_key(|of| of.step.departure_us);
    let mut groups: BTreeMap<(&str, bool), Vec<Found>> = BTreeMap::new();
    for of in found {
        let subject = &subjects[of.subject];
        let name = match scope {
            ChangeScope::Part => subject.name.0.as_deref(),
            _ => subject.tail_at(of.step.departure_us),
        };
        // Steps with a common cause have one direction, but for load zeros.
        let is_fall = subject.quantity != Quantity::LoadZeroN && of.step.size < 0.0;
        name.into_iter().for_each(|name| groups.entry((name, is_fall)).or_default().push(of));
    }
    let windows = groups.into_iter().flat_map(|((name, _), steps)| {
        windows(&steps).into_iter().map(move |members| (name, members)).collect::<Vec<_>>()
    });
    windows.filter_map(|(name, members)| judged(subjects, scope, name, members, least)).collect()
}

/// Steps that lie within the same days, one after the other; each unit once.
fn windows(steps: &[Found]) -> Vec<Vec<Found>> {
    let mut windows: Vec<Vec<Found>> = Vec::new();
    for of in steps {
        let is_near = |w: &&mut Vec<Found>| of.step.departure_us - w[0].step.departure_us <= SAME_US;
        match windows.last_mut().filter(is_near) {
            Some(window) if window.iter().all(|other| other.subject != of.subject) => window.push(*of),
            Some(_) => {}
            None => windows.push(vec![*of]),
        }
    }
    windows
}

/// The common step of some units on the same days; nothing where too few units make it, or not sharply.
fn judged<'a>(
    subjects: &[Subject<'a>],
    scope: ChangeScope,
    name: &'a str,
    members: Vec<Found>,
    least: f64,
) -> Option<CommonStep<'a>> {
    let is_part = scope == ChangeScope::Part;
    let over_members = |value: fn(&Subject<'a>, &QuantityStep) -> f64| {
        median(members.iter().map(|of| value(&subjects[of.subject], &of.step)).collect())
    };
    let enough = if is_part { MIN_UNITS.1 } else { MIN_UNITS.0 };
    if members.len() < enough || over_members(|of, step| (step.size / of.scale).abs()) < least {
        return None;
    }
    let (first_us, last_us) = (members.first()?.step.departure_us, members.last()?.step.departure_us);
    let is_able = |of: &&Subject<'_>| {
        if is_part {
            of.name.0.as_deref() == Some(name) && of.shows(first_us, last_us, None)
        } else {
            of.shows(first_us, last_us, Some(name))
        }
    };
    let able = subjects.iter().filter(is_able).count().max(members.len());
    let tails: BTreeSet<Option<&str>> =
        members.iter().map(|of| subjects[of.subject].tail_at(of.step.departure_us)).collect();
    let is_spread = !is_part || tails.len() > 1;
    // A season that is fitted by steps is no step.
    let is_sharp = over_members(|of, step| of.jump(step.departure_us) / step.size) > SHARP;
    let is_common = is_spread && is_sharp && members.len() as f64 >= SHARE * able as f64;
    is_common.then_some(CommonStep { scope, name, members, able })
}

impl Subject<'_> {
    /// Mean of the next flights from a departure on less that of the last before it.
    fn jump(&self, departure_us: i64) -> f64 {
        let at = self.values.partition_point(|v| v.departure_us < departure_us);
        let mean =
            |values: &[QuantityValue]| values.iter().map(|v| v.value).sum::<f64>() / values.len() as f64;
        let (before, after) = self.values.split_at(at);
        mean(&after[..NEAR.min(after.len())]) - mean(&before[before.len().saturating_sub(NEAR)..])
    }

    /// Whether there are flights enough before and after some days, on a tail where one is given.
    fn shows(&self, first_us: i64, last_us: i64, tail: Option<&str>) -> bool {
        let on_tail = |us: i64| tail.is_none() || self.tail_at(us) == tail;
        let before = self.values.iter().filter(|v| v.departure_us < first_us && on_tail(v.departure_us));
        let after = self.values.iter().filter(|v| v.departure_us >= last_us && on_tail(v.departure_us));
        before.take(ABLE.0).count() == ABLE.0 && after.take(ABLE.1).count() == ABLE.1
    }
}
