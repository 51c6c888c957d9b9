//! The published estimate in one call: filter, statistic, and their inputs.

use crate::error::Error;
use crate::gap::load_band::{self, LoadBand};
use crate::gap::statistic::{self, GapStatistic};
use crate::kalman::batch::GainSchedule;
use crate::kalman::filter::Filter;
use crate::kalman::nis::Nis;
use crate::samples::Samples;

/// The paper's estimate (equations 29–31) with the quantities of its record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MidRangeEstimate {
    /// ΔS and its two sets.
    pub gap: GapStatistic,
    /// Load band of the samples.
    pub load: LoadBand,
    /// Mean normalised innovation squared, with its standard error.
    pub nis: Nis,
    /// Samples S was estimated at.
    pub samples: usize,
}

/// Published estimate: Kalman filter (24–28) over the samples, then the gap statistic (29–31) over all segments
/// together.
///
/// Channels are in SI at the screw axis, one value per sample; the gap is in metres.
///
/// ```
/// use estimator::{ActuatorModel, Filter, NoiseModel, Samples, SensorNoise, midrange};
///
/// // 5·10⁷ N/m, 2000 N·s/m, 8 kg; 100 Hz; a gap of 80 µm whose side follows a load of ±8 kN at 0.25 Hz.
/// let actuator = ActuatorModel::linear(5e7, 2000.0, 8.0)?;
/// let noise = NoiseModel::Sensors(SensorNoise {
///     screw_rms_m: 3e-6,
///     screw_resolution_m: 2e-6,
///     motor_rms_m: 1e-6,
///     motor_resolution_m: 3e-7,
///     unknown_force_n: 200.0,
///     bandwidth_hz: 10.0,
/// });
/// let filter = Filter::new(&actuator, 0.01, &noise)?;
/// let load_n: Vec<f64> = (0..2000).map(|k| 8e3 * (f64::from(k) / 400.0 * std::f64::consts::TAU).sin()).collect();
/// let dx_m: Vec<f64> = load_n.iter().map(|f| f / 5e7 + 40e-6 * f.signum()).collect();
/// let samples =
///     Samples { step_s: 0.01, motor_m: &dx_m, dx_m: &dx_m, load_n: &load_n, segments: &[0..2000] };
///
/// let estimate = midrange::estimate(&samples, &filter)?;
/// assert!((estimate.gap.gap_m - 80e-6).abs() < 4e-6);
/// assert_eq!(estimate.load.reversals, 9);
/// # Ok::<(), estimator::Error>(())
/// ```
///
/// # Errors
/// When the channels do not fit, nothing was measured, or S does not move.
pub fn estimate(samples: &Samples<'_>, filter: &Filter) -> Result<MidRangeEstimate, Error> {
    estimate_with(samples, &GainSchedule::new(filter), &mut Vec::new())
}

/// As [`estimate`] (24–31), with a gain schedule, and memory for S, that many series share.
///
/// # Errors
/// As [`estimate`].
pub fn estimate_with(
    samples: &Samples<'_>,
    schedule: &GainSchedule,
    s_m: &mut Vec<f64>,
) -> Result<MidRangeEstimate, Error> {
    let load = load_band::load_band(samples.load_n, samples.segments);
    let nis = schedule.track(samples, s_m)?;
    let gap = statistic::mid_range(s_m)?;
    let load = load.ok_or(Error::NothingMeasured)?;
    Ok(MidRangeEstimate { gap, load, nis, samples: gap.upper + gap.lower })
}
