//! Contact regression: the gap as the distance of two fitted flanks, with a friction model for the coupling force.
//!
//! The published statistic is right when stiffness, load and clocks are right, and wrong by as much as they are wrong.
//! Here they are estimated from the flight itself. While the coupling presses on one flank,
//!
//! ```text
//! δX = δX₀ + s·ΔS/2 + c/K + d(t) + p(X₂) − τ·Ẋ₁        s = sgn c
//! ```
//! with c the force in the coupling (load less the zero of its cell and the screw's friction, see `friction_model`), d a
//! slow drift, p the transducer's error over the stroke and τ the skew between the two position channels. ΔS is the
//! coefficient of s/2 in a robust regression over blocks of about 4 ms, so that a vibrating load does not mix both
//! flanks in one mean.
//!
//! 1. `block_means` averages whole samples, without missing ones and spikes; `sign_check` rejects wrong mappings.
//! 2. `parameter_search` finds, in an excerpt of a long flight, what derivatives do not show: the zero of the load cell
//!    (in contact it merges with δX₀; it shows where the flank is left), pre-sliding of the friction, and whether a late
//!    load channel is delayed or filtered. Each candidate is refined by `gauss_newton`.
//! 3. `flank_fit` extrapolates the stiff part of both flanks to zero load and states the error.
//!
//! A toe below the loads that occur is, to the data, extra gap: `gap_m` is the distance of the stiff flanks extrapolated
//! to zero load, and `lost_motion_m` at a reference load is the number that does not depend on the extrapolation.

mod acceptance;
mod block_means;
mod coupling_path;
mod design_matrix;
mod flank_fit;
mod friction_model;
mod gauss_newton;
mod lost_motion;
mod parameter_search;
mod plot_data;
mod robust_regression;
mod sign_check;
mod spikes;

pub use acceptance::{QualityFlag, Rejection};
pub use friction_model::Friction;
pub use plot_data::{ContactPlot, Flank, Touch};

use crate::error::Error;
use crate::{Samples, model};
use block_means::BlockMeans;
use coupling_path::CouplingPath;
use design_matrix::Scaling;
use flank_fit::FlankFit;

/// Blocks that span too little time to hold a flight, s.
const SHORTEST_S: f64 = 9.0;
/// Slower logs blur the moment at which a flank is left, s.
const LONGEST_STEP_S: f64 = 0.05;
/// Each flank must be touched this long, s.
const REQUIRED_CONTACT_S: f64 = 1.0;
/// Below this a flank was not touched at all, s.
const MIN_CONTACT_S: f64 = 0.1;
/// Standard normal 95 % quantile.
const NORMAL_95: f64 = 1.644_853_626_951_472_2;
/// The published statistic may differ by this share of the larger of the two gaps.
const MIDRANGE_SHARE: f64 = 0.35;
/// A gap under this share of the wind-up at the 95 % load drowns in what the model leaves out.
const DETECTION_SHARE: f64 = 0.01;

/// What is known of the part before its flight is seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PartPrior {
    /// K of the part number, N/m; believed to 15 %.
    pub stiffness_n_per_m: f64,
    /// Load between whose positive and negative value lost motion is stated, N.
    pub reference_load_n: Option<f64>,
    /// Rms of the force the model does not know, mainly friction, N, where it is known: a load that does not rise
    /// above it presses on no flank for certain.
    pub unknown_force_n: Option<f64>,
    /// Travel of the screw in one turn of the motor, m, where errors of the positions may repeat with it.
    pub period_m: Option<f64>,
    /// Whether the output is locked, so that the screw's position is a constant and the load is the motor's.
    pub output_locked: bool,
}

impl PartPrior {
    /// A part of which only the stiffness is known, N/m.
    pub fn of_stiffness(stiffness_n_per_m: f64) -> Self {
        Self {
            stiffness_n_per_m,
            reference_load_n: None,
            unknown_force_n: None,
            period_m: None,
            output_locked: false,
        }
    }
}

/// The gap by contact regression, and what was found on the way.
#[derive(Debug, Clone, PartialEq)]
pub struct ContactEstimate {
    /// ΔS, m; not clipped at zero.
    pub gap_m: f64,
    /// Its standard error, m.
    pub gap_se_m: f64,
    /// 5 % and 95 % bounds, m.
    pub gap_bounds_m: (f64, f64),
    /// K fitted in this flight, N/m: the secant over the loads of the flight.
    pub stiffness_n_per_m: f64,
    /// Its standard error, N/m.
    pub stiffness_se_n_per_m: f64,
    /// τ in `screw_logged(t) = X_screw(t − τ)`, s. Viscous friction F_v of the screw adds F_v/K.
    pub skew_s: f64,
    /// Its standard error, s.
    pub skew_se_s: f64,
    /// F₀: what the load cell reads under no load, N. Without a gap, or without lightly loaded samples, its error is
    /// large.
    pub load_zero_n: f64,
    /// Its standard error, N.
    pub load_zero_se_n: f64,
    /// τ in `load_logged(t) = F(t − τ)`, s: delay and time constant of a first-order lag together.
    pub load_delay_s: f64,
    /// Its standard error, s.
    pub load_delay_se_s: f64,
    /// Friction of the screw in motion.
    pub friction: Friction,
    /// Lost motion at zero load, m, from lightly loaded samples that the fit leaves out. On soft flanks it is narrower
    /// than the gap.
    pub loop_width_m: Option<f64>,
    /// Its standard error, m.
    pub loop_width_se_m: Option<f64>,
    /// Relative travel between + and − the reference load, m, from samples near it.
    pub lost_motion_m: Option<f64>,
    /// Its standard error, m.
    pub lost_motion_se_m: Option<f64>,
    /// Time in contact on the upper and on the lower flank that the number stands on, s.
    pub touched_s: (f64, f64),
    /// Load magnitude that one sample in twenty exceeds, N.
    pub load_p95_n: f64,
    /// The published mid-range statistic of the same flight with stiffness, load zero, delays, drift and transducer
    /// error as found here, m: a check by another method.
    pub midrange_at_fit_m: Option<f64>,
    /// Doubts that do not forbid the number.
    pub flags: Vec<QualityFlag>,
}

/// The result of a flight.
#[derive(Debug, Clone, PartialEq)]
pub enum ContactOutcome {
    /// Its gap, and what was estimated with it.
    Estimated(Box<ContactEstimate>),
    /// Why the flight does not allow an estimate.
    Refused(Rejection),
}

/// Scratch memory of a regression, reused from flight to flight.
#[derive(Debug, Default)]
pub struct ContactWorkspace {
    whole: BlockMeans,
    excerpt: BlockMeans,
    path: CouplingPath,
}

/// Estimates the gap of one flight, over all its segments together, or says why it cannot be seen.
///
/// Time is linear in the samples; memory is some twenty numbers for each block of about 4 ms and a row of nineteen for
/// each tenth of a second or more.
///
/// # Errors
/// [`Error::Lengths`] for channels that do not fit, [`Error::Parameter`] for a stiffness, a reference
/// load or an unknown force that is not positive.
pub fn estimate(samples: &Samples<'_>, prior: &PartPrior) -> Result<ContactOutcome, Error> {
    estimate_with(samples, prior, &mut ContactWorkspace::default())
}

/// As [`estimate`], for one flight of many that share scratch memory.
///
/// # Errors
/// As [`estimate`].
pub fn estimate_with(
    samples: &Samples<'_>,
    prior: &PartPrior,
    room: &mut ContactWorkspace,
) -> Result<ContactOutcome, Error> {
    check(samples, prior)?;
    Ok(match look(samples, prior, room) {
        Ok((frame, contact)) => {
            let midrange_m = flank_fit::midrange_at_fit_m(room, &frame, &contact, prior.unknown_force_n);
            ContactOutcome::Estimated(Box::new(report(&frame, prior, &contact, midrange_m)))
        }
        Err(refusal) => ContactOutcome::Refused(refusal),
    })
}

/// Plot data of an estimate: the intervals in contact and the flanks fitted through them. None where the flight was
/// rejected.
///
/// # Errors
/// As [`estimate`].
pub fn plot_data(samples: &Samples<'_>, prior: &PartPrior) -> Result<Option<ContactPlot>, Error> {
    check(samples, prior)?;
    Ok(look(samples, prior, &mut ContactWorkspace::default())
        .ok()
        .map(|(frame, contact)| ContactPlot::of(&frame, &contact)))
}

fn check(samples: &Samples<'_>, prior: &PartPrior) -> Result<(), Error> {
    samples.check()?;
    model::positive("stiffness_n_per_m", prior.stiffness_n_per_m)?;
    prior.reference_load_n.map_or(Ok(()), |load_n| model::positive("reference_load_n", load_n))?;
    prior.unknown_force_n.map_or(Ok(()), |force_n| model::positive("unknown_force_n", force_n))?;
    prior.period_m.map_or(Ok(()), |period_m| model::positive("period_m", period_m))
}

fn look(
    samples: &Samples<'_>,
    prior: &PartPrior,
    room: &mut ContactWorkspace,
) -> Result<(Scaling, FlankFit), Rejection> {
    if samples.step_s > LONGEST_STEP_S {
        return Err(Rejection::RateTooLow);
    }
    room.whole.gather(samples, prior)?;
    let frame = Scaling::of(&room.whole, prior)?;
    if !prior.output_locked {
        sign_check::check(&room.whole, &frame)?;
    }
    let contact = flank_fit::fit(room, &frame)?;
    Ok((frame, contact))
}

fn report(
    frame: &Scaling,
    prior: &PartPrior,
    contact: &FlankFit,
    midrange_at_fit_m: Option<f64>,
) -> ContactEstimate {
    let (gap_m, gap_se_m) = contact.gap_m;
    let (compliance, compliance_se) = contact.compliance_m_per_n;
    let loop_width = lost_motion::loop_width_m(contact);
    let lost_motion =
        prior.reference_load_n.and_then(|load_n| lost_motion::lost_motion_m(contact, frame, load_n));
    let mut found = ContactEstimate {
        gap_m,
        gap_se_m,
        gap_bounds_m: (gap_m - NORMAL_95 * gap_se_m, gap_m + NORMAL_95 * gap_se_m),
        stiffness_n_per_m: compliance.recip(),
        stiffness_se_n_per_m: compliance_se / (compliance * compliance),
        skew_s: contact.state.skew_s,
        skew_se_s: contact.skew_se_s,
        load_zero_n: contact.state.load_zero_n,
        load_zero_se_n: contact.load_zero_se_n,
        load_delay_s: contact.state.load_delay_s + contact.state.load_lag_s,
        load_delay_se_s: contact.load_delay_se_s,
        friction: contact.state.friction,
        loop_width_m: loop_width.map(|(m, _)| m),
        loop_width_se_m: loop_width.map(|(_, se_m)| se_m),
        lost_motion_m: lost_motion.map(|(m, _)| m),
        lost_motion_se_m: lost_motion.map(|(_, se_m)| se_m),
        touched_s: contact.touched_s,
        load_p95_n: frame.load_n,
        midrange_at_fit_m,
        flags: Vec::new(),
    };
    let agrees = found.agrees_with_midrange(flank_fit::unknown_force_n(prior.unknown_force_n, frame));
    found.flags = acceptance::flags(&found, frame, contact.is_soft, agrees);
    found
}

impl ContactEstimate {
    /// Friction at the 95 % load, N.
    pub fn friction_n(&self) -> f64 {
        self.friction.at_n(self.load_p95_n)
    }

    /// Whether the published statistic at the fitted parameters agrees with the gap as far as its own errors go.
    ///
    /// That statistic reads friction as backlash, about twice F_f/K, a gap of zero as the unknown force over K, and under
    /// vibration of the load up to a third too little.
    fn agrees_with_midrange(&self, unknown_force_n: f64) -> bool {
        let Some(midrange_m) = self.midrange_at_fit_m else { return true };
        let larger_m = midrange_m.abs().max(self.gap_m.abs());
        let force_n = self.friction_n() + 2.0 * unknown_force_n;
        let allowed_m =
            MIDRANGE_SHARE * larger_m + 2.0 * force_n / self.stiffness_n_per_m + 3.0 * self.gap_se_m;
        (midrange_m - self.gap_m).abs() <= allowed_m
    }
}
