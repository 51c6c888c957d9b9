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
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub struct MappingFault {
    /// The part number, if all its actuators are affected.
    pub part_number: Option<String>,
    /// The aircraft, if one only is affected.
    pub tail_number: Option<String>,
    /// The position, if one only is affected.
    pub position: Option<String>,
    pub reason: String,
    /// Rejected flights among the latest ones, and all of these, over the actuators of the scope.
    pub refused: usize,
    /// Latest flights of the scope.
    pub flights: usize,
    pub remedy: &'static str,
    #[serde(skip)]
    pub units: BTreeSet<UnitKey>,
}

impl MappingFault {
    pub(crate) fn scope(&self) -> String {
        match (&self.part_number, &self.tail_number, &self.position) {
            (Some(part), _, _) => format!("all actuators of part {part}"),
            (_, Some(tail), Some(position)) => format!("{position} of {tail}"),
            (_, Some(tail), None) => format!("all actuators of {tail}"),
            _ => "all actuators".to_owned(),
        }
    }

    pub(crate) fn evidence(&self) -> String {
        format!("{} on {} of the latest {} flights", self.reason, self.refused, self.flights)
    }
}

impl std::fmt::Display for MappingFault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: {}; {}", self.scope(), self.evidence(), self.remedy)
    }
}

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
        let is_unlike = rejection::is_stiffness_unlike(flight.stiffness_n_per_m()?, configured_n_per_m?);
        is_unlike.then_some(rejection::STIFFNESS_UNLIKE)
    };
    flight.rejection.or_else(unlike)
}

#[cfg(test)]
mod tests {
    use jiff::{SignedDuration, Timestamp};
    use records::Quantity;

    use super::*;
    use crate::assess::quantities::values::READ;

    const SIGN: Option<&str> = Some("load_sign_flipped");

    /// Tail, position and part number of a unit, rejections of its flights, and their stiffness, N/m.
    type Unit = (&'static str, [Option<&'static str>; 5], Option<f32>);

    fn faults(units: &[Unit]) -> Vec<MappingFault> {
        let unit = |(name, rejections, stiffness_n_per_m): &Unit| {
            let flight = |(k, rejection)| RecentFlight {
                departure_utc: Timestamp::UNIX_EPOCH + SignedDuration::from_hours(k),
                rejection,
                has_gap: true,
                values: READ.map(|(of, _)| match (of, stiffness_n_per_m) {
                    (Quantity::StiffnessNPerM, Some(stiffness_n_per_m)) => *stiffness_n_per_m,
                    _ => f32::NAN,
                }),
                ..RecentFlight::default()
            };
            let [tail_number, position, part_number] =
                name.split(' ').collect::<Vec<_>>().try_into().unwrap();
            let key = PositionKey { tail_number, position, part_number, serial_number: "" };
            (key, (0..).zip(*rejections).map(flight).collect())
        };
        detect(&units.iter().map(unit).collect(), |_| Some(5e7))
    }

    #[test]
    fn most_flights_of_a_part_a_tail_or_an_actuator_name_the_widest_scope() {
        let bad = |name| (name, [None, None, SIGN, SIGN, SIGN], None);
        let good = |name| (name, [SIGN, None, None, None, SIGN], None);
        // Flights that cannot show a gap are no fault.
        let quiet = |name| (name, [Some("no_load_reversal"); 5], None);
        // A unit of measure is at fault only where all of a part number is.
        let small = |name| (name, [Some("travel_too_small"); 5], None);
        let others = ["B left P", "B nose Q", "C left P", "C nose Q"].map(good);
        for (units, scope) in [
            (vec![bad("A left P"), bad("B left P"), good("B nose Q")], Some("all actuators of part P")),
            (
                [bad("A left P"), bad("A nose Q")].into_iter().chain(others).collect(),
                Some("all actuators of A"),
            ),
            (vec![bad("A left P"), good("A right P"), good("B left P")], Some("left of A")),
            (vec![quiet("A left P"), quiet("B left P")], None),
            (vec![small("A left P")], None),
            (vec![small("A left P"), small("B left P")], Some("all actuators of part P")),
        ] {
            let scopes: Vec<String> = faults(&units).iter().map(MappingFault::scope).collect();
            assert_eq!(scopes, scope.into_iter().collect::<Vec<_>>(), "{units:?}");
        }
    }

    /// A stiffness in N/µm, or of another part, is stated for the part; one actuator that softens is no wrong setting.
    #[test]
    fn a_configured_stiffness_that_no_flight_shows_is_a_fault_of_the_part() {
        let fitted =
            |second| faults(&[("A left P", [None; 5], Some(2e7)), ("B left P", [None; 5], Some(second))]);
        let found = fitted(1.9e7);
        assert_eq!((found.len(), &*found[0].reason, found[0].refused), (1, "stiffness_unlike", 10));
        assert!(fitted(4e7).is_empty());
    }
}
