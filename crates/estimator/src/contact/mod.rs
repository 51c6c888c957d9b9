//! The gap we stand behind: δX against the force in the coupling, with friction that sticks and slips.
//!
//! The paper's statistic is right when stiffness, load and clock are right, and wrong by what they are
//! wrong. Here they are found in the flight itself. While the coupling presses on one flank,
//!
//! ```text
//! δX = δX₀ + s·ΔS/2 + c/K + d(t) + p(X₂) − τ·Ẋ₁        s = sgn c
//! ```
//! with c the force in the coupling (load less the screw's friction, which is set-valued at rest), d a
//! slow drift, p the transducer's error over the stroke and τ the skew between the two position
//! channels. ΔS is the coefficient of s/2, fitted robustly together with everything else; friction is
//! found by Gauss–Newton, since c answers to it by known amounts.
//!
//! Flanks that are soft at low load bend the line. Where the samples at low load say so, the gap is
//! read off a curve that passes through them, and `soft_contact` is flagged.

mod acceptance;
mod block_means;
mod coupling_path;
mod design_matrix;
mod flank_fit;
mod friction_model;
mod gauss_newton;
mod lost_motion;
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
use flank_fit::Contact;

/// Blocks that span too little time to hold a flight, s.
const SHORTEST_S: f64 = 9.0;
/// Slower logs blur the moment at which a flank is left, s.
const LONGEST_STEP_S: f64 = 0.05;
/// Each flank must be touched this long, s.
const TOUCH_S: f64 = 1.0;
/// Below this a flank was not touched at all, s.
const BRIEF_S: f64 = 0.1;
/// Standard normal 95 % quantile.
const NORMAL_95: f64 = 1.644_853_626_951_472_2;
/// A gap under this share of the wind-up at the 95 % load drowns in what the model leaves out.
const DETECTION_SHARE: f64 = 0.01;

/// What is known of the part before its flight is seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PartPrior {
    /// K of the part number, N/m; believed to 15 %.
    pub stiffness_n_per_m: f64,
    /// Load between whose positive and negative value lost motion is stated, N.
    pub reference_load_n: Option<f64>,
    /// Rms of the force the model does not know, mainly friction, N, where somebody knows that: a load that
    /// does not rise above it presses on no flank for certain.
    pub unknown_force_n: Option<f64>,
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
    /// Friction of the screw.
    pub friction: Friction,
    /// Lost motion at zero load, m: a second witness, from lightly loaded samples that a straight
    /// fit leaves out. On soft flanks it lies between the gap and the line.
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
    /// Doubts that do not forbid the number.
    pub flags: Vec<QualityFlag>,
}

/// What a flight had to say.
#[derive(Debug, Clone, PartialEq)]
pub enum ContactOutcome {
    /// Its gap.
    Estimated(Box<ContactEstimate>),
    /// Why it cannot show one.
    Refused(Rejection),
}

/// Memory of a regression, to be used again for the next flight instead of being asked for anew.
#[derive(Debug, Default)]
pub struct ContactWorkspace {
    whole: BlockMeans,
    excerpt: BlockMeans,
    course: CouplingPath,
}

/// Estimates the gap of one flight, over all its segments together, or says why it cannot be seen.
///
/// Time is linear in the samples; memory is nine numbers for each 20 ms and a row of eighteen for each
/// tenth of a second or more.
///
/// # Errors
/// [`Error::Lengths`] for channels that do not fit, [`Error::Parameter`] for a stiffness, a reference
/// load or an unknown force that is not positive.
pub fn estimate(samples: &Samples<'_>, prior: &PartPrior) -> Result<ContactOutcome, Error> {
    estimate_with(samples, prior, &mut ContactWorkspace::default())
}

/// As [`estimate`], for one flight of many, in a room that they use in turn.
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
        Ok((frame, contact)) => ContactOutcome::Estimated(Box::new(report(&frame, prior, &contact))),
        Err(refusal) => ContactOutcome::Refused(refusal),
    })
}

/// What the estimate stands on, for a person who wants to look: the stretches in contact and the flanks
/// fitted through them. None where the flight was refused.
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
    prior.unknown_force_n.map_or(Ok(()), |force_n| model::positive("unknown_force_n", force_n))
}

fn look(
    samples: &Samples<'_>,
    prior: &PartPrior,
    room: &mut ContactWorkspace,
) -> Result<(Scaling, Contact), Rejection> {
    if samples.step_s > LONGEST_STEP_S {
        return Err(Rejection::RateTooLow);
    }
    room.whole.gather(samples)?;
    let frame = Scaling::of(&room.whole, prior)?;
    sign_check::check(&room.whole, &frame)?;
    let contact = flank_fit::fit(room, &frame)?;
    Ok((frame, contact))
}

fn report(frame: &Scaling, prior: &PartPrior, contact: &Contact) -> ContactEstimate {
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
        friction: contact.state.friction,
        loop_width_m: loop_width.map(|(m, _)| m),
        loop_width_se_m: loop_width.map(|(_, se_m)| se_m),
        lost_motion_m: lost_motion.map(|(m, _)| m),
        lost_motion_se_m: lost_motion.map(|(_, se_m)| se_m),
        touched_s: contact.touched_s,
        load_p95_n: frame.load_n,
        flags: Vec::new(),
    };
    found.flags = acceptance::flags(&found, frame, contact.curve.is_some());
    found
}

impl ContactEstimate {
    /// Friction at the 95 % load, N.
    pub fn friction_n(&self) -> f64 {
        self.friction.at_n(self.load_p95_n)
    }

    /// Whether the paper's number differs by no more than the stiffness it was given can explain.
    ///
    /// A stiffness K̂ leaks about (E\[F | upper\] − E\[F | lower\])(1/K − 1/K̂) into ΔS. The means are taken as
    /// half the 95 % load each, and a quarter of what is expected, five standard errors and a fifth of
    /// the gap are allowed on top.
    pub fn explains(&self, midrange_m: f64, prior: &PartPrior) -> bool {
        let leak_m = self.load_p95_n * (self.stiffness_n_per_m.recip() - prior.stiffness_n_per_m.recip());
        let noise_m =
            5.0 * self.gap_se_m + 0.2 * self.gap_m.abs() + self.friction_n() / self.stiffness_n_per_m;
        (midrange_m - self.gap_m - leak_m).abs() <= noise_m + 0.5 * leak_m.abs()
    }
}
