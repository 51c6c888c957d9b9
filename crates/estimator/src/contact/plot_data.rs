//! Plot data of an estimate: δX against the force in the coupling.

use crate::contact::fit::design_matrix::{COLUMNS, DRIFT, DesignRow, FORCE, GAP, ORIGIN, SIDE_FORCE};
use crate::contact::fit::flank_fit::FlankFit;
use crate::contact::fit::scaling::Scaling;

/// One of the two sides of the gap.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Flank {
    /// Pressed by a positive force.
    Upper = 1,
    /// Pressed by a negative one.
    Lower = -1,
}

impl Flank {
    /// s, +1 for the upper and −1 for the lower.
    pub fn sign(self) -> f64 {
        f64::from(self as i8)
    }
}

/// A stretch in contact on one flank, a tenth of a second or longer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Touch {
    /// Its middle, s from the first sample of the log.
    pub time_s: f64,
    /// How long it lasted, s; parts that were missing not counted.
    pub duration_s: f64,
    /// Which flank was pressed.
    pub flank: Flank,
    /// Mean force in the coupling, N.
    pub force_n: f64,
    /// Mean δX with drift, skew, transducer error and wrong friction taken off, m.
    pub dx_m: f64,
    /// Weight of the row in the fit, from 0 to 1; `None` if its load was too small for a straight flank.
    pub trust: Option<f64>,
}

/// Stretches in contact, and the flanks fitted through them.
#[derive(Debug, Clone, PartialEq)]
pub struct ContactPlot {
    /// In order of time on each side of the share of the load below which flanks may be soft.
    pub touches: Vec<Touch>,
    /// Both ends of the upper flank as fitted, at no and at the greatest force: N, m.
    pub upper: [(f64, f64); 2],
    /// Both ends of the lower flank.
    pub lower: [(f64, f64); 2],
}

impl ContactPlot {
    pub(crate) fn of(period_s: f64, scaling: &Scaling, contact: &FlankFit) -> Self {
        let (design, fit) = (&contact.search.line.design, &contact.search.line.fit);
        let firm = design.firm.iter().zip(fit.trusts(&design.firm)).map(|(row, trust)| (row, Some(trust)));
        let light = design.light.iter().map(|row| (row, None));
        let touch = |(row, trust): (&DesignRow<COLUMNS>, Option<f64>)| Touch {
            time_s: scaling.time_s.0 + row.x[DRIFT] * scaling.time_s.1,
            duration_s: row.blocks * period_s,
            flank: if row.x[GAP] > 0.0 { Flank::Upper } else { Flank::Lower },
            force_n: row.x[FORCE] * scaling.load_n,
            dx_m: row.y_m - contact.other_m(row),
            trust,
        };
        let touches: Vec<Touch> = firm.chain(light).map(touch).collect();
        let ends = |flank: Flank| {
            let side = flank.sign();
            let forces_n = touches.iter().filter(|t| t.flank == flank).map(|t| t.force_n.abs());
            [0.0, forces_n.fold(0.0, f64::max)].map(|force_n| {
                let force = force_n / scaling.load_n;
                let from_middle_m = 0.5 * fit.beta[GAP] + force * fit.beta[FORCE];
                (side * force_n, fit.beta[ORIGIN] + side * from_middle_m + force * fit.beta[SIDE_FORCE])
            })
        };
        Self { upper: ends(Flank::Upper), lower: ends(Flank::Lower), touches }
    }
}
