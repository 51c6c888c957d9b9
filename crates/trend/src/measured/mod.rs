//! Measured state: what the last records of an installation show.
//!
//! No prior, no fleet, no minimum number of records. A forecast adds a date and may raise the urgency; nothing lowers
//! what this module finds.

pub(crate) mod exceedance;
pub(crate) mod level;
pub(crate) mod record;
pub(crate) mod rise;

use crate::data::series::{DAY_US, UnitData};
use crate::measured::exceedance::{Exceedance, exceedance};
use crate::measured::level::{Level, measured_level};
use crate::measured::record::{HYSTERESIS, JUMP_ERRORS, JUMP_RECORDS, JUMP_SHARE, RECALLED, Record, records};
use crate::measured::rise::{Rise, rise};
use crate::settings::{CHANGE_WATCH_DAYS, Settings};
use crate::statement::types::ChangePoint;

/// The level rose or fell at once by more than wear and errors explain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Jump {
    pub(crate) departure_us: i64,
    pub(crate) before_m: f64,
    pub(crate) after_m: f64,
    pub(crate) error_m: f64,
    /// Records since the jump.
    pub(crate) records: usize,
}

/// What the records of an installation show.
#[derive(Debug, Clone, Default)]
pub(crate) struct Measured {
    pub(crate) level: Option<Level>,
    /// The latest record, sound or not.
    pub(crate) latest: Option<Record>,
    pub(crate) exceedance: Option<Exceedance>,
    pub(crate) jump: Option<Jump>,
    pub(crate) rise: Option<Rise>,
    /// Whether one of the last levels was at the watch limit.
    pub(crate) was_at_watch: bool,
    /// Renewing maintenance after the last record.
    pub(crate) renewed_us: Option<i64>,
    /// Records above the limit, confirmed and not.
    pub(crate) events: Vec<ChangePoint>,
    /// The sound records, oldest first.
    pub(crate) sound: Vec<Record>,
}

impl Measured {
    /// Reads the last records of a unit's present installation.
    pub(crate) fn new(data: UnitData<'_>, settings: &Settings) -> Self {
        let (all, renewed_us) = records(data, settings.limit_m);
        let Some(latest) = all.last().copied() else { return Self::default() };
        let sound: Vec<Record> = all.iter().copied().filter(|record| record.is_sound).collect();
        // Flagged records are better than none.
        let has_sound = sound.last().is_some_and(|record| record.period == latest.period);
        let sound = if has_sound { sound } else { all.clone() };
        let level = measured_level(&sound, settings.limit_m);
        let (exceedance, events) = exceedance(&all, level.filter(|_| has_sound), settings.limit_m);
        // The gap that is shown is that of the records which make the state.
        let level = match exceedance {
            Some(Exceedance::Confirmed { records }) if level.is_some_and(|l| l.gap_m < settings.limit_m) => {
                let above = &sound[sound.len().saturating_sub(records)..];
                measured_level(above, settings.limit_m).or(level)
            }
            _ => level,
        };
        Self {
            level,
            latest: Some(latest),
            exceedance: exceedance.filter(|_| renewed_us.is_none()),
            jump: jump(&sound, settings),
            rise: rise(&sound, settings).filter(|_| renewed_us.is_none()),
            was_at_watch: was_at_watch(&sound, level, settings),
            renewed_us,
            events,
            sound,
        }
    }

    /// Departure of the last sound record of the present installation.
    pub(crate) fn last_sound_us(&self) -> Option<i64> {
        let period = self.latest?.period;
        let is_last = |record: &&Record| record.is_sound && record.period == period;
        self.sound.iter().rev().find(is_last).map(|record| record.departure_us)
    }
}

/// The last jump of the level, up or down, that is still reported.
fn jump(sound: &[Record], settings: &Settings) -> Option<Jump> {
    let last = sound.last()?;
    let present = measured_level(sound, settings.limit_m)?;
    // The last record first: a line through few records may follow it.
    let mut found = jump_at(sound, sound.len() - 1, last.gap_m, last.error_m, &present, settings);
    let mut to = sound.len();
    while found.is_none() {
        let now = measured_level(&sound[..to], settings.limit_m)?;
        let from = to - now.window.min(to);
        let first = sound.get(from)?;
        let days = last.departure_us.saturating_sub(first.departure_us) as f64 / DAY_US as f64;
        if from == 0 || (sound.len() - from > JUMP_RECORDS && days > CHANGE_WATCH_DAYS) {
            return None;
        }
        found = jump_at(sound, from, now.at(first.hours), now.own_se_m, &present, settings);
        to = from;
    }
    found
}

/// The jump from the level before a record to a level, with its standard error, from that record on.
fn jump_at(
    sound: &[Record],
    from: usize,
    after_m: f64,
    after_se_m: f64,
    present: &Level,
    settings: &Settings,
) -> Option<Jump> {
    /// Share of a jump that must be left.
    const LEFT: f64 = 0.8;
    /// Records that contradict a lone first record, which may be the wild one.
    const CONTRADICTING: usize = 3;
    let before = measured_level(&sound[..from], settings.limit_m)?;
    let (first, records) = (&sound[from], sound.len() - from);
    let error_m = before.own_se_m.hypot(after_se_m.min(first.error_m)).max(first.error_m);
    let least_m = (JUMP_SHARE * settings.limit_m).max(JUMP_ERRORS * error_m);
    // Between two periods only a rise is a jump: a new installation or maintenance may lower the gap.
    let sign = if before.period == first.period { (after_m - before.gap_m).signum() } else { 1.0 };
    let is_left = sign * (present.gap_m - before.gap_m) > LEFT * least_m;
    let is_jump = |from_m: f64| sign * (after_m - from_m) > least_m;
    // A rise is reported from its first record on. A fall may end a wild record, so it needs three on each side.
    let is_certain =
        if sign > 0.0 { from > 1 || records < CONTRADICTING } else { before.records.min(records) > 2 };
    let is_found = is_certain && is_left && is_jump(before.at(first.hours)) && is_jump(before.gap_m);
    let (departure_us, before_m) = (first.departure_us, before.gap_m);
    is_found.then_some(Jump { departure_us, before_m, after_m, error_m, records })
}

/// Whether one of the last levels was at the watch limit; asked only where it makes a difference.
fn was_at_watch(sound: &[Record], level: Option<Level>, settings: &Settings) -> bool {
    let Settings { watch_m, limit_m, .. } = *settings;
    let Some(level) = level.filter(|level| level.gap_m >= HYSTERESIS * watch_m) else { return false };
    let first = sound.len().saturating_sub(RECALLED).max(1);
    let is_at_watch = |to| {
        let earlier = measured_level(&sound[..to], limit_m);
        earlier.is_some_and(|earlier| earlier.period == level.period && earlier.gap_m >= watch_m)
    };
    (first..sound.len()).any(is_at_watch)
}
