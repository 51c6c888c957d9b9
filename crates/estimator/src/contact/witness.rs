//! Lost motion measured rather than extrapolated: at zero load, and at a reference load.

use super::curve::Contact;
use super::design::{FORCE, Flank, Frame, GAP, LINEAR, Row};

/// Rows this near to the reference load count, as a share of it.
const NEAR: f64 = 0.25;
/// Rows on each flank below which a median says nothing.
const FEWEST_ROWS: usize = 5;

/// Lost motion at zero load, m, from the lightly loaded rows, which the straight fit never saw.
pub(super) fn loop_width_m(contact: &Contact) -> Option<f64> {
    let light = &contact.straight.design.light;
    let beyond_m = |flank| beyond_m(contact, light.iter(), flank);
    Some(contact.straight.fit.beta[GAP] + beyond_m(Flank::Upper)? + beyond_m(Flank::Lower)?)
}

/// Relative travel between + and − a load in the coupling, m: rows near it on either flank, drift, skew
/// and transducer error taken off, brought to the load itself along the fitted line.
pub(super) fn lost_motion_m(contact: &Contact, frame: &Frame, load_n: f64) -> Option<f64> {
    let load = load_n / frame.load_n;
    let near = |row: &&Row<LINEAR>| (row.x[FORCE].abs() - load).abs() < NEAR * load;
    let rows = &contact.straight.design;
    let beyond_m = |flank| beyond_m(contact, rows.firm.iter().chain(&rows.light).filter(near), flank);
    let beta = &contact.straight.fit.beta;
    Some(beta[GAP] + 2.0 * load * beta[FORCE] + beyond_m(Flank::Upper)? + beyond_m(Flank::Lower)?)
}

/// How far outwards of the fitted line the rows of a flank lie, m: their median.
fn beyond_m<'a>(contact: &Contact, rows: impl Iterator<Item = &'a Row<LINEAR>>, flank: Flank) -> Option<f64> {
    let mut outward_m: Vec<f64> = rows
        .filter(|row| row.x[GAP] * flank.sign() > 0.0)
        .map(|row| flank.sign() * contact.straight.fit.residual_m(row))
        .collect();
    if outward_m.len() < FEWEST_ROWS {
        return None;
    }
    let middle = outward_m.len() / 2;
    Some(*outward_m.select_nth_unstable_by(middle, f64::total_cmp).1)
}
