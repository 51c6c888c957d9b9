//! Fleet prior: distribution of the parameters of a new unit of one part number (empirical Bayes).

use std::f64::consts::TAU;

use crate::data::series::{DAY_US, Flight};
use crate::data::steps::WEAR_NOISE;
use crate::math::{NORMAL_95, ln_peak_density};
use crate::wear::bank::{FAMILIES, WearLaw, default_shares};
use crate::wear::{AgeAssumption, Component};

/// The gap of a new unit as a share of the limit, while nothing is known.
const NEW_SHARE: f64 = 0.2;

/// Assumptions while nothing is known, shares of the limit: the spread of a new gap, variance of the level per hour (of
/// the limit's square), and the spread of what an installation adds. Every length of this crate is a share of the limit,
/// so that results do not depend on its unit.
const NEW_SPREAD: f64 = 0.05;
const DRIFT_PER_HOUR: f64 = 1e-8;
const BIAS_SPREAD: f64 = 0.015;

/// A life shorter than this has laws of its own, hours.
const FAST_LIFE_HOURS: f64 = 600.0;

/// Quantiles of the exponential wait for an onset, one for each tenth.
pub(crate) const WAIT_QUANTILES: usize = 10;

/// Widths of intervals: with a prior learned from a fleet, with one of no fleet, and of wear at a rate that the last
/// records show.
pub(crate) const FLEET_WIDTH: f64 = 1.4;
const SINGLE_WIDTH: f64 = 1.25;
const FAST_WIDTH: f64 = 0.7;

/// Spread of the first gap of a unit without support from its fleet, a share of the limit.
const FIRST_SPREAD: f64 = 0.1;

/// Share of the fleet below which a family of laws is not tried: a unit that needs it is assessed without the
/// fleet.
const RULED_OUT: f64 = 0.003;

/// A tropical year, microseconds.
pub(crate) const YEAR_US: f64 = 365.242_2 * DAY_US as f64;

/// Spread of the amplitude from unit to unit while no fleet is known, a share of the limit.
pub(crate) const PSEUDO_SD: f64 = 0.003;

/// What wear of a part number follows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, strum::Display)]
#[strum(serialize_all = "snake_case")]
pub enum UsageAxis {
    /// Hours flown.
    #[strum(serialize = "flight_hours")]
    Hours,
    /// Flights.
    Flights,
    /// Load reversals.
    #[strum(serialize = "load_reversals")]
    Reversals,
}

impl UsageAxis {
    pub(crate) const ALL: [Self; 3] = [Self::Hours, Self::Flights, Self::Reversals];

    /// The usage of a unit up to a flight, in the axis' own unit.
    pub(crate) fn of(self, flight: &Flight) -> f64 {
        match self {
            Self::Hours => flight.hours,
            Self::Flights => flight.flights,
            Self::Reversals => flight.reversals,
        }
    }
}

/// How units of one part number wear.
#[derive(Debug, Clone, PartialEq)]
pub struct FleetPrior {
    /// Usage axis that wear follows.
    pub axis: UsageAxis,
    /// Mean flight hours of the fleet per unit of the axis.
    pub(crate) hours_per_unit: f64,
    /// Growth of the gap over a life: from new to the act limit, metres.
    pub(crate) span_m: f64,
    /// Mean gap of a new unit, metres.
    pub new_m: f64,
    /// Standard deviation of the gap of new units, metres.
    pub new_sd_m: f64,
    /// ln of the life in hours, mean and spread.
    pub(crate) ln_life: f64,
    pub(crate) ln_life_sd: f64,
    pub(crate) shares: [f64; FAMILIES],
    pub(crate) season: SeasonParams,
    /// Share of units first seen in service that were new then.
    pub(crate) fresh_share: f64,
    /// Rate of onsets among units with a pending onset, per hour.
    pub(crate) onsets_per_hour: f64,
    /// Variance of the wear per metre of wear, metres.
    pub(crate) wear_noise_m: f64,
    /// Variance of the level per hour that no law explains, m²/h.
    pub(crate) drift_m2_per_hour: f64,
    /// Standard deviation of the bias that an installation adds to all its gaps, metres.
    pub(crate) bias_sd_m: f64,
    /// Factor by which the distance of a 90 % bound from the median is larger than the mixture's own.
    ///
    /// The true law is seldom in the bank, so the evidence for one candidate against its neighbours is worth less than
    /// the likelihood has it. Tempered weights (a power below one) would cover as well, but they move the median away
    /// from the truth.
    pub(crate) interval_width: f64,
}

impl FleetPrior {
    /// Prior of a part number without data: a new gap of a fifth of the limit, lives around
    /// 4,000 h within a factor of ten, any law.
    pub(crate) fn uninformative(limit_m: f64) -> Self {
        Self {
            axis: UsageAxis::Hours,
            hours_per_unit: 1.0,
            span_m: (1.0 - NEW_SHARE) * limit_m,
            new_m: NEW_SHARE * limit_m,
            new_sd_m: NEW_SPREAD * limit_m,
            ln_life: 4000.0_f64.ln(),
            ln_life_sd: 0.8,
            shares: default_shares(),
            season: SeasonParams::unknown(limit_m),
            fresh_share: 0.3,
            onsets_per_hour: 1.0 / 2000.0,
            wear_noise_m: WEAR_NOISE * limit_m,
            drift_m2_per_hour: DRIFT_PER_HOUR * limit_m * limit_m,
            bias_sd_m: BIAS_SPREAD * limit_m,
            interval_width: SINGLE_WIDTH,
        }
    }

    /// Prior of a unit without support from its fleet: the fleet's axis, and else the wide distributions
    /// of a part number without data.
    pub(crate) fn single_unit(&self) -> Self {
        let Self { axis, hours_per_unit, .. } = *self;
        Self { axis, hours_per_unit, ..Self::uninformative(self.limit_m()) }
    }

    /// Prior of a unit that wears at this rate, m per flight hour, from a first gap: lives around the one by the rate, any
    /// law. Usage is scaled to a usual life, since the bank's grids are made for usual lives.
    pub(crate) fn of_fast_wear(&self, m_per_hour: f64, first_m: f64) -> Self {
        let prior = Self::uninformative(self.limit_m());
        let life_hours = prior.span_m / m_per_hour;
        Self {
            hours_per_unit: prior.ln_life.exp() / life_hours,
            new_m: first_m,
            new_sd_m: FIRST_SPREAD * prior.limit_m(),
            interval_width: FAST_WIDTH,
            ..prior
        }
    }

    /// Whether wear of this rate, m per flight hour, ends before the lives that the bank's grids are made for.
    pub(crate) fn is_fast(&self, m_per_hour: f64) -> bool {
        self.span_m / m_per_hour < FAST_LIFE_HOURS
    }

    /// The act limit that the prior was made for, metres.
    pub(crate) fn limit_m(&self) -> f64 {
        self.span_m / (1.0 - NEW_SHARE)
    }

    /// Median life from new to the act limit, flight hours at the fleet's mean usage: the median of the log-normal prior
    /// of lives.
    pub fn median_life_hours(&self) -> f64 {
        self.ln_life.exp()
    }

    /// 5 % and 95 % quantiles of the log-normal prior of lives, flight hours at the fleet's mean usage.
    pub fn life_range_hours(&self) -> (f64, f64) {
        let reach = NORMAL_95 * self.ln_life_sd;
        ((self.ln_life - reach).exp(), (self.ln_life + reach).exp())
    }

    /// The usage of a unit up to a flight, hours' worth.
    pub(crate) fn usage(&self, flight: &Flight) -> f64 {
        self.axis.of(flight) * self.hours_per_unit
    }

    /// Flight hours per hour's worth of usage where the unit flies now: over its present installation, or over its last
    /// flights while that is young.
    pub(crate) fn hours_per_usage(&self, flights: &[Flight]) -> f64 {
        /// Flights of the present installation below which it is young, and the last ones that show the use.
        const YOUNG: usize = 20;
        const LAST: usize = 300;
        let Some(last) = flights.last() else { return 1.0 };
        let here = flights.iter().rev().take_while(|f| f.installation == last.installation).count();
        let back = if here < YOUNG { LAST } else { here.min(LAST) };
        let first = &flights[flights.len().saturating_sub(back)];
        let ratio = (last.hours - first.hours) / (self.usage(last) - self.usage(first));
        if ratio.is_finite() && ratio > 0.0 { ratio } else { 1.0 }
    }

    /// Mid-quantiles of the exponential waiting time until an onset, hours' worth of usage.
    pub(crate) fn onset_wait_quantiles(&self) -> [f64; WAIT_QUANTILES] {
        std::array::from_fn(|i| -(1.0 - (i as f64 + 0.5) / WAIT_QUANTILES as f64).ln() / self.onsets_per_hour)
    }

    /// The prior's logarithms, taken once for many curves.
    pub(crate) fn logs(&self) -> LogPrior<'_> {
        LogPrior {
            prior: self,
            shares: self.shares.map(f64::ln),
            life: ln_peak_density(self.ln_life_sd),
            fresh: self.fresh_share.ln(),
            worn: (1.0 - self.fresh_share).ln(),
            onset: self.onsets_per_hour.ln(),
        }
    }

    /// Whether a law is to be tried on a unit of the fleet. None and an onset always are: they are what is
    /// found, or not found yet.
    pub(crate) fn includes_law(&self, law: WearLaw) -> bool {
        matches!(law, WearLaw::None | WearLaw::Onset { .. }) || self.shares[law.family()] >= RULED_OUT
    }
}

/// Yearly seasonal component of the measurement: one phase for a part number's fleet, an amplitude for each unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SeasonParams {
    pub(crate) phase: f64,
    /// Mean amplitude and its spread from unit to unit, metres.
    pub(crate) mean_m: f64,
    pub(crate) sd_m: f64,
}

impl SeasonParams {
    /// Parameters while no fleet is known: no mean amplitude.
    pub(crate) fn unknown(limit_m: f64) -> Self {
        Self { phase: 0.0, mean_m: 0.0, sd_m: PSEUDO_SD * limit_m }
    }

    /// The component of unit amplitude at a time.
    pub(crate) fn wave(&self, departure_us: f64) -> f64 {
        (TAU * departure_us / YEAR_US - self.phase).cos()
    }
}

pub(crate) struct LogPrior<'a> {
    prior: &'a FleetPrior,
    pub(crate) shares: [f64; FAMILIES],
    life: f64,
    fresh: f64,
    worn: f64,
    onset: f64,
}

impl LogPrior<'_> {
    /// Of a component's law, ln life, age and onset, as far as they depend on the fleet.
    pub(crate) fn of(&self, component: &Component) -> f64 {
        let FleetPrior { onsets_per_hour, ln_life, ln_life_sd, .. } = *self.prior;
        let share = self.shares[component.family()];
        if component.onset_pending {
            return share - onsets_per_hour * component.age_now;
        }
        let z = (component.ln_life - ln_life) / ln_life_sd;
        let life = self.life - 0.5 * z * z;
        let age = match component.age_assumption {
            AgeAssumption::NotNeeded => 0.0,
            AgeAssumption::Fresh => self.fresh,
            AgeAssumption::Worn => self.worn,
        };
        match component.law {
            WearLaw::None => share,
            WearLaw::Onset { start } => share + life + self.onset - onsets_per_hour * start,
            _ => share + life + age,
        }
    }
}
