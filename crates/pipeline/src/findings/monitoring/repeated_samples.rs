//! Flights whose estimates are equal to the last digit: the samples of one log under several names.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use jiff::Timestamp;
use serde::Serialize;

use crate::findings::monitoring::recent::RecentFlights;

/// Two flights with the same samples, by their normalised innovations, fitted stiffness and all other quantities.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[expect(missing_docs, reason = "each field is named for the contract's column")]
pub struct RepeatedSamples {
    pub tail_number: String,
    pub flight_id: String,
    /// Positions with the samples of the other flight.
    pub positions: Vec<String>,
    pub other_tail_number: String,
    pub other_flight_id: String,
    /// Positions of the other flight, in the same order.
    pub other_positions: Vec<String>,
}

/// Tail, departure, and the flight's name, which may recur.
type Flown<'a> = (&'a str, Timestamp, &'a str);

/// The pairs of flights with equal estimates. Noise makes two records of one motion differ.
pub(crate) fn detect(recent: &RecentFlights<'_>) -> Vec<RepeatedSamples> {
    let mut first = HashMap::<_, (Flown<'_>, &str)>::new();
    let mut pairs = BTreeMap::<(Flown<'_>, Flown<'_>), BTreeSet<(&str, &str)>>::new();
    for (key, flights) in recent {
        for flight in flights {
            let Some(quantities) = flight.quantities() else { continue };
            let flown = (key.tail_number, flight.departure_utc, flight.flight_id);
            let place = (flown, key.position);
            let known = *first.entry(quantities).or_insert(place);
            if known != place {
                pairs.entry((known.0, flown)).or_default().insert((known.1, place.1));
            }
        }
    }
    let repeated = |((one, other), positions): ((Flown<'_>, Flown<'_>), BTreeSet<(&str, &str)>)| {
        let places = positions.into_iter().map(|(own, other)| (own.to_owned(), other.to_owned()));
        let (positions, other_positions) = places.unzip();
        RepeatedSamples {
            tail_number: one.0.to_owned(),
            flight_id: one.2.to_owned(),
            positions,
            other_tail_number: other.0.to_owned(),
            other_flight_id: other.2.to_owned(),
            other_positions,
        }
    };
    pairs.into_iter().map(repeated).collect()
}

impl std::fmt::Display for RepeatedSamples {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{} of {} ({}) and {} of {} ({}) have the same samples; correct the column or the identity of the wrong one",
            self.flight_id,
            self.tail_number,
            self.positions.join(", "),
            self.other_flight_id,
            self.other_tail_number,
            self.other_positions.join(", ")
        )
    }
}
