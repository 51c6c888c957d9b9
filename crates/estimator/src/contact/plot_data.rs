//! Plot data of an estimate: δX against the force in the coupling.

use crate::contact::fit::design_matrix::{COLUMNS, DesignRow, FORCE, GAP};
use crate::contact::fit::flank_fit::FlankFit;
use crate::contact::fit::scaling::Scaling;
use crate::contact::friction::flank::Flank;

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
    /// How far the fit believed it, from 0 to 1; none where the load was too small for a straight flank.
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
    pub(crate) fn of(frame: &Scaling, contact: &FlankFit) -> Self {
        let design = &contact.line.design;
        let firm = design.firm.iter().zip(contact.line.fit.trusts(&design.firm)).map(|(r, t)| (r, Some(t)));
        let light = design.light.iter().map(|row| (row, None));
        let touches: Vec<Touch> =
            firm.chain(light).map(|(row, trust)| touch(frame, contact, row, trust)).collect();
        let flank = |flank: Flank| {
            let forces_n = touches.iter().filter(|t| t.flank == flank).map(|t| t.force_n.abs());
            let most_n = forces_n.fold(0.0, f64::max);
            let at = |force_n: f64| {
                (flank.sign() * force_n, contact.flank_m(flank.sign(), force_n / frame.load_n))
            };
            [at(0.0), at(most_n)]
        };
        let (upper, lower) = (flank(Flank::Upper), flank(Flank::Lower));
        Self { touches, upper, lower }
    }
}

fn touch(frame: &Scaling, contact: &FlankFit, row: &DesignRow<COLUMNS>, trust: Option<f64>) -> Touch {
    Touch {
        time_s: row.moment_s(frame),
        duration_s: row.blocks * contact.period_s,
        flank: if row.x[GAP] > 0.0 { Flank::Upper } else { Flank::Lower },
        force_n: row.x[FORCE] * frame.load_n,
        dx_m: row.y_m - contact.other_m(row),
        trust,
    }
}
