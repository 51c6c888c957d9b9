//! Whose a step is: steps of most units of a tail, or of a part, on the same days have a common cause.

use std::collections::{BTreeMap, BTreeSet};

use records::ChangeScope;
use trend::quantity::QuantityValue;

use crate::assess::quantities::subject::Subject;

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

/// A step of one unit.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Found {
    pub(crate) subject: usize,
    /// Index among the steps of the subject.
    pub(crate) step: usize,
    pub(crate) departure_us: i64,
    /// Size over the quantity's scale.
    pub(crate) share: f64,
}

/// A step that several units made together.
#[derive(Debug)]
pub(crate) struct CommonStep {
    pub(crate) scope: ChangeScope,
    /// The tail or the part.
    pub(crate) name: String,
    pub(crate) members: Vec<Found>,
    pub(crate) able: usize,
    /// The first member's first flight after it.
    pub(crate) departure_us: i64,
}

/// Common steps of parts, or of tails. Steps below `least`, over the scale, are left to their units; `is_signed` asks
/// for one direction.
pub(crate) fn common_steps(
    subjects: &[Subject<'_>],
    scope: ChangeScope,
    least: f64,
    is_signed: bool,
) -> Vec<CommonStep> {
    let mut found: Vec<Found> = Vec::new();
    for (subject, of) in subjects.iter().enumerate() {
        let steps = of.fit.iter().flat_map(|fit| fit.steps.iter().enumerate());
        found.extend(steps.map(|(step, s)| Found {
            subject,
            step,
            departure_us: s.departure_us,
            share: s.size / of.scale,
        }));
    }
    found.sort_by_key(|step| step.departure_us);
    let group = |step: &Found| match scope {
        ChangeScope::Part => subjects[step.subject].name.0.clone(),
        _ => subjects[step.subject].tail_at(step.departure_us).map(str::to_owned),
    };
    let mut groups: BTreeMap<(String, bool), Vec<Found>> = BTreeMap::new();
    for step in found {
        if let Some(name) = group(&step) {
            groups.entry((name, is_signed && step.share < 0.0)).or_default().push(step);
        }
    }
    let made =
        groups.iter().flat_map(|((name, _), steps)| windows(steps).into_iter().map(move |w| (name, w)));
    made.filter_map(|(name, members)| judged(subjects, scope, name, members, least)).collect()
}

/// Steps that lie within the same days, one after the other; each unit once.
fn windows(steps: &[Found]) -> Vec<Vec<Found>> {
    let mut windows: Vec<Vec<Found>> = Vec::new();
    for step in steps {
        match windows.last_mut().filter(|w| step.departure_us - w[0].departure_us <= SAME_US) {
            Some(window) if window.iter().all(|s| s.subject != step.subject) => window.push(*step),
            Some(_) => {}
            None => windows.push(vec![*step]),
        }
    }
    windows
}

fn judged(
    subjects: &[Subject<'_>],
    scope: ChangeScope,
    name: &str,
    members: Vec<Found>,
    least: f64,
) -> Option<CommonStep> {
    let enough = if scope == ChangeScope::Part { MIN_UNITS.1 } else { MIN_UNITS.0 };
    let sizes: Vec<f64> = members.iter().map(|m| m.share.abs()).collect();
    if members.len() < enough || crate::findings::monitoring::median(sizes) < least {
        return None;
    }
    let departure_us = members[0].departure_us;
    let last_us = members[members.len() - 1].departure_us;
    let is_able = |subject: &&Subject<'_>| match scope {
        ChangeScope::Part => {
            subject.name.0.as_deref() == Some(name) && subject.shows(departure_us, last_us, None)
        }
        _ => subject.shows(departure_us, last_us, Some(name)),
    };
    let able = subjects.iter().filter(is_able).count().max(members.len());
    let tails: BTreeSet<Option<&str>> =
        members.iter().map(|m| subjects[m.subject].tail_at(m.departure_us)).collect();
    let is_spread = scope != ChangeScope::Part || tails.len() > 1;
    // A season that is fitted by steps is no step.
    let sharpness = members
        .iter()
        .map(|m| subjects[m.subject].jump(m.departure_us) / (m.share * subjects[m.subject].scale));
    let is_sharp = crate::findings::monitoring::median(sharpness.collect()) > SHARP;
    (is_spread && is_sharp && members.len() as f64 >= SHARE * able as f64).then(|| CommonStep {
        scope,
        name: name.to_owned(),
        members,
        able,
        departure_us,
    })
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
