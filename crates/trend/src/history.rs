//! A unit's history read: outliers out, offsets of the measurement undone, cut where it was reset.

use crate::clean::{Clean, Estimate, clean};
use crate::jump::{Jump, jumps};
use crate::normal;
use crate::posterior::Segment;
use crate::prior::FleetPrior;
use crate::series::{Booked, Flight};
use crate::trend::{Change, ChangeKind};

/// A fall larger than this is never a matter of rigging, metres.
const RIGGING_M: f64 = 15e-6;

/// Flights from a change of installation within which a step is the books' own.
const BOOKED_FLIGHTS: usize = 3;

/// What a unit's flights show, apart from wear.
#[derive(Debug, Clone)]
pub(crate) struct History {
    pub(crate) estimates: Vec<Estimate>,
    pub(crate) outliers: Vec<usize>,
    pub(crate) noise_factor: f64,
    pub(crate) changes: Vec<Change>,
    /// Variance that undone offsets leave in the level, m².
    pub(crate) offset_m2: f64,
    /// First estimate of each segment.
    begins: Vec<usize>,
    begin_usage: Vec<f64>,
    now: f64,
    known_age: Option<f64>,
}

/// Reads the flights along the axis that wear follows.
pub(crate) fn read(
    flights: &[Flight],
    book: &[Booked],
    known_age: Option<f64>,
    prior: &FleetPrior,
) -> History {
    let now = flights.last().map_or(0.0, |f| prior.usage(f));
    let Clean { mut estimates, outliers, noise_factor } = clean(flights);
    let found = jumps(&estimates);
    for estimate in &mut estimates {
        estimate.usage = prior.usage(&flights[estimate.flight]);
    }
    let mut history = History {
        estimates,
        outliers,
        noise_factor,
        changes: Vec::new(),
        offset_m2: 0.0,
        begins: vec![0],
        begin_usage: vec![0.0],
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
            self.begins.push(jump.at);
            self.begin_usage.push(self.estimates[jump.at - 1].usage);
            self.offset_m2 = 0.0;
        } else {
            for estimate in &mut self.estimates[jump.at..] {
                estimate.gap_m -= jump.step_m;
            }
            self.offset_m2 += jump.se_m * jump.se_m;
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
        (0..self.begins.len()).map(|i| {
            let last = i + 1 == self.begins.len();
            let end = if last { self.estimates.len() } else { self.begins[i + 1] };
            Segment {
                estimates: &self.estimates[self.begins[i]..end],
                begin: self.begin_usage[i],
                now: if last { self.now } else { self.begin_usage[i + 1] },
                fresh: i > 0,
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
