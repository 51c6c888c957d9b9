//! A state that remembers: held by what the unit's own last flights said, and by no statement that was made.

use crate::error::Error;
use crate::kept::Kept;
use crate::prior::FleetPrior;
use crate::series::{Booked, Flight, Series};
use crate::settings::Settings;
use crate::state::{Evidence, State, judge};
use crate::trend::Trend;

/// Flights with a gap that are asked what their state was: more than what one wave of the level lasts. With
/// eight of them 7 of 360 simulated units that wore through a limit went back once, with 24 none.
const RECALLED: usize = 24;

/// States what is known of a unit on a day as [`trend()`](crate::trend()) does, its previous state being the most urgent
/// one of its last 24 flights with a gap before.
///
/// The state of a night so follows from the flights alone: the same flights give the same state whether
/// or not a statement was made every night, and a unit at its limit does not change its state from night
/// to night. Earlier flights are judged by the same prior, and only where a memory could matter.
///
/// # Errors
/// As [`trend()`](crate::trend()).
pub fn remembered(
    series: &Series,
    as_of_us: i64,
    settings: &Settings,
    prior: Option<&FleetPrior>,
) -> Result<Trend, Error> {
    settings.check()?;
    let vague = FleetPrior::vague(settings.limit_m);
    let prior = prior.unwrap_or(&vague);
    let (mut kept, standing) = Kept::standing(series, as_of_us, prior);
    let said = kept.statement(standing, as_of_us, series.book_until(as_of_us), settings, prior, None);
    let last_gap_us = kept.last_gap_us();
    if !could_matter(&said, last_gap_us, settings) {
        return Ok(said);
    }
    let mut previous = None;
    for departure_us in recalled(series.until(as_of_us)) {
        let earlier = kept.until(departure_us);
        let earlier = earlier.map(|kept| kept.says(departure_us, series.book(), settings, prior, None));
        let earlier = earlier.transpose()?.flatten().unwrap_or_else(|| {
            // From the checkpoint before, on which still earlier flights may stand, too.
            let standing;
            (kept, standing) = Kept::standing(series, departure_us, prior);
            kept.statement(standing, departure_us, series.book_until(departure_us), settings, prior, None)
        });
        previous = previous.max(earlier.state);
    }
    Ok(judged_again(said, last_gap_us, settings, previous))
}

impl Kept {
    /// States what is known of the unit on a day as [`remembered`] does from its whole history.
    ///
    /// Nothing as [`Kept::says`], and where a memory could matter that goes back beyond the last checkpoint.
    ///
    /// # Errors
    /// As [`trend()`](crate::trend()).
    pub fn remembers(
        &self,
        as_of_us: i64,
        book: &[Booked],
        settings: &Settings,
        prior: &FleetPrior,
    ) -> Result<Option<Trend>, Error> {
        let Some(said) = self.says(as_of_us, book, settings, prior, None)? else { return Ok(None) };
        if !could_matter(&said, self.last_gap_us(), settings) {
            return Ok(Some(said));
        }
        let asked = recalled(&self.tail);
        if asked.len() < RECALLED {
            return Ok(None);
        }
        let mut previous = None;
        for departure_us in asked {
            let Some(kept) = self.until(departure_us) else { return Ok(None) };
            let Some(earlier) = kept.says(departure_us, book, settings, prior, None)? else {
                return Ok(None);
            };
            previous = previous.max(earlier.state);
        }
        Ok(Some(judged_again(said, self.last_gap_us(), settings, previous)))
    }
}

/// Departures of the flights that are asked what their state was.
fn recalled(flights: &[Flight]) -> Vec<i64> {
    let seen = flights.iter().rev().filter(|flight| flight.gap.is_some());
    seen.skip(1).take(RECALLED).map(|flight| flight.departure_us).collect()
}

/// Whether any previous state would change what is said.
fn could_matter(said: &Trend, last_gap_us: Option<i64>, settings: &Settings) -> bool {
    judge(&evidence(said, last_gap_us), settings, Some(State::Act)).0 != said.state
}

/// The same with the state that follows from the previous one.
fn judged_again(
    said: Trend,
    last_gap_us: Option<i64>,
    settings: &Settings,
    previous: Option<State>,
) -> Trend {
    let (state, reason) = judge(&evidence(&said, last_gap_us), settings, previous);
    Trend { state, reason, ..said }
}

/// What a statement's state was judged by.
fn evidence(said: &Trend, last_gap_us: Option<i64>) -> Evidence<'_> {
    Evidence {
        last_gap_us,
        estimates: said.estimates,
        as_of_us: said.as_of_us,
        level: said.level,
        crossing: said.crossing,
        changes: &said.changes,
        unsupported: None,
    }
}
