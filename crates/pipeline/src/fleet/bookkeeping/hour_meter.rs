//! Check of hour-meter readings against each other: one misread digit, or another meter, must not become usage.
//!
//! Of two readings of one meter the later one is not smaller, and the meter gains no more hours than passed between the
//! ends of the two flights. A reading that contradicts the last one is left out; several in a row that agree among themselves
//! are those of another meter, which counts on from the hours of the one before. The readings of a meter that stands still
//! while the aircraft flies are left out. No reading depends on a later one, so that a date in the past is judged as it was then.

use trend::Observation;

/// Length of a flight that states none, hours; the allowance for rounded readings and times is as long.
const ALLOWANCE_HOURS: f64 = 2.0;
/// Readings in a row that agree among themselves, from which they are those of another meter.
const OTHER_METER: usize = 3;

/// A meter that gains less than this share of the hours stated for the flights stands still.
const LEAST_GAIN: f64 = 0.5;

/// Drops the readings that contradict those before or the stated hours, installation by installation, brings those of an
/// exchanged meter to the count of the one before, and returns the number of dropped readings.
pub(crate) fn drop_contradicting(rows: &mut [Observation]) -> usize {
    let mut order: Vec<usize> = (0..rows.len()).collect();
    order.sort_by_key(|&row| (rows[row].installation, rows[row].departure_us));
    let mut dropped = 0;
    let mut meter: Option<Meter> = None;
    for row in order {
        let row = &mut rows[row];
        let mut known = meter.take().filter(|meter| meter.installation == row.installation);
        if let Some(known) = &mut known {
            known.stated_h += row.flight_hours.unwrap_or(0.0);
        }
        if let Some(reading) = Reading::of(row) {
            let known = known.get_or_insert_with(|| Meter::new(row.installation, reading));
            let hours = known.take(reading);
            row.tail_hours_end = hours.ok();
            dropped += usize::from(hours == Err(true));
        }
        meter = known;
    }
    dropped
}

/// The meter of an aircraft, as far as its readings agree.
struct Meter {
    installation: u32,
    /// The last reading at which it had gained.
    last: Reading,
    /// Hours of the meters before it.
    offset_h: f64,
    /// Flight hours stated since the last reading.
    stated_h: f64,
    /// The readings since the last one that agree among themselves, and not with it.
    other: Option<OtherMeter>,
}

/// Readings in a row of what may be another meter.
#[derive(Clone, Copy)]
struct OtherMeter {
    /// The first of them, and the flight hours stated until then since the last reading of the other meter.
    first: (Reading, f64),
    last: Reading,
    count: usize,
}

impl Meter {
    fn new(installation: u32, last: Reading) -> Self {
        Self { installation, last, offset_h: 0.0, stated_h: 0.0, other: None }
    }

    /// Hours of the aircraft by a reading; or, where it is left out, whether that is counted: a lag within the allowance is
    /// rounding.
    fn take(&mut self, reading: Reading) -> Result<f64, bool> {
        let gained_h = reading.meter_h - self.last.meter_h;
        if self.last.agrees_with_later(&reading) {
            self.other = None;
            let lag_h = self.stated_h - gained_h;
            if gained_h < LEAST_GAIN * self.stated_h {
                return Err(lag_h > ALLOWANCE_HOURS);
            }
        } else {
            let before = self.other.filter(|other| other.last.agrees_with_later(&reading));
            let (first, count) =
                before.map_or(((reading, self.stated_h), 1), |other| (other.first, other.count + 1));
            self.other = Some(OtherMeter { first, last: reading, count });
            if count < OTHER_METER {
                return Err(true);
            }
            self.offset_h += self.last.meter_h + first.1 - first.0.meter_h;
        }
        *self = Self { offset_h: self.offset_h, ..Self::new(self.installation, reading) };
        Ok(self.offset_h + reading.meter_h)
    }
}

/// A reading, and when its flight ended.
#[derive(Debug, Clone, Copy)]
struct Reading {
    end_h: f64,
    meter_h: f64,
}

impl Reading {
    fn of(row: &Observation) -> Option<Self> {
        const HOUR_US: f64 = 3.6e9;
        let flown_h = row.flight_hours.unwrap_or(ALLOWANCE_HOURS);
        Some(Self { end_h: row.departure_us as f64 / HOUR_US + flown_h, meter_h: row.tail_hours_end? })
    }

    fn agrees_with_later(&self, later: &Self) -> bool {
        let gained_h = later.meter_h - self.meter_h;
        gained_h >= -f64::EPSILON * later.meter_h && gained_h <= later.end_h - self.end_h + ALLOWANCE_HOURS
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Twenty flights of two hours, twelve hours apart, with the readings of a meter.
    fn rows(meter_h: impl Fn(i64) -> f64) -> Vec<Observation> {
        let row = |at: i64| Observation {
            departure_us: at * 12 * 3_600_000_000,
            flight_hours: Some(2.0),
            tail_hours_end: Some(meter_h(at)),
            ..Observation::default()
        };
        (0..20).map(row).collect()
    }

    /// How many of a meter's readings contradict, and which are dropped.
    fn dropped(meter_h: impl Fn(i64) -> f64) -> (usize, Vec<i64>) {
        let mut rows = rows(meter_h);
        let count = drop_contradicting(&mut rows);
        (count, (0..20).filter(|at| rows[*at as usize].tail_hours_end.is_none()).collect())
    }

    fn sound_h(at: i64) -> f64 {
        2_000.0 + 2.0 * at as f64
    }

    #[test]
    fn a_misread_digit_up_or_down_is_dropped_and_the_rest_stays() {
        for wrong_h in [38_095.0, 205.2, 2_900.0, 0.0] {
            // After a wrong first reading, those that agree among themselves are of the right meter.
            for (wrong, left_out) in [(0, vec![1, 2]), (7, vec![7]), (19, vec![19])] {
                let found = dropped(|at| if at == wrong { wrong_h } else { sound_h(at) });
                assert_eq!(found, (left_out.len(), left_out), "{wrong_h} at {wrong}");
            }
        }
        assert_eq!(dropped(sound_h).0, 0);
    }

    /// A meter stands still for five flights, and counts on as if it had not: the first one may be a rounded reading.
    /// One counts minutes.
    #[test]
    fn a_meter_that_stands_still_or_counts_minutes_is_dropped() {
        let still = dropped(|at| sound_h(if (8..13).contains(&at) { 7 } else { at }));
        assert_eq!(still, (4, (8..13).collect()));
        assert_eq!(dropped(|at| 60.0 * sound_h(at)).0, 19);
    }

    /// A meter that starts anew, and one that reads 9,000 h too much for eight flights: the hours go on as they were.
    #[test]
    fn the_hours_of_an_exchanged_meter_go_on() {
        let exchanged: [fn(i64) -> f64; 2] = [
            |at| sound_h(at) - if at < 6 { 0.0 } else { 2_012.0 },
            |at| sound_h(at) + if (6..14).contains(&at) { 9_000.0 } else { 0.0 },
        ];
        for meter_h in exchanged {
            let mut rows = rows(meter_h);
            drop_contradicting(&mut rows);
            let read = (0..20).filter_map(|at| Some((at, rows[at as usize].tail_hours_end?)));
            let off: Vec<_> =
                read.clone().filter(|(at, hours)| (hours - sound_h(*at)).abs() > 1e-9).collect();
            assert!(off.is_empty() && read.count() >= 16, "{off:?}");
        }
    }

    /// What later readings show changes no earlier one.
    #[test]
    fn earlier_readings_are_judged_without_later_ones() {
        let meter_h = |at: i64| [sound_h(at), 50.0 + 2.0 * at as f64][usize::from(at > 4)];
        let mut all = rows(meter_h);
        drop_contradicting(&mut all);
        for count in 0..20 {
            let mut known = rows(meter_h);
            known.truncate(count);
            drop_contradicting(&mut known);
            assert_eq!(known, all[..count]);
        }
    }
}
