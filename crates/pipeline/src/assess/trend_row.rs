//! Trend row of a unit, from its assessment and history.

use jiff::Timestamp;
use records::row_schema::NoColumn;
use records::time::days_after;
use records::{ChangePoint, Installation, TrendRow};
use trend::{Assessment, Reason, Series, State};

use crate::assess::tail_wide_steps::TailWide;
use crate::assess::trends::FleetContext;
use crate::fleet::bookkeeping::inspections::{self, InspectionRow};
use crate::fleet::flight_row::FlightRow;
use crate::fleet::histories::{History, TailPosition, UnitKey};

/// Means of neighbours, at most a hundred.
fn sketched(gaps_m: &[f64]) -> NoColumn<Vec<f64>> {
    const MOST: usize = 100;
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
    NoColumn(gaps_m.chunks(gaps_m.len().div_ceil(MOST).max(1)).map(mean).collect())
}

impl FleetContext<'_> {
    pub(super) fn row(
        &self,
        name: &UnitKey,
        trend: &Assessment,
        as_of: Timestamp,
        wide: &TailWide<'_>,
    ) -> TrendRow {
        let (history, series) = &self.units[name];
        RowSources { fleet: self, name, history, series, trend, as_of, wide }.row()
    }
}

/// What the trend row of a unit at a date is made from.
struct RowSources<'a> {
    fleet: &'a FleetContext<'a>,
    name: &'a UnitKey,
    history: &'a History,
    series: &'a Series,
    trend: &'a Assessment,
    as_of: Timestamp,
    wide: &'a TailWide<'a>,
}

impl RowSources<'_> {
    fn row(self) -> TrendRow {
        let Self { fleet, name, history, trend, as_of, .. } = self;
        let part = name.0.as_deref();
        let limit_m = fleet.limits.stated_m(part);
        // The installations table says where a unit is, or was last; of an external table, its last flight does.
        let tables = fleet.tables.installations();
        let installed = tables.and_then(|tables| tables.installed(name, as_of));
        let removal = tables.and_then(|tables| tables.removal(name, as_of));
        let place = installed.or(removal).map(TailPosition::of);
        let last = place.or_else(|| history.until(as_of).last().map(|flown| history.place(flown).clone()));
        let flights = self.series.flights_until(trend.as_of_us);
        let gaps_m: Vec<f64> = flights.iter().filter_map(|flight| Some(flight.gap?.gap_m)).collect();
        // A removed unit wears no more: it has no state, no date and no place among the expected removals.
        let is_judged = limit_m.is_some() && removal.is_none();
        let crossing = trend.crossing.filter(|_| is_judged);
        let use_now = trend.utilization;
        let flights = |hours: Option<f64>| Some(hours? / use_now?.hours_per_flight);
        // Usage goes on at the unit's own rate after its last flight; a date that has passed stays what it was.
        let day =
            |hours: Option<f64>| days_after(as_of, (hours? - trend.elapsed_hours) / use_now?.hours_per_day);
        let (state, cause) = if limit_m.is_some() || trend.flights == 0 {
            (trend.state, trend.reason)
        } else {
            (State::Unassessed, Reason::NoLimit)
        };
        let prior = fleet.prior(name, as_of).filter(|_| trend.flights > 0);
        let caveats: Vec<String> = if removal.is_none() { self.caveats(cause).collect() } else { Vec::new() };
        let row = TrendRow {
            part_number: name.0.clone(),
            serial_number: name.1.clone(),
            tail_number: last.as_ref().and_then(|place| place.tail_number.clone()),
            position: last.and_then(|place| place.position),
            as_of_utc: as_of,
            flights: trend.flights as i64,
            unit_hours: trend.unit_hours,
            gap_m: trend.level.map(|l| l.gap_m),
            gap_se_m: trend.level.map(|l| l.se_m),
            gap_records: trend.level.map(|l| l.records as i64),
            latest_utc: trend.latest.and_then(|record| Timestamp::from_microsecond(record.departure_us).ok()),
            latest_gap_m: trend.latest.map(|record| record.gap_m),
            latest_gap_se_m: trend.latest.map(|record| record.error_m),
            installation_sd_m: Some(trend.installation_sd_m),
            estimates: trend.estimates as i64,
            outliers: trend.outliers_us.len() as i64,
            noise_factor: trend.noise_factor,
            rate_m_per_hour: trend.rate.map(|r| r.m_per_hour),
            rate_p05_m_per_hour: trend.rate.map(|r| r.p05_m_per_hour),
            rate_p95_m_per_hour: trend.rate.map(|r| r.p95_m_per_hour),
            trend: trend.wear.into(),
            growth_probability: trend.growth_probability,
            wear_law: trend.law.map(|(law, _)| law.to_string()),
            wear_law_probability: trend.law.map(|(_, share)| share),
            usage_axis: trend.axis.or_else(|| Some(prior?.axis)).map(|axis| axis.to_string()),
            trend_p_value: None,
            change_points: trend.changes.iter().filter_map(|change| self.change_point(change)).collect(),
            limit_m,
            limit_applies_to: fleet.limits.applies_to(part),
            crossing_hours_p05: crossing.and_then(|c| c.p05_hours),
            crossing_hours_p50: crossing.and_then(|c| c.p50_hours),
            crossing_hours_p95: crossing.and_then(|c| c.p95_hours),
            crossing_flights_p05: flights(crossing.and_then(|c| c.p05_hours)),
            crossing_flights_p50: flights(crossing.and_then(|c| c.p50_hours)),
            crossing_flights_p95: flights(crossing.and_then(|c| c.p95_hours)),
            not_before_utc: day(crossing.and_then(|c| c.p05_hours)),
            likely_utc: day(crossing.and_then(|c| c.p50_hours)),
            not_after_utc: day(crossing.and_then(|c| c.p95_hours)),
            forecast_method: trend.method.filter(|_| is_judged).map(Into::into),
            check_probability: trend.check_probability.filter(|_| is_judged),
            over_limit_probability: trend.over_limit_probability.filter(|_| is_judged),
            hours_per_day: use_now.map(|u| u.hours_per_day),
            hours_per_day_se: use_now.map(|u| u.hours_per_day_se),
            flights_per_day: use_now.map(|u| u.flights_per_day),
            hours_per_flight: use_now.map(|u| u.hours_per_flight),
            usage_source: use_now.map(|_| self.series.source.to_string()),
            stale_days: trend.stale_days.filter(|_| removal.is_none()),
            removed_utc: removal.and_then(|installation| installation.removed_utc),
            state: removal.is_none().then(|| state.as_str()),
            reason_code: removal.is_none().then(|| cause.code()),
            reason: Some(match removal {
                Some(Installation { position, tail_number, removed_utc, .. }) => {
                    let date = removed_utc.map(|at| at.strftime("%Y-%m-%d").to_string()).unwrap_or_default();
                    format!("removed from {position} of {tail_number} on {date}")
                }
                None => {
                    caveats.iter().fold(self.reason_of_state(cause), |all, caveat| format!("{all}; {caveat}"))
                }
            }),
            conditions: fleet.conditions.get(name).cloned().unwrap_or_default(),
            action: None,
            due_utc: None,
            elapsed_hours: NoColumn(trend.elapsed_hours),
            caveats: NoColumn(caveats),
            sketch_m: sketched(&gaps_m),
        };
        let since = tables.and_then(|tables| tables.installed_since(name, as_of));
        let inspection = since.and_then(|since| self.latest_inspection(since));
        inspected(row, inspection, history.until(as_of)).with_action(fleet.limits.at_limit(part))
    }

    /// What limits the trust in a state: wrong mappings, other settings, flags, age, and rows that cannot be right.
    fn caveats(&self, cause: Reason) -> impl Iterator<Item = String> {
        const LATEST: usize = 12;
        let Self { history, trend, as_of, .. } = self;
        let fault = self.fleet.mapping_faults.iter().find(|fault| fault.units.contains(self.name));
        let mapping = fault.map(|fault| format!("{} of {}", fault.evidence(), fault.scope()));
        let settings = history.settings.others().map(|(others, last, all)| {
            format!(
                "{others} of {all} gaps, until {}, were estimated with other settings: where logs are left, `freeplay \
                 run` makes them anew",
                last.strftime("%Y-%m-%d")
            )
        });
        let (disputed, gaps) = history.disputed(*as_of, LATEST);
        let flagged = (disputed > 0).then(|| {
            format!(
                "{disputed} of the latest {gaps} gaps are flagged (estimators_disagree, or of an external table) and \
                 confirm nothing alone"
            )
        });
        let is_said = matches!(cause, Reason::Stale { .. });
        let age = trend.stale_days.filter(|_| !is_said);
        let age = age.map(|days| format!("no sound record for {days:.0} days"));
        let faults = self.series.faults;
        let latest = trend.latest.filter(trend::Record::is_impossible);
        let impossible = latest.map(|latest| {
            format!(
                "the latest gap, {:.1} µm, cannot be: check the signs of the channels",
                1e6 * latest.gap_m
            )
        });
        let counted = |count: usize, what: &str| (count > 0).then(|| format!("{what}: {count}"));
        // A report of a past date leaves later records out on purpose.
        let now = Timestamp::now().max(*as_of);
        [
            mapping,
            settings,
            flagged,
            age,
            counted(faults.contradictions, "flights with records that contradict each other"),
            counted(
                faults.overlaps,
                "flights that depart while the one before still flies (is one flight recorded twice?)",
            ),
            impossible,
            counted(faults.negative_usage, "rows with negative usage, left out"),
            counted(faults.meter_readings, "hour-meter readings that contradict the others, left out"),
            counted(history.flights().len() - history.until(now).len(), "records dated ahead, left out"),
        ]
        .into_iter()
        .flatten()
    }

    /// Why a state; a change that the tail's other units made as well is named for what it is.
    fn reason_of_state(&self, cause: Reason) -> String {
        let Self { history, trend, wide, .. } = self;
        let unexplained = trend.changes.iter().rev().find(|change| change.kind.is_unexplained());
        let tail = unexplained.and_then(|change| wide.tail(change, history));
        match (cause, tail) {
            (Reason::NoRecord { flagged: 0 }, _) if trend.flights > 0 => {
                format!("no record of a gap: all of {} flights are without one", trend.flights)
            }
            (Reason::Clear { .. } | Reason::Stale { .. } | Reason::NoLimit, _) | (_, None) => {
                cause.to_string()
            }
            (_, Some(tail)) => format!(
                "{cause}; the actuators of {tail} changed together: its sensor or recorder is the likelier cause"
            ),
        }
    }

    /// The latest inspection since an installation and after the last renewal.
    fn latest_inspection(&self, installed_utc: Timestamp) -> Option<&InspectionRow> {
        let done = self.series.maintenance_until(self.as_of.as_microsecond());
        let renewed = done.iter().rev().find(|event| event.renews);
        let renewed = renewed.and_then(|event| Timestamp::from_microsecond(event.utc_us).ok());
        inspections::latest(&self.fleet.tables.inspections, self.name, installed_utc, renewed, self.as_of)
    }

    fn change_point(&self, change: &trend::ChangePoint) -> Option<ChangePoint> {
        let departure_utc = Timestamp::from_microsecond(change.departure_us).ok()?;
        let flight = self.history.at(departure_utc);
        Some(ChangePoint {
            departure_utc,
            flight_id: flight.and_then(|f| self.history.flight_id(f)).map(str::to_owned),
            kind: change.kind.into(),
            step_m: change.step_m,
            step_se_m: change.se_m,
            certainty: change.certainty,
            tail_wide: self.wide.tail(change, self.history).is_some(),
        })
    }
}

/// The row of a unit with its latest inspection: one at or above the limit makes the state, and one that contradicts the
/// records is named.
fn inspected(row: TrendRow, inspection: Option<&InspectionRow>, records: &[FlightRow]) -> TrendRow {
    let Some(inspection) = inspection else { return row };
    let (statement, contradicts) = inspection.statement(records);
    let reason = row.reason.clone().unwrap_or_default();
    let is_above = row.limit_m.is_some_and(|limit_m| inspection.play_m >= limit_m);
    if is_above && row.state != Some(State::Act.as_str()) {
        let limit_um = row.limit_m.unwrap_or_default() * 1e6;
        let reason = format!("{statement}, at or above the limit of {limit_um:.1} µm; records: {reason}");
        let (state, reason_code) = (Some(State::Act.as_str()), Some("inspected"));
        return TrendRow { state, reason_code, reason: Some(reason), ..row };
    }
    if is_above || contradicts {
        let reason = Some(format!("{reason}; {statement}"));
        let caveats = NoColumn(row.caveats.0.iter().cloned().chain([statement]).collect());
        return TrendRow { reason, caveats, ..row };
    }
    row
}
