//! Scales that bring every column of the regression to about one.

use std::f64::consts::TAU;

use crate::contact::block_means::BlockMeans;
use crate::contact::codes::Rejection;
use crate::contact::stats::middle_and_half;
use crate::contact::types::PartPrior;
use crate::gap::load_band::quantiles;

/// Speed that scales the skew's column, m/s.
pub(crate) const SPEED_M_PER_S: f64 = 0.02;
/// Time that scales the load rate's column, s.
pub(crate) const LATE_S: f64 = 0.01;
/// Wind-ups below which a gap is too small to show the zero of the load cell.
pub(crate) const UNSEEN_GAP: f64 = 0.1;
/// Longest row, s: that of the search, which needs no fine rows.
pub(crate) const SEARCH_ROW_S: f64 = 0.4;

/// Wind-ups that the motor must travel: at rest, friction and a gap are not distinguishable.
const LEAST_TRAVEL: f64 = 3.0;
/// Periods that the travel must show for their errors to be distinguishable from a drift.
const PERIODS: f64 = 3.0;

/// Scales that bring every column to about one.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scaling {
    /// 95 % quantile of the load's magnitude, N.
    pub(crate) load_n: f64,
    /// Rms of the force that the model does not know, N: the part's, or 2 % of the 95 % load.
    pub(crate) unknown_force_n: f64,
    /// Stiffness that scales the compliance, N/m: the part's, or that of the data where they differ widely.
    pub(crate) stiffness_n_per_m: f64,
    /// Middle and half length of the flight, s.
    pub(crate) time_s: (f64, f64),
    /// Middle and half length of the stroke seen, m.
    pub(crate) place_m: (f64, f64),
    /// Share of the place's variance that load, speed and time explain: near one in calm air, where the load follows the place.
    pub(crate) tied_share: f64,
    /// One over the load, over half of the stroke and over half of the time: a product takes a quarter of a division's time.
    pub(crate) per_load: f64,
    pub(crate) per_place: f64,
    pub(crate) per_time: f64,
    /// What brings the load's rate to its column, s/N.
    pub(crate) per_load_rate: f64,
    /// Length of a row, s.
    pub(crate) row_s: f64,
    /// Sense in which the motor drives the friction model: −1 where the load is the motor's own.
    pub(crate) motor_sense: f64,
    /// 2π over the travel of a period, 1/m; zero where nothing repeats, or too little of it is seen.
    pub(crate) per_period: f64,
}

impl Scaling {
    /// # Errors
    /// [`Rejection::TooShort`], [`Rejection::LoadTooSmall`], [`Rejection::TravelTooSmall`].
    pub(crate) fn of(blocks: &BlockMeans, prior: &PartPrior) -> Result<Self, Rejection> {
        let sizes_n: Vec<f64> = blocks.load_n.iter().map(|f| f.abs()).collect();
        let whole = 0..sizes_n.len();
        let [load_n] =
            quantiles(&sizes_n, std::slice::from_ref(&whole), [0.95]).ok_or(Rejection::TooShort)?;
        // Under a smaller load friction alone may hold the screw within the gap for the whole flight.
        if load_n <= prior.unknown_force_n.map_or(0.0, |force_n| 1.5 * force_n) {
            return Err(Rejection::LoadTooSmall);
        }
        let place_m = middle_and_half(&blocks.motor_m);
        if !prior.output_locked && 2.0 * place_m.1 < LEAST_TRAVEL * load_n / prior.stiffness_n_per_m {
            return Err(Rejection::TravelTooSmall);
        }
        let time_s = middle_and_half(&blocks.time_s);
        Ok(Self {
            load_n,
            unknown_force_n: prior.unknown_force_n.unwrap_or(0.02 * load_n),
            stiffness_n_per_m: prior.stiffness_n_per_m,
            time_s,
            place_m,
            tied_share: 0.0,
            per_load: load_n.recip(),
            // A locked screw shows nothing of its transducer.
            per_place: if prior.output_locked { 0.0 } else { place_m.1.recip() },
            per_time: time_s.1.recip(),
            per_load_rate: LATE_S / load_n,
            // A flight without a break has 10,000 rows at most.
            row_s: (2.0 * time_s.1 / 10_000.0).clamp(0.1, SEARCH_ROW_S),
            motor_sense: if prior.output_locked { -1.0 } else { 1.0 },
            per_period: prior.period_m.filter(|m| 2.0 * place_m.1 > PERIODS * m).map_or(0.0, |m| TAU / m),
        })
    }

    /// Whether the output is locked, as on a bench.
    pub(crate) fn is_locked(&self) -> bool {
        self.motor_sense < 0.0
    }

    /// The wind-up of the part at the 95 % load, m.
    pub(crate) fn windup_m(&self) -> f64 {
        self.load_n / self.stiffness_n_per_m
    }

    /// A time from −1 at the start of the flight to 1 at its end.
    pub(crate) fn time_share(&self, time_s: f64) -> f64 {
        (time_s - self.time_s.0) * self.per_time
    }

    /// A place from −1 at one end of the stroke seen to 1 at the other.
    pub(crate) fn place_share(&self, screw_m: f64) -> f64 {
        (screw_m - self.place_m.0) * self.per_place
    }
}
