//! Tail-wide steps: all actuators of a tail step at once, because a sensor or a recorder changed.

use std::collections::{BTreeMap, BTreeSet};

use jiff::Timestamp;
use records::{ChangeScope, Quantity, QuantityChange};
use trend::{Assessment, ChangePoint, ChangePointKind, TailWideStep, UnitOnTail, tail_wide_steps};

use crate::findings::monitoring::recorder_change::RecorderChange;
use crate::fleet::flight_row::FlightRow;
use crate::fleet::histories::History;

/// Tail-wide steps by tail, and the changes of recorders that explain changes of the gap.
#[derive(Debug, Default)]
pub(crate) struct TailWide<'m> {
    steps: BTreeMap<String, Vec<TailWideStep>>,
    /// Levels of the units on these tails, m.
    levels_m: BTreeMap<String, Vec<f64>>,
    moved: &'m [RecorderChange],
}

impl<'m> TailWide<'m> {
    /// Searches the units of the tails. Unrecorded steps and resets count: those of several units at once, and those when
    /// what is fitted of all of them `moved`.
    pub(crate) fn new(judged: &[(&History, &Assessment)], moved: &'m [RecorderChange]) -> Self {
        let mut on_tails: BTreeMap<&str, Vec<UnitOnTail>> = BTreeMap::new();
        let mut levels_m: BTreeMap<String, Vec<f64>> = BTreeMap::new();
        let steps_of = |(history, trend): &(&'_ History, &Assessment)| {
            let mut steps: BTreeMap<String, Vec<(i64, f64)>> = BTreeMap::new();
            for change in trend.changes.iter().filter(|change| is_sudden(change)) {
                let Some((_, tail)) = made_on(change, history) else { continue };
                steps.entry(tail.to_owned()).or_default().push((change.departure_us, change.step_m));
            }
            steps
        };
        let stepped: BTreeSet<String> = judged.iter().flat_map(|unit| steps_of(unit).into_keys()).collect();
        for unit in judged {
            let (history, trend) = unit;
            if !history.tails().any(|tail| stepped.contains(tail)) {
                continue;
            }
            let mut steps = steps_of(unit);
            for (tail, (first_us, last_us)) in spans(history, trend.as_of_us) {
                levels_m.entry(tail.to_owned()).or_default().extend(trend.level.map(|level| level.gap_m));
                let steps = steps.remove(tail).unwrap_or_default();
                on_tails.entry(tail).or_default().push(UnitOnTail { first_us, last_us, steps });
            }
        }
        let found = on_tails.iter().map(|(tail, units)| ((*tail).to_owned(), tail_wide_steps(units)));
        let steps = found.filter(|(_, steps)| !steps.is_empty()).collect();
        Self { steps, levels_m, moved }
    }

    /// The tail whose change it is; none where it is the unit's own.
    pub(crate) fn tail<'a>(&self, change: &ChangePoint, history: &'a History) -> Option<&'a str> {
        let (flown, tail) = made_on(change, history)?;
        let is_within = |step: &TailWideStep| {
            (step.first_us..=step.last_us).contains(&change.departure_us) && step.step_m * change.step_m > 0.0
        };
        let steps = self.steps.get(tail).map_or(&[][..], Vec::as_slice);
        let is_explained = || self.moved.iter().any(|moved| moved.explains(tail, flown.departure_utc()));
        (is_sudden(change) && (steps.iter().any(is_within) || is_explained())).then_some(tail)
    }

    /// One change of the gap for each tail-wide step.
    pub(crate) fn changes(&self) -> impl Iterator<Item = QuantityChange> {
        let of_tail = |(tail, steps): (&String, &Vec<TailWideStep>)| {
            let level_m = trend::quantity::median(self.levels_m.get(tail).cloned().unwrap_or_default());
            let of = |step: &TailWideStep| of_step(tail, step, level_m.unwrap_or_default());
            steps.iter().filter_map(of).collect::<Vec<_>>()
        };
        self.steps.iter().flat_map(of_tail)
    }
}

/// The change of the gap that a tail made, with the median level of its units now.
fn of_step(tail: &str, step: &TailWideStep, level_m: f64) -> Option<QuantityChange> {
    let scope = ChangeScope::Tail;
    let since_utc = Timestamp::from_microsecond(step.first_us).ok()?;
    Some(QuantityChange {
        quantity: Quantity::GapM.as_str(),
        scope: scope.as_str(),
        kind: "step",
        tail_number: Some(tail.to_owned()),
        units: step.units as i64,
        units_able: step.units_able as i64,
        since_utc,
        from: level_m - step.step_m,
        to: level_m,
        change_se: f64::NAN,
        state: scope.state(),
        evidence: format!(
            "the gaps of {} of {} units of {tail} stepped by {:+.1} µm since {}: {}",
            step.units,
            step.units_able,
            step.step_m * 1e6,
            since_utc.strftime("%Y-%m-%d"),
            scope.cause(),
        ),
        ..QuantityChange::default()
    })
}

/// Whether a change of the gap was sudden and is not on record.
fn is_sudden(change: &ChangePoint) -> bool {
    matches!(change.kind, ChangePointKind::Step | ChangePointKind::Reset)
}

/// The first flight after a change, and its tail.
fn made_on<'a>(change: &ChangePoint, history: &'a History) -> Option<(&'a FlightRow, &'a str)> {
    let flown = history.at(Timestamp::from_microsecond(change.departure_us).ok()?)?;
    Some((flown, history.place(flown).tail_number.as_deref()?))
}

/// Departures of the first and last gap of a unit on each of its tails, microseconds since 1970 UTC.
fn spans(history: &History, as_of_us: i64) -> BTreeMap<&str, (i64, i64)> {
    let mut spans: BTreeMap<&str, (i64, i64)> = BTreeMap::new();
    let known = Timestamp::from_microsecond(as_of_us).map_or(&[][..], |as_of| history.until(as_of));
    for flown in known.iter().filter(|flown| flown.gap_m().is_some()) {
        if let Some(tail) = history.place(flown).tail_number.as_deref() {
            let at_us = flown.departure_us();
            spans.entry(tail).and_modify(|span| span.1 = at_us).or_insert((at_us, at_us));
        }
    }
    spans
}
