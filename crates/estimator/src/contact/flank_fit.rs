//! Straight flanks, or soft ones: which of the two the samples at low load speak for.

use super::ContactWorkspace;
use super::acceptance::Rejection;
use super::design_matrix::{
    self, BEND, CURVED, DesignRow, FIRM_SHARE, FORCE, GAP, LINEAR, ORIGIN, RowSource, SPEED, SPEED_M_PER_S,
    Scaling, bends,
};
use super::friction_model::FrictionState;
use super::gauss_newton::{Found, search, start};

/// Blocks looked at to see how far δX travels.
const LOOKS: usize = 4000;
/// Travel may exceed what is expected by this share. Over some 300 simulated flights that show their gap it
/// did by 3 % at most, with positions that freeze for seconds by 15 %; over the flights that were given a wrong
/// gap before by 50 % and more. Of 3,000 sound flights of the study twelve are refused for it.
const UNEXPLAINED: f64 = 0.25;
/// IterationLimits of the search over straight flanks, and over soft ones from there.
const STRAIGHT: IterationLimits = IterationLimits { excerpt: 3, whole: 2, alone: 5 };
/// See [`STRAIGHT`].
const BENT: IterationLimits = IterationLimits { excerpt: 4, whole: 2, alone: 4 };
/// The low-load samples leave the straight line by this many standard errors before a curve is tried.
const SUSPICION: f64 = 2.0;
/// Light rows further out than this share of the wind-up are in the gap, not on a soft flank; they count no more.
const CLIP: f64 = 0.05;
/// The two gaps differ by this many standard errors when flanks are soft. Over 700 simulated flights with
/// straight flanks none reached 3.7; with soft ones none stayed under 4.6.
const SOFT: f64 = 4.0;
/// Doubt left by the choice of a curve, over what it changes.
const CURVE_DOUBT: f64 = 0.13;
/// What a friction law that is not equation 1 may cost, over the wind-up under friction.
const FRICTION_DOUBT: f64 = 0.012;
/// What no flight is long enough to average out: over the wind-up, and over the gap itself. These and the
/// doubts above make nine in ten intervals hold over the study's wide scenarios.
const FLOOR: (f64, f64) = (3e-4, 2e-4);

/// IterationLimits of a search, at most: over an excerpt of a long flight, over the whole from there, and over a whole flight
/// of which no excerpt told anything.
struct IterationLimits {
    excerpt: usize,
    whole: usize,
    alone: usize,
}

/// How the flanks answer, and what was found with them.
#[derive(Debug)]
pub(super) struct Contact {
    /// ΔS and its standard error, m.
    pub(super) gap_m: (f64, f64),
    /// 1/K and its standard error, m/N.
    pub(super) compliance_m_per_n: (f64, f64),
    pub(super) skew_se_s: f64,
    pub(super) touched_s: (f64, f64),
    /// Length of a block, s.
    pub(super) period_s: f64,
    pub(super) state: FrictionState,
    /// Coefficients of soft flanks, m, where low loads asked for them.
    pub(super) curve: Option<[f64; CURVED]>,
    /// The straight fit and its rows, for the witnesses.
    pub(super) straight: Found<LINEAR>,
}

impl Contact {
    /// δX on a flank, m, under a force over the 95 % load: straight or bent. The side is +1, −1, or 0 in the gap.
    pub(super) fn flank_m(&self, side: f64, force: f64) -> f64 {
        let on = |beta: &[f64], bent_m: f64| {
            beta[ORIGIN] + side * (0.5 * beta[GAP] + force * beta[FORCE] + bent_m)
        };
        match &self.curve {
            None => on(&self.straight.fit.beta, 0.0),
            Some(curve) => on(curve, curve[BEND..].iter().zip(bends(force)).map(|(b, x)| b * x).sum()),
        }
    }

    /// What lies in δX beside gap and wind-up, m: drift, skew, transducer error and wrong friction.
    pub(super) fn beside_m(&self, row: &DesignRow<LINEAR>) -> f64 {
        (FORCE + 1..LINEAR).map(|column| self.straight.fit.beta[column] * row.x[column]).sum()
    }
}

/// Fits straight flanks, and soft ones where low loads ask for them.
///
/// # Errors
/// As [`search`], and [`Rejection::MotionUnexplained`].
pub(super) fn fit(room: &mut ContactWorkspace, frame: &Scaling) -> Result<Contact, Rejection> {
    room.excerpt.cut_from(&room.whole);
    let straight: Found<LINEAR> = coarse_to_fine(room, frame, start(frame), &STRAIGHT)?;
    let error_m = |column: usize| straight.fit.standard_error_m(column, &straight.design.firm);
    let (line_m, line_se_m) = (straight.fit.beta[GAP], error_m(GAP));
    // Under heavy friction the forces at low load are friction's to say, not the flank's.
    let heavy = straight.state.friction.is_heavy(frame.load_n);
    let bent = if !heavy && low_loads_deviate(&straight, frame) {
        let curve = coarse_to_fine(room, frame, straight.state, &BENT);
        curve.ok().and_then(|curve| soft(&curve, (line_m, line_se_m)))
    } else {
        None
    };
    let (gap_m, se_m) = bent.map_or((line_m, line_se_m), |(beta, se_m)| (beta[GAP], se_m));
    let friction_m = straight.state.friction.at_n(frame.load_n) / straight.state.stiffness_n_per_m;
    let floor_m = (FLOOR.0 * frame.windup_m()).hypot(FLOOR.1 * gap_m);
    let doubt_m = se_m.hypot(FRICTION_DOUBT * friction_m).hypot(floor_m);
    let contact = Contact {
        gap_m: (gap_m, doubt_m),
        compliance_m_per_n: (straight.fit.beta[FORCE] / frame.load_n, error_m(FORCE) / frame.load_n),
        skew_se_s: error_m(SPEED) / SPEED_M_PER_S,
        touched_s: straight.design.touched_s,
        period_s: room.whole.period_s,
        state: straight.state,
        curve: bent.map(|(beta, _)| beta),
        straight,
    };
    if is_explained(room, frame, &contact) { Ok(contact) } else { Err(Rejection::MotionUnexplained) }
}

/// IterationLimits from a state over an excerpt, where the flight is long enough for one, and from there over the whole.
fn coarse_to_fine<const N: usize>(
    room: &mut ContactWorkspace,
    frame: &Scaling,
    from: FrictionState,
    turns: &IterationLimits,
) -> Result<Found<N>, Rejection> {
    let ContactWorkspace { whole, excerpt, course } = room;
    let guess = if excerpt.is_empty() {
        None
    } else {
        let found: Result<Found<N>, _> = search((excerpt, course), frame, from, turns.excerpt);
        found.ok().map(|found| found.state)
    };
    match guess {
        Some(state) => search((whole, course), frame, state, turns.whole),
        None => search((whole, course), frame, from, turns.alone),
    }
}

/// Whether gap and wind-up travel as far as δX does. A screw that friction holds within its gap, or a load
/// that is another actuator's, leaves travel over that no flank accounts for.
fn is_explained(room: &mut ContactWorkspace, frame: &Scaling, contact: &Contact) -> bool {
    let (seen_m, expected_m, noise_m) = travels_m(room, frame, contact);
    // A bad fit leaves noise enough to explain anything: it may explain only so much.
    let blurred_m = expected_m.hypot(noise_m.min(0.5 * expected_m));
    seen_m - blurred_m <= UNEXPLAINED * expected_m
}

/// How far δX travels, m: as seen once all that is beside gap and wind-up is taken off, as gap and wind-up
/// say it should, and by noise alone; each from the 5 % to the 95 % quantile.
fn travels_m(room: &mut ContactWorkspace, frame: &Scaling, contact: &Contact) -> (f64, f64, f64) {
    let blocks = if room.excerpt.is_empty() { &mut room.whole } else { &mut room.excerpt };
    blocks.realign(contact.state.skew_s);
    let stride = blocks.len().div_ceil(LOOKS).max(1);
    let rows = design_matrix::every(RowSource { blocks, frame }, &contact.state, &mut room.course, stride);
    let flank_m = |row: &DesignRow<LINEAR>| contact.flank_m(2.0 * row.x[GAP], row.x[FORCE].abs());
    let seen_m = span_m(rows.iter().map(|row| row.y_m - contact.beside_m(row)).collect());
    let expected_m = span_m(rows.iter().map(flank_m).collect());
    let firm = &contact.straight.design.firm;
    let noise_m = span_m(firm.iter().map(|row| contact.straight.fit.residual_m(row)).collect());
    (seen_m, expected_m, noise_m)
}

fn span_m(mut values: Vec<f64>) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let mut at = |share: f64| {
        let k = ((values.len() - 1) as f64 * share) as usize;
        *values.select_nth_unstable_by(k, f64::total_cmp).1
    };
    at(0.95) - at(0.05)
}

/// Whether the rows that the straight fit never saw lie inside its line, beyond the spread of their
/// stretches; the lighter the touch the more a row counts. Friction, not softness, throws them outside.
fn low_loads_deviate(straight: &Found<LINEAR>, frame: &Scaling) -> bool {
    let most_m = CLIP * frame.windup_m();
    let (mut total, mut squares, mut sum_m, mut stretch) = (0.0, 0.0, 0.0, None);
    for row in &straight.design.light {
        if stretch != Some(row.stretch) {
            (total, squares) = (total + sum_m, squares + sum_m * sum_m);
            (stretch, sum_m) = (Some(row.stretch), 0.0);
        }
        let lightness = 1.0 - row.x[FORCE].abs() / FIRM_SHARE;
        sum_m += lightness * (straight.fit.residual_m(row) * row.x[GAP].signum()).clamp(-most_m, most_m);
    }
    (total, squares) = (total + sum_m, squares + sum_m * sum_m);
    total < -SUSPICION * squares.sqrt()
}

/// Coefficients of soft flanks and the standard error of their gap, where they differ from the straight ones for certain.
///
/// The straight fit is the sharper one when flanks are straight, the curve right either way; so their
/// difference has the variance of the curve less that of the line (Hausman 1978).
fn soft(curve: &Found<CURVED>, line_m: (f64, f64)) -> Option<([f64; CURVED], f64)> {
    let (gap_m, se_m) = (curve.fit.beta[GAP], curve.fit.standard_error_m(GAP, &curve.design.firm));
    let spread_m = (se_m.powi(2) - line_m.1.powi(2)).max(0.25 * se_m.powi(2)).sqrt();
    let change_m = line_m.0 - gap_m;
    (change_m > SOFT * spread_m).then_some((curve.fit.beta, se_m.hypot(CURVE_DOUBT * change_m)))
}
