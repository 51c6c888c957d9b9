//! Records of a unit in order, with the periods in which they can be compared.

use crate::data::noise::CERTAIN;
use crate::data::outliers::noise;
use crate::data::series::{Flight, Gap, UnitData};

/// Number of last records that are read.
const MOST: usize = 400;

/// Standard errors, and share of the limit, by which no sound record is below zero.
const IMPOSSIBLE_ERRORS: f64 = 6.0;
const IMPOSSIBLE_SHARE: f64 = 0.05;

/// A rise of the level that counts as a jump, a share of the limit, and in standard errors.
pub(crate) const JUMP_SHARE: f64 = 0.15;
pub(crate) const JUMP_ERRORS: f64 = 6.0;

/// Records for which a jump is reported, however long they take.
pub(crate) const JUMP_RECORDS: usize = 12;

/// A level that was at a limit keeps its state down to this share of the limit, for at most this many records.
pub(crate) const HYSTERESIS: f64 = 0.97;
pub(crate) const RECALLED: usize = 24;

/// One measured gap.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Record {
    pub(crate) flight: usize,
    /// Departure of its flight, microseconds since 1970 UTC.
    pub departure_us: i64,
    pub(crate) hours: f64,
    /// The gap, metres.
    pub gap_m: f64,
    /// Standard error of the gap, scaled by the scatter found between records, metres.
    pub error_m: f64,
    /// Part of the stated standard error that the scatter does not show: an error that all flights may share, metres.
    pub(crate) shared_m: f64,
    /// Whether no quality flag makes the record uncertain.
    pub(crate) is_sound: bool,
    /// Number of the period: a new period begins with each installation and after each renewal.
    pub(crate) period: u32,
    /// Number of renewals before the record. A unit keeps its gap in a new installation; a renewal resets the gap.
    pub(crate) renewals: u32,
}

impl Record {
    /// Whether the gap is so far below zero that the record shows a fault of the data, not the unit's gap.
    pub fn is_impossible(&self) -> bool {
        !self.is_sound && self.gap_m < -IMPOSSIBLE_ERRORS * self.error_m
    }
}

/// The last records of a unit, and the renewing maintenance after the last of them.
pub(crate) fn records(data: UnitData<'_>, limit_m: f64) -> (Vec<Record>, Option<i64>) {
    let mut seen: Vec<(usize, &Flight, Gap)> =
        data.flights.iter().enumerate().rev().filter_map(|(i, f)| Some((i, f, f.gap?))).take(MOST).collect();
    seen.reverse();
    let gaps: Vec<Gap> = seen.iter().map(|(_, _, gap)| *gap).collect();
    let noise = noise(&gaps, limit_m);
    // Few differences are small by chance as well: a scatter below the stated errors counts as far as it is certain.
    let certain = (noise.factor * (1.0 + CERTAIN / (seen.len() as f64).sqrt())).min(1.0).max(noise.factor);
    let widened = (certain / noise.factor).sqrt();
    let shared = (noise.factor.recip() - 1.0).max(0.0).sqrt();
    let mut dates = data.maintenance.iter().filter(|entry| entry.renews).map(|entry| entry.utc_us).peekable();
    let (mut period, mut renewals, mut installation) = (0, 0, None);
    let mut records = Vec::with_capacity(seen.len());
    for ((flight, flown, gap), error_m) in seen.into_iter().zip(noise.errors) {
        let mut is_new = installation.is_some_and(|before| before != flown.installation);
        while dates.next_if(|utc_us| *utc_us <= flown.departure_us).is_some() {
            (is_new, renewals) = (true, renewals + 1);
        }
        period += u32::from(is_new);
        installation = Some(flown.installation);
        let Gap { gap_m, is_doubtful, .. } = gap;
        let (departure_us, hours) = (flown.departure_us, flown.hours);
        // No gap is below zero: such a record shows a fault, and nothing of the unit.
        let is_possible = gap_m > -(IMPOSSIBLE_ERRORS * error_m).max(IMPOSSIBLE_SHARE * limit_m);
        let is_sound = is_possible && !is_doubtful;
        let (error_m, shared_m) = (widened * error_m, shared * error_m);
        records.push(Record {
            flight,
            departure_us,
            hours,
            gap_m,
            error_m,
            shared_m,
            is_sound,
            period,
            renewals,
        });
    }
    (records, dates.next())
}
