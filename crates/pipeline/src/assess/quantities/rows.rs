//! Rows and changes of followed quantities, with the evidence in words.

use jiff::Timestamp;
use records::{ChangeScope, Quantity, QuantityChange, QuantityRow, QuantityStep, TrendRow};
use trend::quantity::changes::{self, QuantityChanges};

use crate::assess::quantities::attribution::CommonStep;
use crate::assess::quantities::limits::Scale;
use crate::assess::quantities::subject::Subject;
use crate::findings::monitoring::median;

/// Standard errors by which a change must exceed its limit.
const BEYOND_SE: f64 = 0.5;

/// The row of a unit. It has no state where the change is its tail's.
pub(crate) fn of_unit(
    subject: &Subject<'_>,
    fit: &QuantityChanges,
    as_of: Timestamp,
    is_tails: bool,
) -> QuantityRow {
    let place = subject.last_place();
    let own = fit.steps.iter().map(|step| (*step, ChangeScope::Unit));
    let mut steps: Vec<(changes::QuantityStep, ChangeScope)> =
        own.chain(subject.common.iter().copied()).collect();
    steps.sort_by_key(|(step, _)| step.departure_us);
    let step = |(step, scope): (changes::QuantityStep, ChangeScope)| {
        Some(QuantityStep {
            departure_utc: utc(step.departure_us)?,
            flight_id: subject.flight_id(step.departure_us),
            size: step.size,
            size_se: step.size_se,
            scope: scope.as_str(),
        })
    };
    let common: f64 = subject.common.iter().map(|(step, _)| step.size).sum();
    // The channels of a position have no hours of their own.
    let rate = fit.rate_per_hour.filter(|_| !subject.treatment.is_of_channel);
    let state = state(subject, fit).filter(|_| !is_tails);
    QuantityRow {
        part_number: subject.name.0.clone(),
        serial_number: subject.name.1.clone(),
        tail_number: place.and_then(|p| p.tail_number.clone()),
        position: place.and_then(|p| p.position.clone()),
        as_of_utc: as_of,
        quantity: subject.quantity.as_str(),
        flights: fit.flights as i64,
        outliers: fit.outliers as i64,
        since_utc: subject.values.first().and_then(|v| utc(v.departure_us)),
        baseline: Some(fit.baseline),
        level: Some(fit.level + common),
        level_se: Some(fit.level_se),
        change: Some(fit.change),
        change_se: Some(fit.change_se),
        rate_per_hour: rate.map(|(rate, _)| rate),
        rate_se_per_hour: rate.map(|(_, se)| se),
        change_limit: subject.limit(),
        steps: steps.into_iter().filter_map(step).collect(),
        state,
        reason: state.map(|_| evidence(subject, fit)),
    }
}

/// The unit's own change, where its row has a state.
pub(crate) fn change_of_unit(
    subject: &Subject<'_>,
    fit: &QuantityChanges,
    row: &QuantityRow,
) -> Option<QuantityChange> {
    Some(QuantityChange {
        quantity: row.quantity,
        scope: ChangeScope::Unit.as_str(),
        kind: if fit.steps.is_empty() { "drift" } else { "step" },
        part_number: row.part_number.clone(),
        tail_number: row.tail_number.clone(),
        serial_number: Some(row.serial_number.clone()),
        positions: row.position.iter().cloned().collect(),
        units: 1,
        units_able: 1,
        since_utc: since(subject, fit)?,
        from: fit.baseline,
        to: fit.baseline + fit.change,
        change_se: fit.change_se,
        state: Some(row.state?),
        evidence: row.reason.clone()?,
    })
}

/// State of a unit's own change.
fn state(subject: &Subject<'_>, fit: &QuantityChanges) -> Option<&'static str> {
    let (rise, fall) = subject.treatment.states;
    let is_beyond = fit.change.abs() > subject.limit()? + BEYOND_SE * fit.change_se;
    if fit.change > 0.0 { rise } else { fall }.filter(|_| is_beyond)
}

/// Departure of the largest step, or of the flight at which a drift passed half of its size.
fn since(subject: &Subject<'_>, fit: &QuantityChanges) -> Option<Timestamp> {
    let largest = fit.steps.iter().max_by(|a, b| a.size.abs().total_cmp(&b.size.abs()));
    largest.and_then(|step| utc(step.departure_us)).or_else(|| middle(subject))
}

/// Departure of the middle flight.
fn middle(subject: &Subject<'_>) -> Option<Timestamp> {
    utc(subject.values.get(subject.values.len() / 2)?.departure_us)
}

fn evidence(subject: &Subject<'_>, fit: &QuantityChanges) -> String {
    let how = match (fit.steps.is_empty(), fit.is_drifting) {
        (true, _) => "drifted",
        (false, false) => "stepped",
        (false, true) => "stepped and drifted",
    };
    format!(
        "{} {how} by {} since {} ({} to {}), shared neither by the tail nor by the part: {}",
        subject.quantity.label(),
        shown_change(subject, fit.change),
        since(subject, fit).map(day).unwrap_or_default(),
        shown(subject.quantity, fit.baseline),
        shown(subject.quantity, fit.baseline + fit.change),
        cause(subject),
    )
}

/// Likely cause of the unit's own change.
fn cause(subject: &Subject<'_>) -> &'static str {
    match subject.quantity {
        // The innovations of the filter also grow with the gap.
        Quantity::Nis => "its gap, its sensor or wiring",
        _ if subject.treatment.is_of_sensor() => "its sensor or wiring",
        _ => ChangeScope::Unit.cause(),
    }
}

/// A step that a tail or a part made.
pub(crate) fn of_step(common: &CommonStep<'_>, subjects: &[Subject<'_>]) -> Option<QuantityChange> {
    let members = common.members.iter().map(|of| {
        let (subject, fit) = (&subjects[of.subject], subjects[of.subject].fit.as_ref()?);
        let before = fit.steps.iter().take_while(|step| step.departure_us < of.step.departure_us);
        let from = fit.baseline + before.map(|step| step.size).sum::<f64>();
        Some(Member { subject, from, change: of.step.size, change_se: of.step.size_se })
    });
    let members: Vec<Member<'_>> = members.collect::<Option<_>>()?;
    let departure_us = common.members.first()?.step.departure_us;
    let since_utc = utc(departure_us)?;
    let flight = members[0].subject.flight_id(departure_us);
    let flight = flight.map(|flight| format!(", flight {flight}")).unwrap_or_default();
    let (able, name, date) = (common.able, common.name, day(since_utc));
    let change = of_several(common.scope, name, &members, |label, range| {
        format!(
            "{} of {able} units of {name} stepped in {label} by {range} on {date}{flight}: {}",
            members.len(),
            common.scope.cause(),
        )
    })?;
    Some(QuantityChange { kind: "step", since_utc, units_able: able as i64, ..change })
}

/// A drift that the units of a tail share.
pub(crate) fn of_drift(tail: &str, subjects: &[&Subject<'_>]) -> Option<QuantityChange> {
    let members = subjects.iter().filter_map(|subject| {
        let fit = subject.fit.as_ref()?;
        Some(Member { subject, from: fit.baseline, change: fit.change, change_se: fit.change_se })
    });
    let members: Vec<Member<'_>> = members.collect();
    let since_utc = middle(members.first()?.subject)?;
    let change = of_several(ChangeScope::Tail, tail, &members, |label, range| {
        let (units, cause) = (members.len(), ChangeScope::Tail.cause());
        format!("{units} units of {tail} drifted in {label} by {range}: {cause}")
    })?;
    Some(QuantityChange { kind: "drift", since_utc, units_able: members.len() as i64, ..change })
}

/// One of several units that changed together.
struct Member<'a> {
    subject: &'a Subject<'a>,
    from: f64,
    change: f64,
    change_se: f64,
}

/// A change that several units of a tail or a part share. `evidence` is given the name of the quantity and the range of the
/// changes.
fn of_several(
    scope: ChangeScope,
    name: &str,
    members: &[Member<'_>],
    evidence: impl Fn(&str, String) -> String,
) -> Option<QuantityChange> {
    let first = members.first()?;
    let shares = || members.iter().map(|of| of.change / of.subject.scale);
    let (low, high) = (shares().fold(f64::INFINITY, f64::min), shares().fold(f64::NEG_INFINITY, f64::max));
    let [low, high] = [low, high].map(|share| shown_change(first.subject, share * first.subject.scale));
    let from = median(members.iter().map(|of| of.from).collect());
    let is_tail = scope == ChangeScope::Tail;
    let positions = members.iter().filter_map(|of| of.subject.last_place()?.position.clone());
    let mut positions: Vec<String> = positions.filter(|_| is_tail).collect();
    positions.sort();
    Some(QuantityChange {
        quantity: first.subject.quantity.as_str(),
        scope: scope.as_str(),
        part_number: (!is_tail).then(|| name.to_owned()),
        tail_number: is_tail.then(|| name.to_owned()),
        positions,
        units: members.len() as i64,
        from,
        to: from + median(members.iter().map(|of| of.change).collect()),
        change_se: first.change_se,
        state: scope.state(),
        evidence: evidence(first.subject.quantity.label(), format!("{low} to {high}")),
        ..QuantityChange::default()
    })
}

/// The row of the gap, which the trend itself assesses.
pub(crate) fn of_gap(row: &TrendRow) -> QuantityRow {
    let spread = row.rate_p05_m_per_hour.zip(row.rate_p95_m_per_hour).map(|(low, high)| 0.5 * (high - low));
    QuantityRow {
        part_number: row.part_number.clone(),
        serial_number: row.serial_number.clone(),
        tail_number: row.tail_number.clone(),
        position: row.position.clone(),
        as_of_utc: row.as_of_utc,
        quantity: Quantity::GapM.as_str(),
        flights: row.estimates,
        outliers: row.outliers,
        level: row.gap_m,
        level_se: row.gap_se_m,
        rate_per_hour: row.rate_m_per_hour,
        rate_se_per_hour: spread.map(|half| half / records::uncertainty::NORMAL_95),
        steps: row
            .change_points
            .iter()
            .map(|c| QuantityStep {
                departure_utc: c.departure_utc,
                flight_id: c.flight_id.clone(),
                size: c.step_m,
                size_se: c.step_se_m,
                scope: if c.tail_wide { ChangeScope::Tail } else { ChangeScope::Unit }.as_str(),
            })
            .collect(),
        ..QuantityRow::default()
    }
}

fn utc(us: i64) -> Option<Timestamp> {
    Timestamp::from_microsecond(us).ok()
}

fn day(at: Timestamp) -> String {
    at.strftime("%Y-%m-%d").to_string()
}

/// A value with its unit.
fn shown(quantity: Quantity, value: f64) -> String {
    let (unit, factor) = quantity.display_unit();
    let value = (value * factor * 1e3).round() / 1e3 + 0.0;
    format!("{} {unit}", short(value)).trim_end().to_owned()
}

/// A number with about three digits.
pub(crate) fn short(value: f64) -> String {
    let places = [100.0, 10.0].iter().filter(|least| value.abs() < **least).count();
    format!("{value:.places$}")
}

/// A change with its sign: as a share where the limit is a share of the unit's own level, else with its unit.
fn shown_change(subject: &Subject<'_>, change: f64) -> String {
    let sign = if change < 0.0 { "" } else { "+" };
    match subject.treatment.scale {
        Scale::Median => format!("{:+.1} %", 100.0 * change / subject.scale),
        Scale::UsualLoad | Scale::One => format!("{sign}{}", shown(subject.quantity, change)),
    }
}
