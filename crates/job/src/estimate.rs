//! Estimate of one actuator from its channels: the configured method gives the gap.

use std::cell::RefCell;

use estimator::contact::{
    self, ContactEstimate, ContactPlot, ContactWorkspace, GapAtPlace, PartPrior, Rejection,
};
use estimator::{Filter, GainSchedule, GapStatistic, MidRangeEstimate, Samples, gap, midrange};
use ingest::{ActuatorChannels, Geometry, Quality};
use records::{Diagnostic, GapEstimate, Status};

use crate::config::part::Part;
use crate::config::{EstimateSettings, Method};

/// Largest relative difference between the slow pole of a filter and the configured bandwidth.
const BANDWIDTH_TOLERANCE: f64 = 0.25;

/// Share of samples without a relative position above which the estimate is flagged. Clocks of several files seldom
/// begin and end together.
const MISSING_SHARE: f64 = 0.005;

/// Estimates the gap, or returns the reason why the channels do not allow an estimate.
///
/// The paper's number is kept in `gap_midrange_m` whatever the method, and also for a flight that is rejected. The results
/// of the contact regression are there under [`Method::Contact`] only: no other method runs it.
///
/// # Errors
/// A diagnostic when the settings of the part do not fit the step of the log.
pub fn estimate(
    channels: &ActuatorChannels,
    part: &Part,
    settings: &EstimateSettings,
) -> Result<GapEstimate, Diagnostic> {
    if contact::is_too_slow(channels.step_s) {
        return Ok(GapEstimate::refused("rate_too_low"));
    }
    let schedule = GainSchedule::new(&filter(channels, part)?);
    let prior = prior(channels, part);
    let failed = |e: estimator::Error| Diagnostic::new("estimate_failed", e);
    let mut estimate = if let Some(reason) = pre_check_rejection(channels) {
        GapEstimate::refused(reason)
    } else {
        let by_method = |workspaces: &mut Workspaces| {
            let published =
                match midrange::estimate_with(&samples(channels), &schedule, &mut workspaces.published) {
                    Ok(found) => Some(found),
                    Err(estimator::Error::Constant { .. } | estimator::Error::NothingMeasured) => None,
                    Err(other) => return Err(failed(other)),
                };
            let of_method = match settings.method {
                Method::Contact => {
                    let outcome = contact::estimate(&samples(channels), &prior, &mut workspaces.contact);
                    let refused = |why: Rejection| GapEstimate::refused(why.code());
                    outcome.map(|outcome| outcome.map_or_else(refused, |found| from_contact(&found)))
                }
                Method::Midrange => {
                    midrange_estimate(channels, &prior, published.as_ref(), &mut workspaces.contact)
                }
            };
            Ok(with_published(of_method.map_err(failed)?, published.as_ref()))
        };
        let is_large = channels.dx_m.len() > MAX_KEPT_SAMPLES;
        if is_large { by_method(&mut Workspaces::default()) } else { WORKSPACES.with_borrow_mut(by_method) }?
    };
    estimate.temperature_c = channels.temperature_c;
    if let Geometry::Rotary { reference_radius_m } = part.geometry {
        estimate.reference_radius_m = Some(reference_radius_m);
    }
    estimate.flags.extend(channels.flags.iter().cloned());
    if channels.missing_share > MISSING_SHARE {
        estimate.flags.push("samples_missing".into());
    }
    if bandwidth_differs(&schedule, part) {
        estimate.flags.push("bandwidth_differs".into());
    }
    Ok(estimate)
}

/// Result of the contact regression, or the code of the rejection before or by it, without the published statistic.
///
/// # Errors
/// As [`estimate`].
pub fn contact_regression(
    channels: &ActuatorChannels,
    part: &Part,
) -> Result<Result<Box<ContactEstimate>, &'static str>, Diagnostic> {
    if contact::is_too_slow(channels.step_s) {
        return Ok(Err("rate_too_low"));
    }
    filter(channels, part)?;
    if let Some(reason) = pre_check_rejection(channels) {
        return Ok(Err(reason));
    }
    let outcome =
        contact::estimate(&samples(channels), &prior(channels, part), &mut ContactWorkspace::default());
    Ok(outcome.map_err(|e| Diagnostic::new("estimate_failed", e))?.map_err(Rejection::code))
}

/// Flights of more samples get workspaces of their own, so that no thread keeps large ones.
const MAX_KEPT_SAMPLES: usize = 2 << 20;

#[derive(Debug, Default)]
struct Workspaces {
    published: Vec<f64>,
    contact: ContactWorkspace,
}

thread_local! {
    static WORKSPACES: RefCell<Workspaces> = RefCell::default();
}

/// The filter of a part at the step of a log.
///
/// # Errors
/// A diagnostic when a noise level or the step cannot be.
pub fn filter(channels: &ActuatorChannels, part: &Part) -> Result<Filter, Diagnostic> {
    if contact::is_too_slow(channels.step_s) {
        let rate_hz = channels.step_s.recip();
        return Err(Diagnostic::new("rate_too_low", format!("{rate_hz:.3} samples a second are too few"))
            .hint("record at 20 samples a second or more, 50 or more for a small gap"));
    }
    Filter::new(&part.actuator, channels.step_s, &part.noise)
        .and_then(|filter| filter.with_initial_variances(part.initial))
        .map_err(|e| Diagnostic::new("bad_parameter", e).hint("see the part's settings in the configuration"))
}

/// S(t) of a log, m, NaN outside the segments, and the published statistic of it, where it moves.
///
/// # Errors
/// As [`filter`], and when the channels are no input of it.
pub fn filter_output(
    channels: &ActuatorChannels,
    part: &Part,
) -> Result<(Vec<f64>, Option<GapStatistic>), Diagnostic> {
    let mut s_m = Vec::new();
    let schedule = GainSchedule::new(&filter(channels, part)?);
    schedule.track(&samples(channels), &mut s_m).map_err(|e| Diagnostic::new("estimate_failed", e))?;
    let midrange = gap::mid_range(&s_m).ok();
    Ok((s_m, midrange))
}

/// Plot data of the contact regression; `None` where it rejects the flight.
///
/// # Errors
/// A diagnostic when the settings of the part cannot be.
pub fn plot_data(channels: &ActuatorChannels, part: &Part) -> Result<Option<ContactPlot>, Diagnostic> {
    contact::plot_data(&samples(channels), &prior(channels, part))
        .map_err(|e| Diagnostic::new("estimate_failed", e))
}

pub(crate) fn samples(channels: &ActuatorChannels) -> Samples<'_> {
    Samples {
        step_s: channels.step_s,
        motor_m: &channels.motor_m,
        dx_m: &channels.dx_m,
        load_n: &channels.load_n,
        segments: &channels.segments,
    }
}

/// Prior knowledge of a part for the contact regression.
fn prior(channels: &ActuatorChannels, part: &Part) -> PartPrior {
    let unknown_force_n = match part.noise {
        estimator::NoiseModel::Sensors(sensors) => {
            Some(sensors.unknown_force_n).filter(|force_n| *force_n > 0.0)
        }
        _ => None,
    };
    PartPrior {
        stiffness_n_per_m: part.actuator.stiffness_n_per_m(),
        reference_load_n: part.settings.reference_load_n,
        unknown_force_n,
        period_m: match part.geometry {
            Geometry::Linear { lead_m_per_rev } => lead_m_per_rev,
            Geometry::Rotary { .. } => None,
        },
        output_locked: channels.output_locked,
    }
}

/// Rejection code of channels without information, before any statistic is computed.
fn pre_check_rejection(channels: &ActuatorChannels) -> Option<&'static str> {
    let [motor, screw, load] = &channels.quality;
    let first = channels.dx_m.iter().find(|dx| !dx.is_nan());
    if channels.segments.is_empty() {
        return Some("nothing_selected");
    }
    let rigid = channels.dx_m.iter().all(|dx| dx.is_nan() || Some(dx) == first);
    let needed =
        || [motor, screw, load].into_iter().filter(|q| !(channels.output_locked && std::ptr::eq(*q, screw)));
    let still = needed().any(Quality::is_constant) || rigid;
    let zero = needed().any(Quality::is_zero);
    if zero { Some("channel_zero") } else { still.then_some("channel_constant") }
}

/// The gap by the published statistic, for a flight whose channels show one.
///
/// The statistic rejects no flight itself. Its naive standard error covers 4–21 %: none is better.
fn midrange_estimate(
    channels: &ActuatorChannels,
    prior: &PartPrior,
    published: Option<&MidRangeEstimate>,
    workspace: &mut ContactWorkspace,
) -> Result<GapEstimate, estimator::Error> {
    let Some(published) = published else { return Ok(GapEstimate::refused("channel_constant")) };
    let why = contact::find_rejection(&samples(channels), prior, workspace)?;
    Ok(why.map_or_else(
        || GapEstimate {
            status: Status::Estimated,
            gap_m: Some(published.gap.gap_m),
            ..GapEstimate::default()
        },
        |why| GapEstimate::refused(why.code()),
    ))
}

/// An estimate with the published statistic in columns of its own.
fn with_published(mut estimate: GapEstimate, published: Option<&MidRangeEstimate>) -> GapEstimate {
    let Some(published) = published else { return estimate };
    estimate.gap_midrange_m = Some(published.gap.gap_m);
    estimate.load_reversals = published.load.reversals as i64;
    estimate.samples = published.samples as i64;
    estimate.samples_upper = published.gap.upper as i64;
    estimate.samples_lower = published.gap.lower as i64;
    estimate.load_p05_n = Some(published.load.p05_n);
    estimate.load_p95_n = Some(published.load.p95_n);
    (estimate.nis, estimate.nis_se) = (Some(published.nis.mean), published.nis.standard_error);
    if estimate.status == Status::Estimated {
        estimate.reason = estimate.flags.first().cloned();
    }
    estimate
}

fn from_contact(found: &ContactEstimate) -> GapEstimate {
    let (p05_m, p95_m) = found.gap_bounds_m;
    let largest = found.largest_gap();
    let profile = |of: fn(&GapAtPlace) -> f64| found.gap_profile.iter().map(of).collect();
    GapEstimate {
        status: Status::Estimated,
        flags: found.flags.iter().map(|flag| flag.code().to_owned()).collect(),
        gap_m: Some(found.gap_m),
        gap_se_m: Some(found.gap_se_m),
        gap_p05_m: Some(p05_m),
        gap_p95_m: Some(p95_m),
        stiffness_n_per_m: Some(found.stiffness_n_per_m),
        stiffness_se_n_per_m: Some(found.stiffness_se_n_per_m),
        skew_s: Some(found.skew_s),
        skew_se_s: Some(found.skew_se_s),
        loop_width_m: found.loop_width_m.map(|width| width.0),
        loop_width_se_m: found.loop_width_m.map(|width| width.1),
        lost_motion_m: found.lost_motion_m.map(|motion| motion.0),
        lost_motion_se_m: found.lost_motion_m.map(|motion| motion.1),
        load_zero_n: Some(found.load_zero_n),
        load_zero_se_n: Some(found.load_zero_se_n),
        load_delay_s: Some(found.load_delay_s),
        load_delay_se_s: Some(found.load_delay_se_s),
        friction_n: Some(found.friction_n()),
        friction_se_n: Some(found.friction_p95_se_n),
        friction_dry_n: Some(found.friction.dry_n),
        friction_dry_se_n: Some(found.friction_se.dry_n),
        friction_load_share: Some(found.friction.lost_share),
        friction_load_share_se: Some(found.friction_se.lost_share),
        gap_largest_m: largest.map(|place| place.gap_m),
        gap_largest_se_m: largest.map(|place| place.gap_se_m),
        gap_largest_at_m: largest.map(|place| place.at_m),
        gap_profile_at_m: profile(|place| place.at_m),
        gap_profile_m: profile(|place| place.gap_m),
        gap_profile_se_m: profile(|place| place.gap_se_m),
        preload_n: found.preload_n.map(|preload| preload.0),
        preload_se_n: found.preload_n.map(|preload| preload.1),
        gap_midrange_fitted_m: found.midrange_at_fit_m,
        ..GapEstimate::default()
    }
}

/// A lightly damped mode, or one near Nyquist, moves the pole: the estimate is kept, with a flag.
fn bandwidth_differs(schedule: &GainSchedule, part: &Part) -> bool {
    let estimator::NoiseModel::Sensors(asked) = part.noise else { return false };
    schedule.bandwidth_hz().is_ok_and(|got| (got / asked.bandwidth_hz - 1.0).abs() > BANDWIDTH_TOLERANCE)
}
