//! Flights whose estimates are equal to the last digit: the samples of one log under several names.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use jiff::Timestamp;
use serde::Serialize;

use crate::findings::monitoring::recent::RecentDiagnostics;

/// Two flights with the samples of one, by their normalised innovations and fitted stiffness.
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

/// Tail, departure, and the flight's name, which may fly again.
type Flown<'a> = (&'a str, Timestamp, &'a str);

/// The pairs of flights with equal estimates. Noise makes two records of one motion differ.
pub(crate) fn detect(recent: &RecentDiagnostics) -> Vec<RepeatedSamples> {
    let mut first = HashMap::<(u64, u64), (Flown<'_>, &str)>::new();
    let mut pairs = BTreeMap::<(Flown<'_>, Flown<'_>), BTreeSet<(&str, &str)>>::new();
    for (key, flights) in recent {
        for flight in flights {
            let Some((nis, stiffness)) = flight.nis.zip(flight.stiffness_n_per_m) else { continue };
            let flown = (key.tail_number.as_str(), flight.departure_utc, &*flight.flight_id);
            let place = (flown, key.position.as_str());
            let known = *first.entry((nis.to_bits(), stiffness.to_bits())).or_insert(place);
            if known != place {
                pairs.entry((known.0, flown)).or_default().insert((known.1, place.1));
            }
        }
    }
    let mut found = Vec::new();
    for ((one, other), positions) in pairs {
        let (own, others) =
            positions.iter().map(|(own, other)| ((*own).to_owned(), (*other).to_owned())).unzip();
        found.push(RepeatedSamples {
            tail_number: one.0.to_owned(),
            flight_id: one.2.to_owned(),
            positions: own,
            other_tail_number: other.0.to_owned(),
            other_flight_id: other.2.to_owned(),
            other_positions: others,
        });
    }
    found
}

/// Both flights with their positions.
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
