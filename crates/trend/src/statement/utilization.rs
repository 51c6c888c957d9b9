//! Present usage of a unit: flight hours per day.
//!
//! It is the mean of the last 91 days of flights, with two exceptions. A pause three times as long as any other (a heavy
//! check, a part in store) counts only as long as the next longest. If each of the last one to four weeks has 1.5 times the
//! hours of every week before, only these weeks count: the unit flies on a busier aircraft now, or its records have become
//! complete.

use crate::data::series::{DAY_US, Flight};
use crate::statement::types::Utilization;

/// Number of last days that give the usage, in whole weeks.
const DAYS: i64 = 91;
const WEEK: i64 = 7;
/// Shortest pause that is shortened, days, and the least ratio of its length to that of any other pause.
const PAUSE_DAYS: f64 = 7.0;
const PAUSE_FACTOR: f64 = 3.0;
/// Most weeks that count alone, and least ratio of their hours to those of any week before.
const BUSY_WEEKS: usize = 4;
const BUSIER: f64 = 1.5;

/// Usage per day at the last flight; `None` if the flights show no hours.
pub(crate) fn utilization(flights: &[Flight]) -> Option<Utilization> {
    let last = flights.last()?;
    let since = |flight: &Flight| last.departure_us.saturating_sub(flight.departure_us);
    // The last flight at least so many days before the last of all, or the first.
    let before = |days: i64| flights.partition_point(|f| since(f) >= days * DAY_US).saturating_sub(1);
    let of_days = &flights[flights.partition_point(|f| since(f) > DAYS * DAY_US)..];
    let weeks = since(of_days.first()?) / (WEEK * DAY_US);
    let hours_at = |week: i64| flights[before(week * WEEK)].hours;
    let by_week: Vec<f64> = (0..weeks).map(|week| hours_at(week) - hours_at(week + 1)).collect();
    let is_busier = |count: &usize| {
        let (late, early) = by_week.split_at(*count);
        let busiest = early.iter().copied().fold(0.0, f64::max);
        late.iter().all(|hours| *hours > BUSIER * busiest)
    };
    let busy = (1..=BUSY_WEEKS).rev().filter(|count| *count < by_week.len()).find(is_busier);
    let counted = busy.map_or(of_days, |count| &flights[before(count as i64 * WEEK)..]);
    let first = counted.first()?;
    let days_between = |[a, b]: &[Flight; 2]| (b.departure_us - a.departure_us) as f64 / DAY_US as f64;
    let mut pauses: Vec<f64> = counted.array_windows().map(days_between).collect();
    pauses.sort_unstable_by(|a, b| b.total_cmp(a));
    let pause = match pauses[..] {
        [longest, next, ..] if longest > PAUSE_DAYS && longest > PAUSE_FACTOR * next => longest - next,
        _ => 0.0,
    };
    let (hours, days) = (last.hours - first.hours, since(first) as f64 / DAY_US as f64 - pause);
    let flights = last.flights - first.flights;
    (hours > 0.0 && days > 0.0).then(|| Utilization {
        hours_per_day: hours / days,
        hours_per_day_se: hours / days / flights.max(1.0).sqrt(),
        flights_per_day: flights / days,
        hours_per_flight: hours / flights,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The pace after days with so many flights of two hours each, from one day to the next.
    fn pace(flights_of_days: impl IntoIterator<Item = i64>) -> f64 {
        let mut flights: Vec<Flight> = Vec::new();
        for (day, count) in (0..).zip(flights_of_days) {
            for flown in 0..count {
                let departure_us = day * DAY_US + flown * DAY_US / count;
                let (number, reversals) = (flights.len() as f64 + 1.0, 0.0);
                let hours = 2.0 * number;
                flights.push(Flight {
                    departure_us,
                    installation: 0,
                    hours,
                    flights: number,
                    reversals,
                    gap: None,
                });
            }
        }
        utilization(&flights).unwrap().hours_per_day
    }

    fn days(count: usize, flights: i64) -> std::iter::RepeatN<i64> {
        std::iter::repeat_n(flights, count)
    }

    #[test]
    fn days_in_store_and_on_a_calmer_aircraft_do_not_slow_the_pace() {
        let near =
            |found: f64, wanted: f64| assert!((found / wanted - 1.0).abs() < 0.2, "{found} for {wanted}");
        near(pace(days(120, 4)), 8.0);
        // Parked for 60 or 80 days.
        near(pace(days(30, 4).chain(days(60, 0)).chain(days(15, 4))), 8.0);
        near(pace(days(30, 4).chain(days(80, 0)).chain(days(6, 4))), 8.0);
        // Twelve days ago from an aircraft of one flight in two days to one of four a day.
        near(pace((0..200).map(|day| day % 2).chain(days(12, 4))), 8.0);
        // Three days in each month, and one week that is a quarter busier: as on the average.
        near(pace((0..180).map(|day| if day % 30 < 3 { 4 } else { 0 })), 24.0 / 30.0);
        near(pace((0..98).map(|day| if day < 91 { 4 } else { 5 })), 8.2);
    }
}
