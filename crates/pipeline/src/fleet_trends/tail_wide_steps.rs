//! Tail-wide steps: all actuators of a tail step at once, because a sensor or a recorder changed.

use std::collections::{BTreeMap, BTreeSet};

use jiff::Timestamp;
use trend::{Assessment, ChangePoint, ChangePointKind};

use crate::history::flight_row::FlightRow;
use crate::history::histories::History;
use crate::monitoring::recorder_change::RecorderChange;
use records::time::days_between;

/// Days within which steps of one tail are one step: a step is dated to within some flights.
const SAME_DAYS: f64 = 7.0;

/// Minimum share of the tail's units that make the step: single units may be too noisy.
const SHARE: f64 = 0.75;

/// Tail-wide changes, by tail and departure.
#[derive(Debug, Default)]
pub(crate) struct TailWide(BTreeSet<(String, Timestamp)>);

/// A change of one of the assessed units.
struct Made<'a> {
    tail_number: &'a str,
    departure_utc: Timestamp,
    kind: ChangePointKind,
    unit: usize,
}

impl TailWide {
    /// Searches the units of one tail. Unrecorded changes count: a step of several units at once, and a
    /// step or reset when what is fitted of all of them `moved`.
    pub(crate) fn new(judged: &[(&History, &Assessment)], moved: &[RecorderChange]) -> Self {
        let made: Vec<Made<'_>> =
            judged.iter().enumerate().flat_map(|(unit, (h, t))| changes(unit, h, t)).collect();
        let mut by_tail: BTreeMap<&str, Vec<&Made<'_>>> = BTreeMap::new();
        for change in made.iter().filter(|change| change.kind == ChangePointKind::Step) {
            by_tail.entry(change.tail_number).or_default().push(change);
        }
        let mut units: BTreeMap<&str, Vec<GapSpan>> = BTreeMap::new();
        for unit in judged {
            for tail in unit.0.tails().collect::<BTreeSet<_>>() {
                if let Some(span) = by_tail.contains_key(tail).then(|| GapSpan::of(unit, tail)).flatten() {
                    units.entry(tail).or_default().push(span);
                }
            }
        }
        let is_wide = |change: &&Made<'_>| {
            let steps = by_tail.get(change.tail_number).map_or(&[][..], Vec::as_slice);
            let units = units.get(change.tail_number).map_or(&[][..], Vec::as_slice);
            is_explained(change, moved)
                || (change.kind == ChangePointKind::Step && is_of_all(change, steps, units))
        };
        let wide = made.iter().filter(is_wide).map(|c| (c.tail_number.to_owned(), c.departure_utc));
        Self(wide.collect())
    }

    /// The tail whose change it is; none where it is the unit's own.
    pub(crate) fn tail<'a>(&self, change: &ChangePoint, history: &'a History) -> Option<&'a str> {
        let (flown, tail_number) = made_on(change, history)?;
        self.0.contains(&(tail_number.to_owned(), flown.departure_utc())).then_some(tail_number)
    }
}

/// The first flight after a change, and its tail.
fn made_on<'a>(change: &ChangePoint, history: &'a History) -> Option<(&'a FlightRow, &'a str)> {
    let flown = history.at(Timestamp::from_microsecond(change.departure_us).ok()?)?;
    Some((flown, history.place(flown).tail_number.as_deref()?))
}

fn changes<'a>(unit: usize, history: &'a History, trend: &'a Assessment) -> impl Iterator<Item = Made<'a>> {
    let unbooked =
        trend.changes.iter().filter(|c| matches!(c.kind, ChangePointKind::Step | ChangePointKind::Reset));
    unbooked.filter_map(move |change| {
        let (flown, tail_number) = made_on(change, history)?;
        Some(Made { tail_number, departure_utc: flown.departure_utc(), kind: change.kind, unit })
    })
}

fn is_explained(change: &Made<'_>, moved: &[RecorderChange]) -> bool {
    moved.iter().any(|moved| moved.explains(change.tail_number, change.departure_utc))
}

/// First and last gap of a unit on a tail.
struct GapSpan {
    first_utc: Timestamp,
    last_utc: Timestamp,
}

impl GapSpan {
    fn of((history, trend): &(&History, &Assessment), tail: &str) -> Option<Self> {
        let is_on_tail =
            |f: &&FlightRow| f.gap_m().is_some() && history.place(f).tail_number.as_deref() == Some(tail);
        let known = history.until(Timestamp::from_microsecond(trend.as_of_us).ok()?);
        let departure = |flown: &FlightRow| flown.departure_utc();
        let first_utc = known.iter().find(is_on_tail).map(departure)?;
        Some(Self { first_utc, last_utc: known.iter().rev().find(is_on_tail).map(departure)? })
    }
}

/// Whether the units that flew on the tail some time before it, and after, made it together.
fn is_of_all(change: &Made<'_>, steps: &[&Made<'_>], units: &[GapSpan]) -> bool {
    let near = |step: &&&Made<'_>| days_between(step.departure_utc, change.departure_utc).abs() <= SAME_DAYS;
    let stepped: BTreeSet<usize> = steps.iter().filter(near).map(|step| step.unit).collect();
    let is_there = |unit: &&GapSpan| {
        days_between(unit.first_utc, change.departure_utc) > SAME_DAYS
            && unit.last_utc >= change.departure_utc
    };
    stepped.len() > 1 && stepped.len() as f64 >= SHARE * units.iter().filter(is_there).count() as f64
}
