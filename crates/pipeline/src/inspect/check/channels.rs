//! Channels of one actuator: mapping, quality, and what the estimator would reject.

use ingest::channel::position_ratio::position_ratio;
use ingest::{ActuatorChannels, Quality};
use job::flight_log::{Actuator, FlightLog};
use job::part_identification::IdentifiedParams;
use job::{estimate, rejection};
use records::{Diagnostic, PartNumber};

/// Tolerance of the slope of screw on motor around 1; beyond it the mapping is suspect.
const SLOPE_TOLERANCE: f64 = 0.02;

/// Usual logging rates; a rate outside mostly means a wrong unit of time.
const USUAL_RATES_HZ: std::ops::RangeInclusive<f64> = 1.0..=20e3;

/// Note on the slope of screw on motor.
pub const RATIO: &str = "screw/motor ratio";

records::row! {
    /// One channel of one actuator of one log.
    #[derive(Debug, Clone, Default)]
    pub struct ChannelCheck {
        pub log: String,
        pub tail_number: String,
        pub flight_id: String,
        pub position: String,
        pub serial_number: Option<String>,
        pub channel: &'static str,
        pub column: String,
        pub unit: &'static str,
        pub samples: i64,
        pub missing_share: Option<f64>,
        pub min: Option<f64>,
        pub max: Option<f64>,
        pub resolution: Option<f64>,
        pub rate_hz: Option<f64>,
        pub frozen_share: Option<f64>,
        pub saturated_share: Option<f64>,
        pub spikes: Option<i64>,
        pub note: Option<String>,
        /// What to do about a rejection.
        pub remedy: Option<&'static str>,
    }
}

impl ChannelCheck {
    /// Whether the note is a warning; a ratio within tolerance is information.
    pub fn is_warning(&self) -> bool {
        self.note.as_ref().is_some_and(|note| !note.starts_with(RATIO) || note.contains("expected"))
    }

    /// The note with its remedy.
    pub fn note_and_remedy(&self) -> String {
        self.note.iter().map(String::as_str).chain(self.remedy).collect::<Vec<_>>().join(": ")
    }
}

/// Parameters that the flight of an actuator shows of its part, and why a run would refuse it, or the code of a stiffness
/// unlike the configured one.
pub(super) type Identified = (PartNumber, IdentifiedParams, Option<&'static str>);

#[derive(Default)]
pub(super) struct ActuatorCheck {
    pub(super) found: Vec<ChannelCheck>,
    pub(super) clock: Option<String>,
    pub(super) identified: Option<Identified>,
}

fn clock(a: &ActuatorChannels) -> String {
    let segments = match a.segments.len() {
        1 => "no gaps".to_owned(),
        n => format!("{n} segments"),
    };
    let r = a.repairs;
    let repaired = [
        (r.out_of_order, "out of order"),
        (r.repeated, "repeated"),
        (r.jittered, "spread evenly, since they jitter"),
        (r.unstamped, "without a timestamp"),
        (r.filled, "filled in from the rate"),
    ];
    let repaired: Vec<String> = repaired
        .iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, what)| format!("{count} {what}"))
        .collect();
    let repaired =
        if repaired.is_empty() { String::new() } else { format!("; repaired: {}", repaired.join(", ")) };
    let rate_hz = a.step_s.recip();
    let hint = if USUAL_RATES_HZ.contains(&rate_hz) { "" } else { " (unusual: check `clock.unit`)" };
    let kept = 1.0 - a.excluded as f64 / a.dx_m.len().max(1) as f64;
    let selected =
        if a.excluded > 0 { format!(", {:.1} % of the rows selected", 100.0 * kept) } else { String::new() };
    format!("{rate_hz:.3} Hz{hint}, {segments}{selected}{repaired}")
}

pub(super) fn actuator(opened: &FlightLog<'_>, of_log: &Actuator) -> Result<ActuatorCheck, Diagnostic> {
    let (id, at) = (&opened.identity, &of_log.columns);
    let (installation, part) = opened.unit(of_log)?;
    let base = |channel: &'static str, column: Option<&String>, unit: &'static str| ChannelCheck {
        log: opened.display_name.clone(),
        tail_number: id.flight.tail_number.to_string(),
        flight_id: id.flight.flight_id.to_string(),
        position: at.position.to_string(),
        serial_number: Some(installation.serial_number.to_string()),
        channel,
        column: column.cloned().unwrap_or_default(),
        unit,
        ..ChannelCheck::default()
    };
    if !at.lacking.is_empty() {
        let note = format!("would be refused, channel_unmapped: the log lacks {}", at.lacking.join(", "));
        let (all, remedy) = (base("all", at.columns[0].as_ref(), ""), rejection::remedy("channel_unmapped"));
        let found = vec![ChannelCheck { note: Some(note), remedy, ..all }];
        return Ok(ActuatorCheck { found, ..ActuatorCheck::default() });
    }
    let a = opened.channels(of_log, part)?;
    let slope = if a.output_locked {
        Some("the output is locked: minus the motor position".to_owned())
    } else {
        position_ratio(&a.motor_m, &a.dx_m, &a.load_n).map(slope_note)
    };
    // A locked output has no screw column that is read.
    let [motor, screw, load] = [0, 1, 2].map(|k| a.columns[k].as_ref().or(at.columns[k].as_ref()));
    let [motor_seen, screw_seen, load_seen] = a.quality;
    let mut found = vec![
        describe(base("motor_position", motor, "m"), motor_seen, &channel_flags(&a, "motor")),
        describe(base("screw_position", screw, "m"), screw_seen, &channel_flags(&a, "screw")),
        describe(base("screw − motor", screw, "m"), a.dx_quality(), &[]),
        describe(base("load", load, "N"), load_seen, &channel_flags(&a, "load")),
    ];
    found[2].note = found[2].note.take().or(slope);
    if a.output_locked {
        found[1].note = None;
    }
    // The estimator's own tests of sign, exchange, ratio and rate; its gap is dropped.
    let tested = estimate::contact_regression(&a, part)?;
    let rejection = tested.as_ref().err().copied();
    if let Some(code) = rejection {
        let channel = &mut found[tested_channel(code)];
        let is_slope = |note: &String| note.starts_with(RATIO) && code != "position_ratio";
        let before = channel.note.take().filter(|note| !is_slope(note));
        let before = before.map(|note| format!("{note}; ")).unwrap_or_default();
        channel.note = Some(format!("{before}would be refused, {code}"));
        channel.remedy = rejection::remedy(code);
    }
    let fitted = tested.as_deref().ok();
    let params = IdentifiedParams::of(&a, fitted);
    let configured = part.actuator.stiffness_n_per_m();
    let is_unlike =
        fitted.is_some_and(|fitted| rejection::is_stiffness_unlike(fitted.stiffness_n_per_m, configured));
    let unlike = is_unlike.then_some(rejection::STIFFNESS_UNLIKE);
    let identified = Some((installation.part_number.clone(), params, rejection.or(unlike)));
    Ok(ActuatorCheck { found, clock: Some(clock(&a)), identified })
}

/// Row of the channel that a rejection concerns: motor, screw, their difference, load.
fn tested_channel(code: &str) -> usize {
    match code {
        "positions_swapped" | "position_ratio" | "motion_unexplained" => 2,
        "load_sign_flipped" | "load_too_small" | "no_load_reversal" | "one_side_brief" => 3,
        _ => 0,
    }
}

fn channel_flags<'a>(a: &'a ActuatorChannels, channel: &str) -> Vec<&'a str> {
    a.flags.iter().map(String::as_str).filter(|flag| flag.starts_with(channel)).collect()
}

fn slope_note(slope: f64) -> String {
    if (slope - 1.0).abs() > SLOPE_TOLERANCE {
        let cause = cause_of(slope).map_or("check sign, unit, lead or gear ratio", |(_, cause)| cause);
        format!("{RATIO} {slope:.4} (expected 1): {cause}")
    } else {
        format!("{RATIO} {slope:.5}")
    }
}

/// Factors between the two positions that a usual mistake makes.
const USUAL_FACTORS: [(f64, &str); 7] = [
    (2.0, "as if `lead_m_per_rev`, or the turns of the motor, were twice or half as much"),
    (180.0 / std::f64::consts::PI, "as degrees against radians: check `unit` of the motor position"),
    (std::f64::consts::TAU, "as turns against radians: check `unit` of the motor position"),
    (360.0, "as turns against degrees: check `unit` of the motor position"),
    (25.4, "as inch against millimetre: check the lead and the units of both positions"),
    (1e3, "as m against mm, or mm against µm: check the lead and the units of both positions"),
    (1e6, "as m against µm: check the lead and the units of both positions"),
];

fn cause_of(slope: f64) -> Option<(f64, &'static str)> {
    if (slope + 1.0).abs() < SLOPE_TOLERANCE {
        return Some((-1.0, "one position has the other sign: set `sign = -1` in its channel"));
    }
    let near = |factor: f64| (slope.abs() / factor - 1.0).abs() < SLOPE_TOLERANCE;
    USUAL_FACTORS.into_iter().find(|(factor, _)| near(*factor) || near(factor.recip()))
}

fn describe(base: ChannelCheck, q: Quality, flags: &[&str]) -> ChannelCheck {
    let still = if q.samples == 0 {
        Some("no sample selected: nothing_selected".to_owned())
    } else if q.span().is_none() {
        Some("no finite value: channel_constant".to_owned())
    } else if q.is_zero() {
        Some("always zero: channel_zero".to_owned())
    } else {
        q.is_constant().then(|| "constant: channel_constant".to_owned())
    };
    ChannelCheck {
        samples: q.samples as i64,
        missing_share: Some(q.missing_share),
        min: q.span().map(|span| span.0),
        max: q.span().map(|span| span.1),
        resolution: q.resolution,
        rate_hz: Some(q.rate_hz),
        frozen_share: Some(q.frozen_share),
        saturated_share: Some(q.saturated_share),
        spikes: Some(q.spikes as i64),
        note: still.or_else(|| {
            let flagged = (!flags.is_empty()).then(|| flags.join(", "));
            let notes: Vec<String> = flagged.into_iter().chain(slower_channel(base.channel, &q)).collect();
            (!notes.is_empty()).then(|| notes.join("; "))
        }),
        ..base
    }
}

/// A position that holds a value in every second row, or fewer, is recorded more slowly than its rows.
fn slower_channel(channel: &str, q: &Quality) -> Option<String> {
    const LEAST_MISSING: f64 = 0.4;
    let is_position = channel.ends_with("_position");
    let is_slower = q.missing_share > LEAST_MISSING && q.missing_share < 1.0;
    (is_position && is_slower).then(|| {
        format!(
            "{:.0} % of its rows are empty: if it is recorded more slowly, set its `rate_hz = {:.6}`",
            100.0 * q.missing_share,
            q.rate_hz
        )
    })
}
