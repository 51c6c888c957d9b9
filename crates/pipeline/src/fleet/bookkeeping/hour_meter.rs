//! Check of hour-meter readings against each other: one misread digit must not become usage.
//!
//! Of two readings of one aircraft the later one is not smaller, and the meter gains no more hours than passed between the
//! ends of the two flights. The longest chain of readings that agree is kept. Of these, the readings of a meter that stands
//! still while the aircraft flies are left out.

use trend::Observation;

/// Length of a flight that states none, hours; the allowance for rounded readings and times is as long.
const ALLOWANCE_HOURS: f64 = 2.0;
/// Readings that a chain may skip in a row.
const MAX_SKIPPED: usize = 200;

/// A meter that gains less than this share of the hours stated for the flights stands still.
const LEAST_GAIN: f64 = 0.5;

/// Drops the readings that contradict the others or the stated hours, installation by installation, and returns their
/// number. Where fewer than half agree, the meter does not count hours, and all its readings are dropped.
pub(crate) fn drop_contradicting(rows: &mut [Observation]) -> usize {
    let mut all: Vec<usize> = (0..rows.len()).collect();
    all.sort_by_key(|&row| (rows[row].installation, rows[row].departure_us));
    let order: Vec<usize> = all.iter().copied().filter(|&row| rows[row].tail_hours_end.is_some()).collect();
    let is_of_one = |a: &usize, b: &usize| rows[*a].installation == rows[*b].installation;
    let contradicting = |of_one: &[usize]| {
        let readings: Vec<Reading> = of_one.iter().filter_map(|&row| Reading::of(&rows[row])).collect();
        let kept = of_one.iter().zip(agreeing(&readings));
        kept.filter_map(|(row, is_kept)| (!is_kept).then_some(*row)).collect::<Vec<_>>()
    };
    let dropped: Vec<usize> = order.chunk_by(is_of_one).flat_map(contradicting).collect();
    dropped.iter().for_each(|&row| rows[row].tail_hours_end = None);
    let mut still = 0;
    // Installation, the last reading at which its meter had gained, and the flight hours stated since.
    let mut gained: Option<(u32, f64, f64)> = None;
    for row in all {
        let row = &mut rows[row];
        let before = gained.filter(|(installation, ..)| *installation == row.installation);
        let stated_h = before.map_or(0.0, |(.., stated_h)| stated_h) + row.flight_hours.unwrap_or(0.0);
        gained = before.map(|(installation, meter_h, _)| (installation, meter_h, stated_h));
        let Some(reading_h) = row.tail_hours_end else { continue };
        let lag_h = |(_, meter_h, _): (u32, f64, f64)| {
            let gain_h = reading_h - meter_h;
            (gain_h < LEAST_GAIN * stated_h).then_some(stated_h - gain_h)
        };
        match before.and_then(lag_h) {
            // The reading is left out; a lag within the allowance is rounding and is not counted.
            Some(lag_h) => {
                row.tail_hours_end = None;
                still += usize::from(lag_h > ALLOWANCE_HOURS);
            }
            None => gained = Some((row.installation, reading_h, 0.0)),
        }
    }
    dropped.len() + still
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

/// Whether each reading belongs to the longest chain in which neighbours agree.
fn agreeing(readings: &[Reading]) -> Vec<bool> {
    if readings.windows(2).all(|pair| pair[0].agrees_with_later(&pair[1])) {
        return vec![true; readings.len()];
    }
    // Length of the longest chain that ends with each reading, and the reading before it.
    let mut chains: Vec<(usize, Option<usize>)> = Vec::with_capacity(readings.len());
    for (at, reading) in readings.iter().enumerate() {
        let before = (at.saturating_sub(MAX_SKIPPED)..at).filter(|&b| readings[b].agrees_with_later(reading));
        let longest = before.max_by_key(|&b| (chains[b].0, b));
        chains.push((1 + longest.map_or(0, |b| chains[b].0), longest));
    }
    let mut kept = vec![false; readings.len()];
    let mut last = (0..chains.len()).max_by_key(|&at| (chains[at].0, at));
    if last.is_some_and(|at| 2 * chains[at].0 < readings.len()) {
        return kept;
    }
    while let Some(at) = last {
        kept[at] = true;
        last = chains[at].1;
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    /// How many of a meter's readings at twenty flights of two hours, twelve hours apart, contradict, and which are dropped.
    fn dropped(meter_h: impl Fn(i64) -> f64) -> (usize, Vec<i64>) {
        let row = |at: i64| Observation {
            departure_us: at * 12 * 3_600_000_000,
            flight_hours: Some(2.0),
            tail_hours_end: Some(meter_h(at)),
            ..Observation::default()
        };
        let mut rows: Vec<Observation> = (0..20).map(row).collect();
        let count = drop_contradicting(&mut rows);
        (count, (0..20).filter(|at| rows[*at as usize].tail_hours_end.is_none()).collect())
    }

    fn sound_h(at: i64) -> f64 {
        2_000.0 + 2.0 * at as f64
    }

    #[test]
    fn a_misread_digit_up_or_down_is_dropped_and_the_rest_stays() {
        for wrong_h in [38_095.0, 205.2, 2_900.0, 0.0] {
            for wrong in [0, 7, 19] {
                let found = dropped(|at| if at == wrong { wrong_h } else { sound_h(at) });
                assert_eq!(found, (1, vec![wrong]), "{wrong_h} at {wrong}");
            }
        }
        assert_eq!(dropped(sound_h).0, 0);
    }

    /// A meter stands still for five flights, and counts on as if it had not: the first one may be a rounded reading.
    /// One counts minutes, and one was exchanged.
    #[test]
    fn a_meter_that_stands_still_or_counts_minutes_is_dropped_and_one_that_was_exchanged_keeps_its_longer_side()
     {
        let still = dropped(|at| sound_h(if (8..13).contains(&at) { 7 } else { at }));
        assert_eq!(still, (4, (8..13).collect()));
        assert_eq!(dropped(|at| 60.0 * sound_h(at)).0, 20);
        let exchanged = dropped(|at| if at < 6 { 9_000.0 } else { 0.0 } + 2.0 * at as f64);
        assert_eq!(exchanged, (6, (0..6).collect()));
    }
}
