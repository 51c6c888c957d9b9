//! One serial number's flights in order, with the usage behind each gap.

use crate::error::Error;

pub(crate) const DAY_US: i64 = 86_400_000_000;
const HOUR_US: f64 = 3.6e9;

/// One flight of a unit, as a caller knows it; order does not matter.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Observation {
    /// Departure, microseconds since 1970 UTC.
    pub departure_us: i64,
    /// The installation, interned: one period of the unit on one tail and position. A unit that was
    /// taken off and came back to the same tail has a new one, or another unit's hours would be its.
    pub installation: u32,
    /// Which of the flights that depart at one time, where only their day is known; else 0.
    pub flight: u32,
    /// Length of the flight, hours.
    pub flight_hours: Option<f64>,
    /// The tail's total hours after the flight.
    pub tail_hours_end: Option<f64>,
    /// Load reversals of this actuator in the flight.
    pub load_reversals: Option<u64>,
    /// The gap, metres; `None` for a flight that was refused, which still counts as usage.
    pub gap_m: Option<f64>,
    /// Its standard error, metres; `None` where nothing was stated.
    pub gap_se_m: Option<f64>,
    /// Whether a quality flag makes the gap uncertain: such a record alone neither confirms nor clears anything.
    pub is_doubtful: bool,
}

/// Length of a flight that states none and has no hour meter, hours.
const USUAL_FLIGHT_HOURS: f64 = 1.5;

/// Where the hours of a unit are known from, the most complete source first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, strum::Display)]
#[strum(serialize_all = "snake_case")]
pub enum UsageSource {
    /// The flights table: every flight of the aircraft, with or without a log.
    FlightsTable,
    /// The hour meter of the aircraft, which also counts flights without a log.
    #[strum(serialize = "tail_hours")]
    TailHourMeter,
    /// The lengths of the logged flights alone: flights without a log are missing.
    #[default]
    LoggedFlights,
}

/// A gap and its stated standard error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gap {
    /// The gap, metres.
    pub gap_m: f64,
    /// Its stated standard error, metres; `NaN` where nothing was stated.
    pub se_m: f64,
    /// Whether a quality flag makes it uncertain.
    pub is_doubtful: bool,
}

/// One flight with the unit's usage at its end, counted from the start of its first flight here.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Flight {
    /// Departure, microseconds since 1970 UTC.
    pub departure_us: i64,
    /// The installation it was flown in.
    pub installation: u32,
    /// Hours flown.
    pub hours: f64,
    /// Flights flown, those without a row included as far as the hour meter shows them.
    pub flights: f64,
    /// Load reversals made.
    pub reversals: f64,
    /// What was measured, or nothing for a refusal.
    pub gap: Option<Gap>,
}

/// A recorded maintenance event.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MaintenanceEvent {
    /// When it was done, microseconds since 1970 UTC.
    pub utc_us: i64,
    /// Whether a fall of the gap around it makes the unit as good as new: a re-shim or an overhaul does,
    /// rigging and lubrication only move what is measured.
    pub renews: bool,
}

/// The flights of one serial number, by departure.
///
/// Usage follows these rules. The first four use earlier flights only, so that a series cut at a date is
/// the series that was known on that date:
///
/// 1. Between two flights of one installation that both state the tail's hours, usage is their
///    difference: an actuator also wears in flights that left no row.
/// 2. Where the meter is missing, or runs backwards, and on the first flight of an installation, usage
///    is the flight's own hours, and the usual ones where it states none.
/// 3. Hours beyond the flight's own belong to flights without a row. They count as flights and as
///    load reversals at the unit's mean so far. A flight that states no reversals adds that mean, too.
/// 4. Two rows of one installation, departure and flight number are one flight: the row with a gap wins, then the larger
///    gap, then the smaller other numbers, whatever the order of arrival. Where the gaps differ, the kept one is flagged.
/// 5. If no row of the whole series states more than 0 flight hours, all flight hours are unknown.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    flights: Vec<Flight>,
    /// The unit's hours when its first flight here began, if known.
    pub unit_hours_at_start: Option<f64>,
    /// Where the unit's usage is known from.
    pub source: UsageSource,
    maintenance: Vec<MaintenanceEvent>,
    /// Rows that cannot be right.
    pub faults: RowFaults,
}

/// Flights and maintenance of a unit until a date.
#[derive(Debug, Clone, Copy)]
pub(crate) struct UnitData<'a> {
    pub(crate) flights: &'a [Flight],
    pub(crate) maintenance: &'a [MaintenanceEvent],
}

/// Rows that cannot be right, by what was done about them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct RowFaults {
    /// Flights with records that contradict each other: the largest gap is kept, as a flagged one.
    pub contradictions: usize,
    /// Flights that depart before half of the one before has passed.
    pub overlaps: usize,
    /// Rows with negative usage, which is left out.
    pub negative_usage: usize,
    /// Hour-meter readings that contradict the others, which a caller left out.
    pub meter_readings: usize,
}

impl Series {
    /// Puts a unit's rows in order and adds up their usage.
    ///
    /// # Errors
    /// [`Error::Observation`] for hours, a gap or a standard error that is not finite, or a standard error that is not
    /// positive.
    pub fn new(rows: impl IntoIterator<Item = Observation>) -> Result<Self, Error> {
        let (rows, faults) = in_order(rows)?;
        let mut meter = UsageAccumulator::default();
        let flights: Vec<Flight> = rows.iter().map(|row| meter.add_flight(row)).collect();
        debug_assert!(
            flights.is_sorted_by_key(|flight| flight.departure_us),
            "flights are in order of departure"
        );
        debug_assert!(flights.is_sorted_by(|a, b| a.hours <= b.hours), "hours do not decrease");
        let (unit_hours_at_start, source) = (None, UsageSource::default());
        Ok(Self { flights, unit_hours_at_start, source, maintenance: Vec::new(), faults })
    }

    /// The same with the recorded maintenance of the unit, in any order.
    #[must_use]
    pub fn with_maintenance(mut self, mut maintenance: Vec<MaintenanceEvent>) -> Self {
        maintenance.sort_unstable_by_key(|entry| (entry.utc_us, entry.renews));
        self.maintenance = maintenance;
        self
    }

    /// All that may be known of the unit at a date.
    pub(crate) fn until(&self, as_of_us: i64) -> UnitData<'_> {
        UnitData { flights: self.flights_until(as_of_us), maintenance: self.maintenance_until(as_of_us) }
    }

    /// The recorded maintenance at or before a date.
    pub fn maintenance_until(&self, as_of_us: i64) -> &[MaintenanceEvent] {
        &self.maintenance[..self.maintenance.partition_point(|entry| entry.utc_us <= as_of_us)]
    }

    /// All flights.
    pub fn flights(&self) -> &[Flight] {
        &self.flights
    }

    /// The flights that departed at or before a date: all that may be known then.
    pub fn flights_until(&self, as_of_us: i64) -> &[Flight] {
        &self.flights[..self.flights.partition_point(|flight| flight.departure_us <= as_of_us)]
    }
}

/// Rows in the order of the flights, each flight once.
fn in_order(rows: impl IntoIterator<Item = Observation>) -> Result<(Vec<Observation>, RowFaults), Error> {
    let mut rows: Vec<Observation> = rows.into_iter().collect();
    let mut faults = RowFaults::default();
    if rows.iter().all(|row| row.flight_hours.is_none_or(|hours| hours == 0.0)) {
        rows.iter_mut().for_each(|row| row.flight_hours = None);
    }
    for row in &mut rows {
        let is_negative = |hours: Option<f64>| hours.is_some_and(|hours| hours < 0.0);
        faults.negative_usage +=
            usize::from(is_negative(row.flight_hours) || is_negative(row.tail_hours_end));
        check(row)?;
    }
    rows.sort_unstable_by(order);
    rows.dedup_by(|next, kept| {
        let flight = |row: &Observation| (row.departure_us, row.installation, row.flight);
        let is_same = flight(next) == flight(kept);
        // By more than single precision rounds.
        let differ = |(one_m, other_m): (f64, f64)| (one_m - other_m).abs() > 1e-6 * other_m.abs();
        if is_same && next.gap_m.zip(kept.gap_m).is_some_and(differ) && !kept.is_doubtful {
            kept.is_doubtful = true;
            faults.contradictions += 1;
        }
        is_same
    });
    let is_in_flight = |[earlier, later]: &&[Observation; 2]| {
        let lasted_us = earlier.flight_hours.unwrap_or(0.0) * HOUR_US;
        earlier.installation == later.installation
            && earlier.flight == later.flight
            && ((later.departure_us.saturating_sub(earlier.departure_us)) as f64) < lasted_us / 2.0
    };
    faults.overlaps = rows.array_windows().filter(is_in_flight).count();
    Ok((rows, faults))
}

/// Rejects values that are not finite, and errors that are not positive. Hours that no aircraft can have are left out, and a
/// gap that no unit can have is cut and flagged: one such record must not end the assessment of a fleet, nor be lost.
fn check(row: &mut Observation) -> Result<(), Error> {
    const MAX_FLIGHT_HOURS: f64 = 1e5;
    const MAX_METER_HOURS: f64 = 1e9;
    // Of a gap and of its error: far beyond any actuator, and a thousandth of an atomic nucleus.
    const MAX_GAP_M: f64 = 100.0;
    const MIN_GAP_SE_M: f64 = 1e-18;
    let departure_us = row.departure_us;
    let numbers = [
        ("flight_hours", row.flight_hours),
        ("tail_hours_end", row.tail_hours_end),
        ("gap_m", row.gap_m),
        ("gap_se_m", row.gap_se_m),
    ];
    for (what, number) in numbers {
        let is_refused =
            |value: &f64| !value.is_finite() || (what == "gap_se_m" && *value < f64::MIN_POSITIVE);
        if let Some(value) = number.filter(is_refused) {
            return Err(Error::Observation { what, departure_us, value });
        }
    }
    row.flight_hours = row.flight_hours.filter(|hours| (0.0..=MAX_FLIGHT_HOURS).contains(hours));
    row.tail_hours_end = row.tail_hours_end.filter(|hours| (0.0..=MAX_METER_HOURS).contains(hours));
    row.is_doubtful |= row.gap_m.is_some_and(|gap_m| gap_m.abs() > MAX_GAP_M);
    row.gap_m = row.gap_m.map(|gap_m| gap_m.clamp(-MAX_GAP_M, MAX_GAP_M));
    row.gap_se_m = row.gap_se_m.map(|se_m| se_m.clamp(MIN_GAP_SE_M, MAX_GAP_M));
    Ok(())
}

/// A total order, so that neither arrival nor duplicates decide anything.
fn order(a: &Observation, b: &Observation) -> std::cmp::Ordering {
    let number = |v: Option<f64>| v.unwrap_or(f64::INFINITY);
    let larger = |o: &Observation| o.gap_m.map(|gap_m| -gap_m);
    let numbers = |o: &Observation| [larger(o), o.gap_se_m, o.tail_hours_end, o.flight_hours].map(number);
    let place = |o: &Observation| (o.departure_us, o.installation, o.flight, o.gap_m.is_none());
    let by_number = || numbers(a).iter().zip(numbers(b)).map(|(a, b)| a.total_cmp(&b)).find(|o| o.is_ne());
    place(a)
        .cmp(&place(b))
        .then_with(|| by_number().unwrap_or(std::cmp::Ordering::Equal))
        .then_with(|| a.load_reversals.cmp(&b.load_reversals))
        .then_with(|| a.is_doubtful.cmp(&b.is_doubtful))
}

/// The unit's usage so far, and the hour meter it was last read against.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct UsageAccumulator {
    hours: f64,
    flights: f64,
    reversals: f64,
    /// Reversals that were stated, and the hours they were stated for.
    stated: (f64, f64),
    /// Hours flown in rows, and how many rows.
    rows: (f64, f64),
    /// Installation, meter reading and the unit's hours at the last flight that stated one.
    anchor: Option<(u32, f64, f64)>,
}

impl UsageAccumulator {
    fn add_flight(&mut self, row: &Observation) -> Flight {
        let before = self.hours;
        let metered = self.metered(row);
        let own = row.flight_hours.or(metered.map(|h| h - before)).unwrap_or(USUAL_FLIGHT_HOURS);
        self.hours = metered.unwrap_or(before + own);
        self.anchor = match row.tail_hours_end {
            Some(end) => Some((row.installation, end, self.hours)),
            None => self.anchor.filter(|(installation, ..)| *installation == row.installation),
        };
        let unseen = (self.hours - before - own).max(0.0);
        self.count(row, own, unseen);
        Flight {
            departure_us: row.departure_us,
            installation: row.installation,
            hours: self.hours,
            flights: self.flights,
            reversals: self.reversals,
            gap: row.gap_m.map(|gap_m| Gap {
                gap_m,
                se_m: row.gap_se_m.unwrap_or(f64::NAN),
                is_doubtful: row.is_doubtful,
            }),
        }
    }

    /// The unit's hours after this flight by the tail's meter, where it can be trusted.
    fn metered(&self, row: &Observation) -> Option<f64> {
        let (installation, reading, hours) = self.anchor?;
        let end = row.tail_hours_end?;
        let after = hours + end - reading;
        (installation == row.installation && end >= reading && after >= self.hours).then_some(after)
    }

    /// Flights and reversals of this row and of the hours that have none.
    fn count(&mut self, row: &Observation, own: f64, unseen: f64) {
        self.rows = (self.rows.0 + own, self.rows.1 + 1.0);
        if self.rows.0 > 0.0 {
            self.flights += unseen * self.rows.1 / self.rows.0;
        }
        self.flights += 1.0;
        let mut unknown = unseen;
        match row.load_reversals {
            Some(made) => {
                self.reversals += made as f64;
                self.stated = (self.stated.0 + made as f64, self.stated.1 + own);
            }
            None => unknown += own,
        }
        if self.stated.1 > 0.0 {
            self.reversals += unknown * self.stated.0 / self.stated.1;
        }
    }
}
