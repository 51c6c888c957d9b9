//! One actuator's channels to its estimate: the paper's number, and when it must not be given.

use estimator::{Filter, MidRange, Samples, midrange};
use fleet::{Complaint, Estimate, Status};
use ingest::{Actuator, Geometry, Quality};

use crate::config::{EstimateSettings, Method};
use crate::part::Part;

/// Each side of the load must be visited, or only one flank of the gap was seen.
const FEWEST_REVERSALS: usize = 1;
/// Below so many samples the filter has hardly settled.
const FEWEST_SAMPLES: usize = 500;
/// A fitted bandwidth further off than this share is not the one that was asked for.
const BANDWIDTH_TOLERANCE: f64 = 0.25;

/// Estimates the gap, or says why these channels cannot show one.
///
/// # Errors
/// A complaint when the settings of the part do not fit the step of the log.
pub fn estimate(
    channels: &Actuator,
    part: &Part,
    settings: &EstimateSettings,
) -> Result<Estimate, Complaint> {
    let filter = filter(channels, part)?;
    let mut estimate = match blind(channels) {
        Some(reason) => Estimate::refused(reason),
        None => match midrange::estimate(&samples(channels), &filter) {
            Ok(found) => judged(&found, settings),
            Err(estimator::Error::Constant { .. } | estimator::Error::NothingMeasured) => {
                Estimate::refused("channel_constant")
            }
            Err(other) => return Err(Complaint::new("estimate_failed", other)),
        },
    };
    estimate.temperature_c = channels.temperature_c;
    if let Geometry::Rotary { reference_radius_m } = part.geometry {
        estimate.reference_radius_m = Some(reference_radius_m);
    }
    if channels.missing_share > 0.0 {
        estimate.flags.push("samples_missing".into());
    }
    flag_bandwidth(&mut estimate, &filter, part);
    Ok(estimate)
}

/// The filter of a part at the step of a log.
///
/// # Errors
/// A complaint when a noise level or the step cannot be.
pub fn filter(channels: &Actuator, part: &Part) -> Result<Filter, Complaint> {
    Filter::new(&part.actuator, channels.step_s, &part.noise)
        .map_err(|e| Complaint::new("bad_parameter", e).hint("see the part's settings in the configuration"))
}

/// The channels as the estimator takes them.
pub fn samples(channels: &Actuator) -> Samples<'_> {
    Samples {
        step_s: channels.step_s,
        motor_m: &channels.motor_m,
        dx_m: &channels.dx_m,
        load_n: &channels.load_n,
        segments: &channels.segments,
    }
}

/// Why no statistic could mean anything, seen before any is made.
fn blind(channels: &Actuator) -> Option<&'static str> {
    let usable: usize = channels.segments.iter().map(ExactSizeIterator::len).sum();
    if Quality::of(&channels.motor_m).is_constant() || Quality::of(&channels.dx_m).is_constant() {
        Some("channel_constant")
    } else if Quality::of(&channels.load_n).is_constant() {
        Some("load_constant")
    } else if usable < FEWEST_SAMPLES {
        Some("too_short")
    } else {
        None
    }
}

/// The paper's number as a record: kept, but not given as the gap where the load never changed sides.
fn judged(found: &MidRange, settings: &EstimateSettings) -> Estimate {
    let one_sided = found.load.reversals < FEWEST_REVERSALS;
    let Method::Midrange = settings.method;
    Estimate {
        status: if one_sided { Status::Refused } else { Status::Estimated },
        gap_m: (!one_sided).then_some(found.gap.gap_m),
        gap_midrange_m: Some(found.gap.gap_m),
        load_reversals: found.load.reversals as i64,
        samples: found.samples as i64,
        samples_upper: found.gap.upper as i64,
        samples_lower: found.gap.lower as i64,
        load_p05_n: Some(found.load.p05_n),
        load_p95_n: Some(found.load.p95_n),
        nis: Some(found.nis),
        reason: one_sided.then(|| "no_load_reversal".to_owned()),
        ..Estimate::refused("")
    }
}

/// A lightly damped mode, or one near Nyquist, can put the pole elsewhere: the number still stands, with a flag.
fn flag_bandwidth(estimate: &mut Estimate, filter: &Filter, part: &Part) {
    let estimator::Noise::Sensors(asked) = part.noise else { return };
    let off =
        filter.bandwidth_hz().is_ok_and(|got| (got / asked.bandwidth_hz - 1.0).abs() > BANDWIDTH_TOLERANCE);
    if off {
        estimate.flags.push("bandwidth_differs".into());
    }
}
