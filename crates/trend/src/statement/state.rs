//! Alert state of a unit, and its reason: the more urgent of the measured state and the forecast's.

use std::fmt;

use strum::{EnumString, IntoStaticStr};

use crate::data::series::DAY_US;
use crate::math::NORMAL_95;
use crate::measured::exceedance::Exceedance;
use crate::measured::record::HYSTERESIS;
use crate::measured::{Jump, Measured};
use crate::settings::{CHANGE_WATCH_DAYS, Settings};
use crate::statement::types::{ChangePoint, ChangePointKind};

/// Alert state of a unit, from least to most urgent.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, IntoStaticStr, EnumString)]
#[strum(serialize_all = "snake_case")]
pub enum State {
    /// No action.
    Normal,
    /// Inspect or monitor the unit.
    Watch,
    /// Nothing is known: no sound record of late, or no limit.
    #[default]
    Unassessed,
    /// Plan the replacement.
    Plan,
    /// Replace the unit.
    Act,
}

impl State {
    /// All states, from least to most urgent.
    pub const ALL: [Self; 5] = [Self::Normal, Self::Watch, Self::Unassessed, Self::Plan, Self::Act];

    /// Its word in columns, keys and messages.
    pub fn as_str(self) -> &'static str {
        self.into()
    }
}

/// Why a state.
#[derive(Debug, Clone, Copy, Default, PartialEq, IntoStaticStr)]
#[strum(serialize_all = "snake_case")]
#[expect(missing_docs, reason = "each field is named for what it holds, with its unit")]
pub enum Reason {
    /// No flight of this installation has a gap without a doubt.
    NoRecord { flagged: usize },
    /// No limit is configured.
    #[default]
    NoLimit,
    /// No sound record for some days; what the last one showed stays known.
    Stale { days: f64, gap_m: f64 },
    /// No record since a renewal.
    Renewed { days: f64 },
    /// Records at or above the limit.
    AboveLimit { gap_m: f64, limit_m: f64, records: usize },
    /// An exceedance that nothing has ended.
    LimitHeld { gap_m: f64, limit_m: f64, latest_m: f64 },
    /// One record above the limit, or flagged ones.
    Unconfirmed { gap_m: f64, limit_m: f64, before_m: Option<f64>, records: usize },
    /// Records above the limit come back, each followed by one below it.
    Repeated { limit_m: f64, records: usize, among: usize },
    /// The early crossing by a wear law lies within the planning horizon.
    CrossesSoon { p05_hours: f64, planning_horizon_hours: f64 },
    /// The early crossing by the line through the last records does.
    RisesToLimit { p05_hours: f64, planning_horizon_hours: f64, records: usize, m_per_hour: f64 },
    /// The gap is at its watch limit.
    AtWatch { gap_m: f64, watch_m: f64, records: usize },
    /// The error of the gap reaches its limit.
    Imprecise { gap_m: f64, upper_m: f64, limit_m: f64 },
    /// The gap rose at once.
    Jumped { before_m: f64, after_m: f64, records: usize },
    /// A recent unrecorded change.
    Changed { kind: ChangePointKind, days: f64 },
    /// Nothing calls for anything.
    Clear { records: usize },
}

impl Reason {
    /// Its code in columns.
    pub fn code(self) -> &'static str {
        match self {
            Self::Changed { kind: ChangePointKind::Onset, .. } => "onset",
            other => other.into(),
        }
    }
}

fn records(count: usize) -> String {
    format!("{count} record{}", if count == 1 { "" } else { "s" })
}

fn days_ago(days: f64) -> String {
    match days.round() as i64 {
        1 => "1 day ago".to_owned(),
        days => format!("{days} days ago"),
    }
}

fn um(m: f64) -> String {
    format!("{:.1} µm", 1e6 * m)
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let below = |limit_m: f64| um(HYSTERESIS * limit_m);
        match *self {
            Self::NoRecord { flagged: 0 } => f.write_str("no record of a gap"),
            Self::NoRecord { flagged } => {
                write!(f, "no sound record of this installation: {} with a quality flag", records(flagged))
            }
            Self::NoLimit => f.write_str("no limit is configured"),
            Self::Stale { days, gap_m } => {
                write!(f, "no sound record for {days:.0} days; the gap was {} then", um(gap_m))
            }
            Self::Renewed { days } => write!(f, "no record since the maintenance {}", days_ago(days)),
            Self::AboveLimit { gap_m, limit_m, records: count } => {
                let (gap, limit) = (um(gap_m), um(limit_m));
                write!(f, "gap {gap} is at or above the limit of {limit}, by the last {}", records(count))
            }
            Self::LimitHeld { gap_m, limit_m, latest_m } => write!(
                f,
                "was at the limit of {}; gap {}, latest record {}: `act` holds until two records are below {}",
                um(limit_m),
                um(gap_m),
                um(latest_m),
                below(limit_m)
            ),
            Self::Unconfirmed { gap_m, limit_m, before_m, records: count } => {
                match count {
                    0 | 1 => write!(f, "1 record of {} is", um(gap_m))?,
                    _ => write!(f, "{} with quality flags, up to {}, are", records(count), um(gap_m))?,
                }
                write!(f, " above the limit of {}, not confirmed yet; ", um(limit_m))?;
                match before_m {
                    Some(before_m) => write!(f, "the records before read {}", um(before_m)),
                    None => f.write_str("no record of this installation before"),
                }
            }
            Self::Repeated { limit_m, records, among } => {
                let limit = um(limit_m);
                write!(f, "{records} of the last {among} records are at or above the limit of {limit}")
            }
            Self::CrossesSoon { p05_hours: ..0.5, planning_horizon_hours: horizon } => {
                write!(f, "may already be at the limit (5 % point); planning horizon {horizon:.0} FH")
            }
            Self::CrossesSoon { p05_hours: hours, planning_horizon_hours: horizon } => write!(
                f,
                "could reach the limit within {hours:.0} FH (5 % point); planning horizon {horizon:.0} FH"
            ),
            Self::RisesToLimit { p05_hours, planning_horizon_hours: horizon, records: count, m_per_hour } => {
                write!(f, "rises {:.2} µm/FH over the last {} and ", 1e6 * m_per_hour, records(count))?;
                if p05_hours < 0.5 {
                    return f.write_str("may be at the limit with the next flight");
                }
                write!(f, "could reach the limit within {p05_hours:.0} FH; planning horizon {horizon:.0} FH")
            }
            Self::AtWatch { gap_m, watch_m, .. } if gap_m < watch_m => {
                let (gap, watch, below) = (um(gap_m), um(watch_m), below(watch_m));
                write!(
                    f,
                    "gap {gap} was above the watch limit of {watch}; `watch` holds until it is below {below}"
                )
            }
            Self::AtWatch { gap_m, watch_m, records: count } => {
                let (gap, watch) = (um(gap_m), um(watch_m));
                write!(f, "gap {gap} is above the watch limit of {watch}, by the last {}", records(count))
            }
            Self::Imprecise { gap_m, upper_m, limit_m } => write!(
                f,
                "gap {}, or up to {} by its error (95 %): it may be above the limit of {}",
                um(gap_m),
                um(upper_m),
                um(limit_m)
            ),
            Self::Jumped { before_m, after_m, records: count } => {
                let (before_um, after) = (1e6 * before_m, um(after_m));
                write!(f, "gap rose at once from {before_um:.1} to {after}, {} ago", records(count))
            }
            Self::Changed { kind: ChangePointKind::Onset, days } => {
                write!(f, "wear began or sped up {}", days_ago(days))
            }
            Self::Changed { kind, days } => write!(f, "{kind} {}, not on record", days_ago(days)),
            Self::Clear { records: count } => write!(f, "below all limits, by the last {}", records(count)),
        }
    }
}

/// Probability of growth from which a crossing to come is planned for below the watch limit.
const LIKELY_GROWTH: f64 = 0.8;

/// Earliest crossing of the limit by a forecast, flight hours from the last flight.
#[derive(Debug, Clone, Copy)]
pub(crate) struct EarliestCrossing {
    pub(crate) p05_hours: f64,
    pub(crate) growth_probability: f64,
    /// Hours that have passed since the last flight, at the unit's own rate.
    pub(crate) elapsed_hours: f64,
}

/// The most urgent state, and its reason.
pub(crate) fn alert_state(
    as_of_us: i64,
    measured: &Measured,
    earliest: Option<EarliestCrossing>,
    changes: &[ChangePoint],
    settings: &Settings,
) -> (State, Reason) {
    let days_since = |utc_us: i64| as_of_us.saturating_sub(utc_us) as f64 / DAY_US as f64;
    let Settings { limit_m, watch_m, planning_horizon_hours, .. } = *settings;
    let Some(level) = measured.level else { return (State::Unassessed, Reason::NoRecord { flagged: 0 }) };
    let gap_m = level.gap_m;
    if let Some(exceeded) = exceeded(measured, gap_m, limit_m) {
        return exceeded;
    }
    if let Some(utc_us) = measured.renewed_us {
        return (State::Unassessed, Reason::Renewed { days: days_since(utc_us) });
    }
    let is_supported = |e: &EarliestCrossing| gap_m >= watch_m || e.growth_probability > LIKELY_GROWTH;
    let soon = earliest.filter(|e| e.p05_hours - e.elapsed_hours <= planning_horizon_hours);
    // A jump is inspected now, whatever date a forecast gives.
    let jump = measured.jump.filter(|jump| jump.after_m > jump.before_m);
    let jumped =
        jump.map(|Jump { before_m, after_m, records, .. }| Reason::Jumped { before_m, after_m, records });
    if let Some(EarliestCrossing { p05_hours, elapsed_hours, .. }) = soon.filter(is_supported) {
        if let Some(jumped) = jumped {
            return (State::Plan, jumped);
        }
        let p05_hours = (p05_hours - elapsed_hours).max(0.0);
        let by_line = measured.rise.filter(|rise| rise.p05_hours - elapsed_hours <= p05_hours);
        let reason = match by_line {
            Some(rise) => Reason::RisesToLimit {
                p05_hours,
                planning_horizon_hours,
                records: rise.records,
                m_per_hour: rise.m_per_hour,
            },
            None => Reason::CrossesSoon { p05_hours, planning_horizon_hours },
        };
        return (State::Plan, reason);
    }
    let days = measured.last_sound_us().map(days_since);
    if let Some(days) = days.filter(|days| *days > settings.stale_after_days) {
        return (State::Unassessed, Reason::Stale { days, gap_m });
    }
    if measured.last_sound_us().is_none() {
        let flagged = measured.sound.iter().filter(|record| record.period == level.period).count();
        return (State::Unassessed, Reason::NoRecord { flagged });
    }
    if let Some(jumped) = jumped {
        return (State::Watch, jumped);
    }
    if gap_m >= watch_m || (measured.was_at_watch && gap_m >= HYSTERESIS * watch_m) {
        return (State::Watch, Reason::AtWatch { gap_m, watch_m, records: level.records });
    }
    let upper_m = gap_m + NORMAL_95 * level.se_m;
    if upper_m >= limit_m {
        return (State::Watch, Reason::Imprecise { gap_m, upper_m, limit_m });
    }
    // A renewal on record explains what came before it.
    let renewals = measured.sound.last().map(|record| record.renewals);
    let of_life = measured.sound.iter().rev().take_while(|record| Some(record.renewals) == renewals);
    let begun_us = of_life.last().map_or(i64::MIN, |record| record.departure_us);
    let is_open = |change: &&ChangePoint| change.kind.is_unexplained() && change.departure_us >= begun_us;
    match changes.iter().rev().find(is_open) {
        // Counted to the last record: that no flight follows clears nothing.
        Some(change) if days_since(change.departure_us) - days.unwrap_or(0.0) <= CHANGE_WATCH_DAYS => {
            (State::Watch, Reason::Changed { kind: change.kind, days: days_since(change.departure_us) })
        }
        _ => (State::Normal, Reason::Clear { records: level.records }),
    }
}

fn exceeded(measured: &Measured, gap_m: f64, limit_m: f64) -> Option<(State, Reason)> {
    Some(match measured.exceedance? {
        Exceedance::Confirmed { records } => (State::Act, Reason::AboveLimit { gap_m, limit_m, records }),
        Exceedance::Held => {
            let latest_m = measured.latest.map_or(gap_m, |record| record.gap_m);
            (State::Act, Reason::LimitHeld { gap_m, limit_m, latest_m })
        }
        Exceedance::Repeated { records, among } => {
            (State::Plan, Reason::Repeated { limit_m, records, among })
        }
        Exceedance::Unconfirmed { gap_m, before_m, records } => {
            (State::Plan, Reason::Unconfirmed { gap_m, limit_m, before_m, records })
        }
    })
}
