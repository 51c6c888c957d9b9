//! A unit's history read: outliers out, offsets of the measurement undone, cut where it was reset.

use crate::clean::{Clean, Estimate, Scatter, clean};
use crate::jump::{Jump, jumps};
use crate::normal;
use crate::posterior::Segment;
use crate::prior::FleetPrior;
use crate::series::{Booked, Flight};
use crate::trend::{Change, ChangeKind};

/// A step larger than this is never a matter of rigging, metres: a fall made the unit new, a rise is damage.
const RIGGING_M: f64 = 15e-6;

/// Flights from a change of installation within which a step is the books' own.
const BOOKED_FLIGHTS: usize = 3;

/// What a unit's flights show, apart from wear.
#[derive(Debug, Clone)]
pub(crate) struct History {
    pub(crate) estimates: Vec<Estimate>,
    pub(crate) outliers: Vec<usize>,
    pub(crate) scatter: Scatter,
    pub(crate) changes: Vec<Change>,
    /// Variance that undone offsets leave in the level, m².
    pub(crate) offset_m2: f64,
    begins: Vec<Begin>,
    /// What has been taken off the last estimates, metres.
    pub(crate) undone_m: f64,
    /// The first estimate after the last step.
    pub(crate) last_step: usize,
    now: f64,
    known_age: Option<f64>,
}

/// Where a segment begins.
#[derive(Debug, Clone, Copy)]
struct Begin {
    estimate: usize,
    usage: f64,
    /// As good as new.
    fresh: bool,
}

/// Reads the flights along the axis that wear follows.
pub(crate) fn read(
    flights: &[Flight],
    book: &[Booked],
    known_age: Option<f64>,
    prior: &FleetPrior,
) -> History {
    let now = flights.last().map_or(0.0, |f| prior.usage(f));
    let Clean { mut estimates, outliers, scatter } = clean(flights);
    let found = jumps(&estimates);
    for estimate in &mut estimates {
        estimate.usage = prior.usage(&flights[estimate.flight]);
    }
    let mut history = History {
        estimates,
        outliers,
        scatter,
        changes: Vec::new(),
        offset_m2: 0.0,
        begins: vec![Begin { estimate: 0, usage: 0.0, fresh: false }],
        undone_m: 0.0,
        last_step: found.last().map_or(0, |jump| jump.at),
        now,
        known_age,
    };
    for jump in &found {
        history.apply(jump, flights, book, prior);
    }
    history.changes.extend(unseen(flights, book, &found, &history.estimates));
    history
}

impl History {
    /// The same with the usage of another axis.
    pub(crate) fn along(&self, flights: &[Flight], prior: &FleetPrior) -> Self {
        let mut history = self.clone();
        for estimate in &mut history.estimates {
            estimate.usage = prior.usage(&flights[estimate.flight]);
        }
        for begin in history.begins.iter_mut().skip(1) {
            begin.usage = history.estimates[begin.estimate - 1].usage;
        }
        history.now = flights.last().map_or(0.0, |f| prior.usage(f));
        history
    }

    /// Names a step and undoes it, or begins a segment with it.
    fn apply(&mut self, jump: &Jump, flights: &[Flight], book: &[Booked], prior: &FleetPrior) {
        let flight = self.estimates[jump.at].flight;
        let mut entries = book.iter().filter(|entry| is_near(entry, flights, flight)).peekable();
        let kind = if entries.peek().is_some() || booked(flights, flight) {
            ChangeKind::Recorded
        } else if self.is_reset(jump, prior) {
            ChangeKind::Reset
        } else {
            ChangeKind::Step
        };
        let departure_us = flights[flight].departure_us;
        let certainty = match kind {
            ChangeKind::Recorded => 1.0,
            _ => normal::cdf(jump.step_m.abs() / jump.se_m),
        };
        self.changes.push(Change { departure_us, kind, step_m: jump.step_m, se_m: jump.se_m, certainty });
        let renewed = entries.any(|entry| entry.renews) && jump.step_m < 0.0;
        if kind == ChangeKind::Reset || renewed {
            self.begin(jump.at, true);
        } else if self.undone_m + jump.step_m > RIGGING_M {
            // To undo what may be damage would hide it.
            let hidden_m = std::mem::take(&mut self.undone_m);
            self.shift(jump.at, hidden_m);
            self.begin(jump.at, false);
        } else {
            self.undone_m += jump.step_m;
            self.shift(jump.at, -jump.step_m);
            self.offset_m2 += jump.se_m * jump.se_m;
        }
    }

    /// Begins a segment, which knows nothing of what was undone before.
    fn begin(&mut self, estimate: usize, fresh: bool) {
        self.begins.push(Begin { estimate, usage: self.estimates[estimate - 1].usage, fresh });
        self.offset_m2 = 0.0;
    }

    /// Moves every estimate from one on.
    fn shift(&mut self, from: usize, by_m: f64) {
        for estimate in &mut self.estimates[from..] {
            estimate.gap_m += by_m;
        }
    }

    /// A fall to where a new unit's gap is likelier than one of an arbitrary size within rigging's reach.
    fn is_reset(&self, jump: &Jump, prior: &FleetPrior) -> bool {
        let after = &self.estimates[jump.at..self.estimates.len().min(jump.at + 20)];
        let level_m = after.iter().map(|e| e.gap_m).sum::<f64>() / after.len() as f64;
        let sd_m = prior.new_sd_m.hypot(jump.se_m);
        let z = (level_m - prior.new_m) / sd_m;
        let new = (-0.5 * z * z).exp() / (sd_m * (2.0 * std::f64::consts::PI).sqrt());
        let rigging = 0.5 / RIGGING_M;
        jump.step_m < 0.0 && (new > rigging || jump.step_m < -RIGGING_M)
    }

    /// The segments, oldest first.
    pub(crate) fn segments(&self) -> impl Iterator<Item = Segment<'_>> {
        self.begins.iter().enumerate().map(|(i, begin)| {
            let next = self.begins.get(i + 1);
            let end = next.map_or(self.estimates.len(), |next| next.estimate);
            Segment {
                estimates: &self.estimates[begin.estimate..end],
                begin: begin.usage,
                now: next.map_or(self.now, |next| next.usage),
                fresh: begin.fresh,
                known_age: self.known_age.filter(|_| i == 0),
            }
        })
    }
}

/// Whether an entry of the book was made within a few flights of one.
fn is_near(entry: &Booked, flights: &[Flight], flight: usize) -> bool {
    let from = flights[flight.saturating_sub(BOOKED_FLIGHTS + 1)].departure_us;
    let to = flights[(flight + BOOKED_FLIGHTS).min(flights.len() - 1)].departure_us;
    (from..=to).contains(&entry.utc_us)
}

/// Entries of the book that the gap does not show, at the first flight after each.
fn unseen<'a>(
    flights: &'a [Flight],
    book: &'a [Booked],
    found: &'a [Jump],
    estimates: &'a [Estimate],
) -> impl Iterator<Item = Change> + 'a {
    let shown = |entry: &Booked| found.iter().any(|jump| is_near(entry, flights, estimates[jump.at].flight));
    book.iter().filter(move |entry| !shown(entry)).filter_map(|entry| {
        let first = flights.get(flights.partition_point(|f| f.departure_us < entry.utc_us))?;
        let departure_us = first.departure_us;
        Some(Change { departure_us, kind: ChangeKind::Recorded, step_m: 0.0, se_m: 0.0, certainty: 1.0 })
    })
}

/// Whether the books know of a change of installation near this flight.
fn booked(flights: &[Flight], flight: usize) -> bool {
    let from = flight.saturating_sub(BOOKED_FLIGHTS + 1);
    let to = (flight + BOOKED_FLIGHTS + 1).min(flights.len());
    flights[from..to].windows(2).any(|pair| pair[0].installation != pair[1].installation)
}
