//! A unit's statement, as the contract names its columns.

use jiff::Timestamp;
use records::Installation;
use serde::Serialize;
use trend::{Assessment, Series, classic};

use crate::fleet_trends::tail_wide_steps::TailWide;
use crate::history::histories::{History, UnitKey};

/// A change point, as the contract names its fields.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChangePoint {
    /// The first flight after it.
    pub departure_utc: Timestamp,
    /// That flight.
    pub flight_id: Option<String>,
    /// `step`, `reset`, `onset` or `recorded`.
    pub kind: &'static str,
    /// Its size, m.
    pub step_m: f64,
    /// Standard error of its size, m.
    pub step_se_m: f64,
    /// Probability that it is one; 1 for a recorded event.
    pub certainty: f64,
    /// Whether the tail's other actuators changed with it, or what is fitted of all of them did: a matter of a
    /// sensor or a recorder, not of wear.
    pub tail_wide: bool,
}

/// One unit's statement, as the contract names its columns.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[expect(missing_docs, reason = "each field is named for the contract's column, with its unit")]
pub struct TrendRow {
    pub part_number: Option<String>,
    pub serial_number: String,
    pub tail_number: Option<String>,
    pub position: Option<String>,
    pub as_of_utc: Timestamp,
    pub flights: i64,
    pub unit_hours: Option<f64>,
    pub gap_m: Option<f64>,
    pub gap_se_m: Option<f64>,
    pub estimates: i64,
    pub outliers: i64,
    pub noise_factor: f64,
    pub rate_m_per_hour: Option<f64>,
    pub rate_p05_m_per_hour: Option<f64>,
    pub rate_p95_m_per_hour: Option<f64>,
    pub trend: &'static str,
    pub growth_probability: Option<f64>,
    pub wear_law: Option<String>,
    pub wear_law_probability: Option<f64>,
    pub usage_axis: Option<String>,
    pub trend_p_value: Option<f64>,
    pub sen_rate_m_per_hour: Option<f64>,
    pub sen_low_m_per_hour: Option<f64>,
    pub sen_high_m_per_hour: Option<f64>,
    pub hamed_rao_p_value: Option<f64>,
    pub change_points: Vec<ChangePoint>,
    pub limit_m: Option<f64>,
    pub crossing_hours_p05: Option<f64>,
    pub crossing_hours_p50: Option<f64>,
    pub crossing_hours_p95: Option<f64>,
    pub crossing_flights_p05: Option<f64>,
    pub crossing_flights_p50: Option<f64>,
    pub crossing_flights_p95: Option<f64>,
    pub not_before_utc: Option<Timestamp>,
    pub likely_utc: Option<Timestamp>,
    pub not_after_utc: Option<Timestamp>,
    pub check_probability: Option<f64>,
    /// Utilisation by which hours become flights and dates.
    pub hours_per_day: Option<f64>,
    pub hours_per_day_se: Option<f64>,
    pub flights_per_day: Option<f64>,
    pub hours_per_flight: Option<f64>,
    /// Where the hours are known from: `flights_table`, `tail_hours` or `logged_flights`.
    pub usage_source: Option<String>,
    /// Days since the last estimate, where they are too many; the state is then that of the last estimate.
    pub stale_days: Option<f64>,
    /// When the unit was removed, where the installations table has no installation on the date.
    pub removed_utc: Option<Timestamp>,
    pub state: Option<&'static str>,
    pub reason: Option<String>,
    /// The estimated gaps in order of flights, at most a hundred means of neighbours, m: a sketch for people.
    #[serde(skip)]
    pub sketch_m: Vec<f64>,
}

impl TrendRow {
    pub(crate) fn name(&self) -> UnitKey {
        (self.part_number.clone(), self.serial_number.clone())
    }
}

/// Means of neighbours, at most so many.
fn sketched(gaps_m: &[f64]) -> Vec<f64> {
    const MOST: usize = 100;
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
    gaps_m.chunks(gaps_m.len().div_ceil(MOST).max(1)).map(mean).collect()
}

/// The trend row of a unit at a date.
#[allow(clippy::too_many_arguments, reason = "each is one source of the row, and all are used once")]
pub(crate) fn row(
    name: &UnitKey,
    history: &History,
    series: Option<&Series>,
    limit_m: Option<f64>,
    trend: &Assessment,
    as_of: Timestamp,
    wide: &TailWide,
    removal: Option<&Installation>,
) -> TrendRow {
    let last = history.until(as_of).last().map(|flown| history.place(flown));
    let gaps_m = series.map(|series| series.gaps_until(trend.as_of_us)).unwrap_or_default();
    // A removed unit wears no more: it has no state, no date and no place among the expected removals.
    let is_judged = limit_m.is_some() && removal.is_none();
    let crossing = trend.crossing.filter(|_| is_judged);
    let use_now = trend.utilization;
    let flights = |hours: Option<f64>| Some(hours? / use_now?.hours_per_flight);
    let day = |hours: Option<f64>| after(as_of, hours? / use_now?.hours_per_day);
    TrendRow {
        part_number: name.0.clone(),
        serial_number: name.1.clone(),
        tail_number: last.and_then(|place| place.tail_number.clone()),
        position: last.and_then(|place| place.position.clone()),
        as_of_utc: as_of,
        flights: trend.flights as i64,
        unit_hours: trend.unit_hours,
        gap_m: trend.level.map(|l| l.gap_m),
        gap_se_m: trend.level.map(|l| l.se_m),
        estimates: trend.estimates as i64,
        outliers: trend.outliers_us.len() as i64,
        noise_factor: trend.noise_factor,
        rate_m_per_hour: trend.rate.map(|r| r.m_per_hour),
        rate_p05_m_per_hour: trend.rate.map(|r| r.p05_m_per_hour),
        rate_p95_m_per_hour: trend.rate.map(|r| r.p95_m_per_hour),
        trend: wear(trend.wear),
        growth_probability: trend.growth_probability,
        wear_law: trend.law.map(|(law, _)| law.to_string()),
        wear_law_probability: trend.law.map(|(_, share)| share),
        usage_axis: None,
        trend_p_value: classic::mann_kendall(&gaps_m).ok().map(|test| test.p_value),
        sen_rate_m_per_hour: None,
        sen_low_m_per_hour: None,
        sen_high_m_per_hour: None,
        hamed_rao_p_value: None,
        change_points: trend.changes.iter().filter_map(|c| change_point(c, history, wide)).collect(),
        limit_m,
        crossing_hours_p05: crossing.and_then(|c| c.p05_hours),
        crossing_hours_p50: crossing.and_then(|c| c.p50_hours),
        crossing_hours_p95: crossing.and_then(|c| c.p95_hours),
        crossing_flights_p05: flights(crossing.and_then(|c| c.p05_hours)),
        crossing_flights_p50: flights(crossing.and_then(|c| c.p50_hours)),
        crossing_flights_p95: flights(crossing.and_then(|c| c.p95_hours)),
        not_before_utc: day(crossing.and_then(|c| c.p05_hours)),
        likely_utc: day(crossing.and_then(|c| c.p50_hours)),
        not_after_utc: day(crossing.and_then(|c| c.p95_hours)),
        check_probability: trend.check_probability.filter(|_| is_judged),
        hours_per_day: use_now.map(|u| u.hours_per_day),
        hours_per_day_se: use_now.map(|u| u.hours_per_day_se),
        flights_per_day: use_now.map(|u| u.flights_per_day),
        hours_per_flight: use_now.map(|u| u.hours_per_flight),
        usage_source: use_now.and(series).map(|series| series.usage_source().to_string()),
        stale_days: trend.stale_days.filter(|_| removal.is_none()),
        removed_utc: removal.and_then(|installation| installation.removed_utc),
        state: trend.state.filter(|_| is_judged).map(state_word),
        reason: Some(match (removal, limit_m) {
            (Some(installation), _) => removed(installation),
            (None, Some(_)) => reason(trend, history, wide, as_of),
            (None, None) => "no limit is configured".into(),
        }),
        sketch_m: sketched(&gaps_m),
    }
}

/// A day so many days later; nothing beyond the calendar.
fn after(from: Timestamp, days: f64) -> Option<Timestamp> {
    const DAY_S: f64 = 86_400.0;
    from.checked_add(jiff::SignedDuration::try_from_secs_f64((days * DAY_S).round()).ok()?).ok()
}

/// Why a removed unit has no state.
fn removed(last: &Installation) -> String {
    let date = last.removed_utc.map(|at| at.strftime("%Y-%m-%d").to_string()).unwrap_or_default();
    format!("removed from {} of {} on {date}", last.position, last.tail_number)
}

/// Why a state, and how old it is where no estimate has followed.
fn reason(trend: &Assessment, history: &History, wide: &TailWide, as_of: Timestamp) -> String {
    const LATEST: usize = 12;
    let mut reason = reason_of_state(trend, history, wide);
    if let (disputed @ 1.., gaps) = history.disputed(as_of, LATEST) {
        reason = format!(
            "{reason}; {disputed} of the latest {gaps} gaps have little weight (estimators_disagree)"
        );
    }
    match trend.stale_days {
        Some(days) => format!("{reason}; no estimate for {days:.0} days"),
        None => reason,
    }
}

/// Why a state; a change that the tail's other units made as well is named for what it is.
fn reason_of_state(trend: &Assessment, history: &History, wide: &TailWide) -> String {
    let unknown = trend.changes.iter().rev().find(|c| c.kind != trend::ChangePointKind::Recorded);
    match (trend.reason, unknown.and_then(|change| wide.tail(change, history))) {
        (trend::Reason::Changed { kind, days }, Some(tail)) => format!(
            "{kind} {days:.0} days ago with all actuators of {tail} at once: a sensor or recorder, not wear"
        ),
        (trend::Reason::NoEstimate, _) if trend.flights > 0 => {
            format!("no estimate: all of {} flights are without a gap", trend.flights)
        }
        (other, _) => other.to_string(),
    }
}

fn change_point(change: &trend::ChangePoint, history: &History, wide: &TailWide) -> Option<ChangePoint> {
    let departure_utc = Timestamp::from_microsecond(change.departure_us).ok()?;
    let flight = history.at(departure_utc);
    Some(ChangePoint {
        departure_utc,
        flight_id: flight.and_then(|f| history.flight_id(f)).map(str::to_owned),
        kind: match change.kind {
            trend::ChangePointKind::Step => "step",
            trend::ChangePointKind::Reset => "reset",
            trend::ChangePointKind::Onset => "onset",
            trend::ChangePointKind::Recorded => "recorded",
        },
        step_m: change.step_m,
        step_se_m: change.se_m,
        certainty: change.certainty,
        tail_wide: wide.tail(change, history).is_some(),
    })
}

fn wear(wear: trend::WearStatus) -> &'static str {
    match wear {
        trend::WearStatus::Wearing => "wearing",
        trend::WearStatus::Steady => "steady",
        trend::WearStatus::Unknown => "unknown",
    }
}

fn state_word(state: trend::State) -> &'static str {
    match state {
        trend::State::Normal => "normal",
        trend::State::Watch => "watch",
        trend::State::Plan => "plan",
        trend::State::Act => "act",
    }
}
