//! Rejections of most flights of an actuator, a tail or a part number: a wrong mapping, not a matter of the flights.

use std::collections::{BTreeMap, BTreeSet};

use job::rejection;
use serde::Serialize;

use crate::findings::monitoring::recent::{PositionKey, RecentFlight, RecentFlights};
use crate::fleet::histories::UnitKey;

/// Latest flights of an actuator that count.
const LATEST: usize = 5;

/// Fewest flights of a scope that show a fault.
const MIN_FLIGHTS: usize = 3;

/// A wrong mapping, sign, unit or rate, by its effect: most of the latest flights of a scope are rejected for it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct MappingFault {
    /// The part number, if all its actuators are affected.
    pub part_number: Option<String>,
    /// The aircraft, if one only is affected.
    pub tail_number: Option<String>,
    /// The position, if one only is affected.
    pub position: Option<String>,
    /// Rejection code.
    pub reason: String,
    /// Rejected flights among the latest ones, and all of these, over the actuators of the scope.
    pub refused: usize,
    /// Latest flights of the scope.
    pub flights: usize,
    /// What to change in the configuration.
    pub remedy: &'static str,
    /// Units of the scope.
    #[serde(skip)]
    pub units: BTreeSet<UnitKey>,
}

impl MappingFault {
    /// The affected scope as text.
    pub(crate) fn scope(&self) -> String {
        match (&self.part_number, &self.tail_number, &self.position) {
            (Some(part), _, _) => format!("all actuators of part {part}"),
            (_, Some(tail), Some(position)) => format!("{position} of {tail}"),
            (_, Some(tail), None) => format!("all actuators of {tail}"),
            _ => "all actuators".to_owned(),
        }
    }

    /// The code and its frequency.
    pub(crate) fn evidence(&self) -> String {
        format!("{} on {} of the latest {} flights", self.reason, self.refused, self.flights)
    }
}

/// Scope, evidence and remedy.
impl std::fmt::Display for MappingFault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: {}; {}", self.scope(), self.evidence(), self.remedy)
    }
}

/// Rejections of the latest flights of some actuators.
#[derive(Default)]
struct Tally<'a> {
    codes: Vec<Option<&'a str>>,
    members: BTreeSet<PositionKey<'a>>,
}

/// The faults of the mapping, the widest scope first: a part number, a tail, an actuator.
///
/// `stiffness` gives the configured stiffness of a part number, N/m.
pub(crate) fn detect(
    recent: &RecentFlights<'_>,
    stiffness: impl Fn(&str) -> Option<f64>,
) -> Vec<MappingFault> {
    type Scope = for<'k> fn(&PositionKey<'k>) -> [Option<&'k str>; 3];
    let scopes: [Scope; 3] = [
        |key| [Some(key.part_number), None, None],
        |key| [None, Some(key.tail_number), None],
        |key| [None, Some(key.tail_number), Some(key.position)],
    ];
    let (mut found, mut explained) = (Vec::new(), BTreeSet::<PositionKey<'_>>::new());
    for (width, scope) in scopes.into_iter().enumerate() {
        let mut tallies: BTreeMap<_, Tally<'_>> = BTreeMap::new();
        for (key, flights) in recent.iter().filter(|(key, _)| !explained.contains(key)) {
            let tally = tallies.entry(scope(key)).or_default();
            let latest = &flights[flights.len().saturating_sub(LATEST)..];
            let configured = stiffness(key.part_number);
            tally.codes.extend(latest.iter().map(|flight| code(flight, configured)));
            tally.members.insert(*key);
        }
        let is_wide = width < 2;
        for (scope, tally) in tallies {
            let majority = rejection::majority(&tally.codes).filter(|_| tally.codes.len() >= MIN_FLIGHTS);
            let Some((reason, refused)) = majority else { continue };
            let remedy = match width {
                0 => rejection::part_remedy(reason),
                _ => rejection::remedy(reason).filter(|_| rejection::is_mapping_fault(reason)),
            };
            let Some(remedy) = remedy.filter(|_| !is_wide || tally.members.len() > 1) else { continue };
            let unit =
                |key: &PositionKey<'_>| (Some(key.part_number.to_owned()), key.serial_number.to_owned());
            let [part_number, tail_number, position] = scope.map(|name| name.map(str::to_owned));
            found.push(MappingFault {
                part_number,
                tail_number,
                position,
                reason: reason.to_owned(),
                refused,
                flights: tally.codes.len(),
                remedy,
                units: tally.members.iter().map(unit).collect(),
            });
            explained.extend(tally.members);
        }
    }
    found
}

/// Rejection of a flight, or the code of a stiffness that is not the configured one.
fn code(flight: &RecentFlight<'_>, configured_n_per_m: Option<f64>) -> Option<&'static str> {
    let unlike = || {
        let is_unlike = rejection::is_stiffness_unlike(flight.stiffness_n_per_m?, configured_n_per_m?);
        is_unlike.then_some(rejection::STIFFNESS_UNLIKE)
    };
    flight.rejection.or_else(unlike)
}

#[cfg(test)]
mod tests {
    use jiff::{SignedDuration, Timestamp};

    use super::*;

    fn key(
        tail_number: &'static str,
        position: &'static str,
        part_number: &'static str,
    ) -> PositionKey<'static> {
        PositionKey { tail_number, position, part_number, serial_number: "" }
    }

    fn flights(rejections: [Option<&'static str>; 5]) -> Vec<RecentFlight<'static>> {
        let flight = |(k, rejection): (usize, Option<&'static str>)| RecentFlight {
            departure_utc: Timestamp::UNIX_EPOCH + SignedDuration::from_hours(k as i64),
            rejection,
            ..RecentFlight::default()
        };
        rejections.into_iter().enumerate().map(flight).collect()
    }

    const SIGN: Option<&'static str> = Some("load_sign_flipped");

    fn scopes(latest: &RecentFlights<'_>) -> Vec<String> {
        detect(latest, |_| Some(5e7)).iter().map(MappingFault::scope).collect()
    }

    #[test]
    fn most_flights_of_a_part_a_tail_or_an_actuator_name_the_widest_scope() {
        let bad = || flights([None, None, SIGN, SIGN, SIGN]);
        let good = || flights([SIGN, None, None, None, SIGN]);
        let part =
            [(key("A", "left", "P"), bad()), (key("B", "left", "P"), bad()), (key("B", "nose", "Q"), good())];
        assert_eq!(scopes(&part.into()), ["all actuators of part P"]);
        let tail = [
            (key("A", "left", "P"), bad()),
            (key("A", "nose", "Q"), bad()),
            (key("B", "left", "P"), good()),
            (key("B", "nose", "Q"), good()),
            (key("C", "left", "P"), good()),
            (key("C", "nose", "Q"), good()),
        ];
        assert_eq!(scopes(&tail.into()), ["all actuators of A"]);
        let one = [
            (key("A", "left", "P"), bad()),
            (key("A", "right", "P"), good()),
            (key("B", "left", "P"), good()),
        ];
        assert_eq!(scopes(&one.into()), ["left of A"]);
    }

    /// A stiffness in N/µm, or of another part, is stated for the part; one actuator that softens is no wrong setting.
    #[test]
    fn a_configured_stiffness_that_no_flight_shows_is_a_fault_of_the_part() {
        let fitted = |n_per_m: f64| {
            let mut flights = flights([None; 5]);
            flights.iter_mut().for_each(|flight| flight.stiffness_n_per_m = Some(n_per_m));
            flights
        };
        let all = |second| [(key("A", "left", "P"), fitted(2e7)), (key("B", "left", "P"), fitted(second))];
        let found = detect(&all(1.9e7).into(), |_| Some(5e7));
        assert_eq!((found.len(), &*found[0].reason, found[0].refused), (1, "stiffness_unlike", 10));
        assert!(scopes(&all(4e7).into()).is_empty());
    }

    /// Flights that cannot show a gap are no fault; a unit of measure is at fault only where all of a part number is.
    #[test]
    fn causes_of_single_flights_are_no_fault_of_the_mapping() {
        let quiet = || flights([Some("no_load_reversal"); 5]);
        let small = || flights([Some("travel_too_small"); 5]);
        assert_eq!(
            scopes(&[(key("A", "left", "P"), quiet()), (key("B", "left", "P"), quiet())].into()),
            [""; 0]
        );
        assert_eq!(scopes(&[(key("A", "left", "P"), small())].into()), [""; 0]);
        let both = [(key("A", "left", "P"), small()), (key("B", "left", "P"), small())];
        assert_eq!(scopes(&both.into()), ["all actuators of part P"]);
    }
}
